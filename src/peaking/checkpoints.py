"""Checkpoints of networks: which files are known, where to put them, and their licences.

Peaking includes none and downloads none. They lie in one folder (`checkpoints_folder`); models of
the Hugging Face hub may also lie in its cache.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from peaking.errors import CheckpointError

DEPTH_MODEL = "depth-anything/Depth-Anything-V2-Small-hf"
"""The default depth estimator."""

DIGEST_LENGTH = 64
"""Length of a SHA-256 in hexadecimal; a name of another length in the cache is not one."""

State = Literal["ok", "missing", "not published", "wrong"]
"""`not published`: the file is there, but its authors' hash is not known."""


@dataclass(frozen=True)
class KnownCheckpoint:
    """A checkpoint that peaking can use.

    Attributes:
        name: Its name in options.
        file: Its path below the folder of checkpoints.
        purpose: What it is used for.
        licence: Of the checkpoint, and where that is written.
        source: Where its authors publish it.
        sha256: Of the file, where its authors' page gives it.
    """

    name: str
    file: str
    purpose: str
    licence: str
    source: str
    sha256: str | None = None


_ADAMPI = (
    "https://github.com/yxuhan/AdaMPI/blob/HEAD/doc/AdaMPI.md "
    "(https://drive.google.com/drive/folders/1NfXUlSTHc390YPkKSeddOghzl0W6q7wn)"
)
_ADAMPI_LICENCE = "personal, research and other non-commercial use only (README of its repository)"

KNOWN = (
    KnownCheckpoint(
        "adampi, 32 planes",
        "adampi_32p.pth",
        "generator, as in the paper",
        _ADAMPI_LICENCE,
        f"{_ADAMPI}; rename the file if it has another name there",
    ),
    KnownCheckpoint(
        "adampi, 64 planes", "adampi_64p.pth", "the same with 64 planes", _ADAMPI_LICENCE, _ADAMPI
    ),
    KnownCheckpoint(
        DEPTH_MODEL,
        "Depth-Anything-V2-Small-hf/model.safetensors",
        "estimates depth for pictures without depth",
        "Apache-2.0 (its card)",
        f"https://huggingface.co/{DEPTH_MODEL}",
        "3152477ce0d8d6978d76b995120de97cb5b928701fd0f817769f59e249a16b70",
    ),
    KnownCheckpoint(
        "depth-anything/Depth-Anything-V2-Base-hf",
        "Depth-Anything-V2-Base-hf/model.safetensors",
        "the same, more detailed and slower",
        "CC-BY-NC-4.0, non-commercial (its card)",
        "https://huggingface.co/depth-anything/Depth-Anything-V2-Base-hf",
    ),
    KnownCheckpoint(
        "depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf",
        "Depth-Anything-V2-Metric-Indoor-Small-hf/model.safetensors",
        "the same as Small, but estimates metres (indoors)",
        "not checked: its card names none (its authors' repository: Small is Apache-2.0)",
        "https://huggingface.co/depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf",
    ),
)
"""As on the authors' pages in November 2026; `not checked` marks what they do not say."""


def checkpoints_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return `PEAKING_CHECKPOINTS`, or `peaking/checkpoints` in the user's data folder."""
    if given := environment.get("PEAKING_CHECKPOINTS"):
        return Path(given)
    data = environment.get("XDG_DATA_HOME") or str(Path.home() / ".local/share")
    return Path(data) / "peaking/checkpoints"


def adampi_file(num_planes: int, folder: Path | None = None) -> Path:
    """Return the path of the AdaMPI checkpoint for this number of planes."""
    return (folder or checkpoints_folder()) / f"adampi_{num_planes}p.pth"


def depth_model_folder(model: str, folder: Path | None = None) -> Path:
    """Find a depth model: a folder, one below the folder of checkpoints, or one in the hub's cache.

    Args:
        model: A path, or a name of the Hugging Face hub (`owner/name`).
        folder: Of checkpoints.

    Raises:
        CheckpointError: It is not found; the message says what to put where.
    """
    for place in (Path(model), (folder or checkpoints_folder()) / Path(model).name, _in_hub(model)):
        if place is not None and (place / "config.json").is_file():
            return place
    where = (folder or checkpoints_folder()) / Path(model).name
    raise CheckpointError(
        f"{model}: the depth model is not here, and peaking downloads nothing; put its "
        f"config.json, preprocessor_config.json and model.safetensors "
        f"(https://huggingface.co/{model}) into {where}"
    )


def file_of(known: KnownCheckpoint, folder: Path) -> Path | None:
    """Return the path of a checkpoint's file, or None."""
    path = folder / known.file
    if path.is_file():
        return path
    cached = _in_hub(known.name)
    path = cached / Path(known.file).name if cached else path
    return path if path.is_file() else None


def state_of(known: KnownCheckpoint, folder: Path) -> State:
    """Look for a checkpoint, and compare it with the hash that its authors published."""
    path = file_of(known, folder)
    if path is None:
        return "missing"
    published = {known.sha256, published_sha256(path)} - {None}
    if not published:
        return "not published"
    return "ok" if sha256_of(path) in published else "wrong"


def published_sha256(path: Path) -> str | None:
    """Return the hash that the hub gave with a file, or None.

    The hub's cache names files by their SHA-256 and links to them; a download into a folder writes
    it to `.cache/huggingface/download/NAME.metadata`, second line.
    """
    if path.is_symlink() and len(path.resolve().name) == DIGEST_LENGTH:
        return path.resolve().name
    note = path.parent / f".cache/huggingface/download/{path.name}.metadata"
    if note.is_file():
        lines = note.read_text(encoding="utf-8").splitlines()
        if len(lines) > 1 and len(lines[1]) == DIGEST_LENGTH:
            return lines[1]
    return None


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _in_hub(model: str) -> Path | None:
    """Return the newest snapshot of a model in the hub's cache, or None."""
    home = Path(os.environ.get("HF_HOME") or Path.home() / ".cache/huggingface")
    hub = Path(os.environ.get("HF_HUB_CACHE") or home / "hub")
    snapshots = hub / f"models--{model.replace('/', '--')}" / "snapshots"
    found = [path for path in snapshots.glob("*") if (path / "config.json").is_file()]
    return max(found, key=lambda path: path.stat().st_mtime, default=None)
