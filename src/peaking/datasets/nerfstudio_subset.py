"""What of a recording in nerfstudio's format goes with some of its views, and without what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from peaking.datasets.depth_files import depth_size_px, read_depth
from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.recorded_views import ASIDES, RecordedView
from peaking.datasets.transforms_json import Fields, Json
from peaking.errors import OutputError, RecordingError
from peaking.pictures.metadata import without_metadata

_NO_PICTURES = (".npy", ".npz", ".ply")
_TELLING_DEPTHS = (".exr", ".tif", ".tiff")
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
    """Return the files that a subset needs copied, once each.

    Args:
        path: Of transforms.json.
        top: Its shared fields.
        chosen: The views.

    Raises:
        RecordingError: One of them is missing.
    """
    files = {view.picture: None for view in chosen}
    files |= {view.depth: None for view in chosen if view.depth is not None and not is_remade(view)}
    own = [Fields(path, view.entry, {}) for view in chosen]
    asides = [fields.file(key) for key in ASIDES for fields in own]
    asides.append(Fields(path, top, {}).file("ply_file_path"))
    files |= {aside: None for aside in asides if aside is not None}
    return list(files)


def is_remade(view: RecordedView) -> bool:
    """Return whether the depth of a view is written as .npy: metadata of others stay in them."""
    return view.depth is not None and view.depth.suffix.lower() in _TELLING_DEPTHS


def as_written(view: RecordedView) -> RecordedView:
    """Return a view as a subset has it: depth as OpenEXR or TIFF is an .npy there."""
    if view.depth is None or not is_remade(view):
        return view
    name = view.depth.with_suffix(".npy")
    key = "depth_file_path" if view.entry.get("depth_file_path") is not None else "depth_path"
    return replace(view, depth=name, entry={**view.entry, key: name.as_posix()})


def write_depth(view: RecordedView, root: Path, folder: Path, *, within: Path | None) -> None:
    """Write the depth of a view as .npy: 32-bit floats, in the units of its file.

    Args:
        view: One whose depth is remade.
        root: The recording.
        folder: Where to.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: It cannot be read.
    """
    if view.depth is None:
        return
    depth = read_depth(root / view.depth, 1.0, within=within)
    if depth is None:
        width, height = depth_size_px(root / view.depth, within=within)
        depth = np.zeros((height, width), np.float32)
    target = (folder / view.depth).with_suffix(".npy")
    target.parent.mkdir(parents=True, exist_ok=True)
    np.save(target, depth)


def write_files(
    root: Path,
    names: Sequence[Path],
    folder: Path,
    *,
    within: Path | None,
    keep_exif: bool,
) -> None:
    """Copy files of a recording under their own names.

    Args:
        root: The recording.
        names: Relative to it.
        folder: Where to.
        within: A folder; links that lead out of it are refused.
        keep_exif: Keep metadata.

    Raises:
        RecordingError: A file cannot be read, or its metadata cannot be removed.
        OutputError: One was not written faithfully.
    """
    for name in names:
        source, target = root / name, folder / name
        data = read_bytes(source, within=within)
        if may_tell(name) and not keep_exif:
            data = _told_nothing(source, data)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
        if target.read_bytes() != data:
            raise OutputError(f"{target}: was not written faithfully; check the disk")


def may_tell(name: Path) -> bool:
    """Return whether a file may hold metadata."""
    return name.suffix.lower() not in _NO_PICTURES


def _told_nothing(path: Path, data: bytes) -> bytes:
    try:
        return without_metadata(data)
    except ValueError as error:
        raise tells(path, str(error)) from error


def tells(path: Path, problem: str) -> RecordingError:
    """Return the complaint that a file keeps its metadata."""
    remedy = "store it as JPEG or PNG, or keep its metadata by --keep-exif"
    return RecordingError(path, problem, remedy=remedy)
