"""What of a recording in nerfstudio's format goes with some of its views, and without what."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from peaking.datasets.recorded_views import ASIDES, RecordedView
from peaking.datasets.transforms_json import Fields, Json
from peaking.errors import RecordingError
from peaking.pictures.metadata import without_metadata

_NO_PICTURES = (".npy", ".npz", ".ply")
_SPLITS = ("train_filenames", "val_filenames", "test_filenames")


def top_of_subset(top: Json, chosen: Sequence[RecordedView]) -> dict[str, Any]:
    """Return the shared fields; lists of names for training and testing keep what is there."""
    kept = dict(top)
    names = {view.entry["file_path"] for view in chosen}
    for key in _SPLITS:
        if isinstance(kept.get(key), list):
            kept[key] = [name for name in kept[key] if name in names]
    return kept


def files_of(path: Path, top: Json, chosen: Sequence[RecordedView]) -> list[Path]:
    """Return the files that a subset needs, once each.

    Args:
        path: Of transforms.json.
        top: Its shared fields.
        chosen: The views.

    Raises:
        RecordingError: One of them is missing.
    """
    files = {view.picture: None for view in chosen}
    files |= {view.depth: None for view in chosen if view.depth is not None}
    own = [Fields(path, view.entry, {}) for view in chosen]
    asides = [fields.file(key) for key in ASIDES for fields in own]
    asides.append(Fields(path, top, {}).file("ply_file_path"))
    files |= {aside: None for aside in asides if aside is not None}
    return list(files)


def may_tell(name: Path) -> bool:
    """Return whether a file may hold metadata."""
    return name.suffix.lower() not in _NO_PICTURES


def told_nothing(path: Path, data: bytes) -> bytes:
    """Return the bytes of a file without metadata.

    Raises:
        RecordingError: It is of a kind whose metadata cannot be removed.
    """
    try:
        return without_metadata(data)
    except ValueError as error:
        raise tells(path, str(error)) from error


def tells(path: Path, problem: str) -> RecordingError:
    """Return the complaint that a file keeps its metadata."""
    remedy = "store it as JPEG or PNG, or keep its metadata by --keep-exif"
    return RecordingError(path, problem, remedy=remedy)
