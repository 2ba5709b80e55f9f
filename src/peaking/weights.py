"""Learned weights: which files there can be, where they lie, their licences; none comes with us.

Nothing here fetches anything. Weights lie in one folder (`weights_folder`); models of the Hugging
Face hub may lie in its cache as well.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from peaking.errors import WeightsError

DEPTH_MODEL = "depth-anything/Depth-Anything-V2-Small-hf"
"""The default depth estimator."""

DIGEST_LENGTH = 64
"""Of SHA-256 in hexadecimal: names of other lengths in the cache are no digests of contents."""

State = Literal["ok", "missing", "not published", "wrong"]
"""`not published`: is there, and no hash of its authors is known to compare with."""


@dataclass(frozen=True)
class KnownWeights:
    """Something that can be brought.

    Attributes:
        name: What options call it.
        file: Its file, below the folder of weights.
        purpose: What it does here.
        licence: Of the weights, and who says so.
        source: Where its authors offer it.
        sha256: Of the file, where its authors' page says it.
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
    KnownWeights(
        "adampi, 32 planes",
        "adampi_32p.pth",
        "generator, as in the paper",
        _ADAMPI_LICENCE,
        f"{_ADAMPI}; its name there was not checked, rename it where it differs",
    ),
    KnownWeights(
        "adampi, 64 planes", "adampi_64p.pth", "generator, finer", _ADAMPI_LICENCE, _ADAMPI
    ),
    KnownWeights(
        DEPTH_MODEL,
        "Depth-Anything-V2-Small-hf/model.safetensors",
        "depth of pictures without it",
        "Apache-2.0 (its card)",
        f"https://huggingface.co/{DEPTH_MODEL}",
        "3152477ce0d8d6978d76b995120de97cb5b928701fd0f817769f59e249a16b70",
    ),
    KnownWeights(
        "depth-anything/Depth-Anything-V2-Base-hf",
        "Depth-Anything-V2-Base-hf/model.safetensors",
        "the same, finer and slower",
        "CC-BY-NC-4.0, non-commercial (its card)",
        "https://huggingface.co/depth-anything/Depth-Anything-V2-Base-hf",
    ),
    KnownWeights(
        "depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf",
        "Depth-Anything-V2-Metric-Indoor-Small-hf/model.safetensors",
        "the same as Small, guesses metres (rooms)",
        "not checked: its card names none (its authors' repository: Small is Apache-2.0)",
        "https://huggingface.co/depth-anything/Depth-Anything-V2-Metric-Indoor-Small-hf",
    ),
)
"""Looked up on the authors' pages in November 2026; what was not found there is `not checked`."""


def weights_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for weights: `PEAKING_WEIGHTS`, or `peaking/weights` among user data."""
    if given := environment.get("PEAKING_WEIGHTS"):
        return Path(given)
    data = environment.get("XDG_DATA_HOME") or str(Path.home() / ".local/share")
    return Path(data) / "peaking/weights"


def adampi_file(num_planes: int, folder: Path | None = None) -> Path:
    """Return where the AdaMPI weights for so many planes are looked for."""
    return (folder or weights_folder()) / f"adampi_{num_planes}p.pth"


def depth_model_folder(model: str, folder: Path | None = None) -> Path:
    """Find a depth model: a folder, one below the folder of weights, or in the hub's cache.

    Args:
        model: A path, or a name of the Hugging Face hub (`owner/name`).
        folder: Of weights.

    Raises:
        WeightsError: It is nowhere; says what to put where.
    """
    for place in (Path(model), (folder or weights_folder()) / Path(model).name, _in_hub(model)):
        if place is not None and (place / "config.json").is_file():
            return place
    where = (folder or weights_folder()) / Path(model).name
    raise WeightsError(
        f"{model}: the depth model is not here, and peaking downloads nothing; put its "
        f"config.json, preprocessor_config.json and model.safetensors "
        f"(https://huggingface.co/{model}) into {where}"
    )


def file_of(known: KnownWeights, folder: Path) -> Path | None:
    """Return where weights lie, or None."""
    path = folder / known.file
    if path.is_file():
        return path
    cached = _in_hub(known.name)
    path = cached / Path(known.file).name if cached else path
    return path if path.is_file() else None


def state_of(known: KnownWeights, folder: Path) -> State:
    """Look for weights, and compare them with the hash that their authors published."""
    path = file_of(known, folder)
    if path is None:
        return "missing"
    published = {known.sha256, published_sha256(path)} - {None}
    if not published:
        return "not published"
    return "ok" if sha256_of(path) in published else "wrong"


def published_sha256(path: Path) -> str | None:
    """Return the hash that the hub gave with a file, or None.

    The hub's cache names contents by their SHA-256 and links to them; downloads into a folder note
    it in `.cache/huggingface/download/NAME.metadata`, second line.
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
