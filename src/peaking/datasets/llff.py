"""LLFF: poses_bounds.npy, and pictures in the order of their names.

A row for each picture: 3x5, of columns down, right, back, position, (height, width, focal length),
and the distances of the nearest and the farthest thing (Fyusion/LLFF, README). The principal point
is the middle of the picture. There is no depth, and the unit of length is any.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

import numpy as np
from jaxtyping import Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.picture_files import ENDINGS, FOLDERS, lens_for, mask_of
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredPicture
from peaking.datasets.text_tables import counted, pose_of_matrix
from peaking.errors import RecordingError
from peaking.geometry import Pinhole

FILE_NAME = "poses_bounds.npy"
MAX_BYTES = 2**26
_AGAIN = "export the poses again (LLFF's imgs2poses.py)"


def recognises(path: Path) -> bool:
    """Return whether a folder holds poses_bounds.npy."""
    return (path / FILE_NAME).is_file()


def open_recording(
    root: Path, *, images: Path | None = None, confined: bool = False
) -> PosedRecording:
    """Open a data set.

    Args:
        root: The folder that holds poses_bounds.npy.
        images: The folder of its pictures; else the first beside it that holds as many as poses.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    path = root / FILE_NAME
    rows = _rows(path, within)
    pictures = _pictures(root, images, len(rows))
    frames: list[PosedFrame] = []
    for number, (row, picture_path) in enumerate(zip(rows, pictures, strict=True)):
        field = f"row {number}"
        table = row[:15].reshape(3, 5)
        matrix = np.eye(4)
        down, right, back = table[:, 0], table[:, 1], table[:, 2]
        matrix[:3] = np.stack([right, down, -back, table[:, 3]], axis=1)
        pose = pose_of_matrix(path, matrix, field=field)
        if pose is None:
            continue
        picture = StoredPicture.at(picture_path, within=within)
        lens = _lens(path, field, table[:, 4])
        frames.append(
            PosedFrame(
                picture_path.name,
                picture,
                lens_for(path, field, lens, picture.size_px, "LLFF"),
                pose,
                mask=mask_of(picture_path, picture_path.parent, [root]),
            )
        )
    if not frames:
        raise RecordingError(path, "has no finite pose", remedy=_AGAIN)
    notes = [
        *counted(len(rows) - len(frames), "without a finite pose"),
        "its unit of length is taken for the metre: LLFF's own scale is arbitrary",
    ]
    return PosedRecording(root.resolve().name, root, "llff", tuple(frames), tuple(notes), within)


def _rows(path: Path, within: Path | None) -> Float64[np.ndarray, "n 17"]:
    data = read_bytes(path, within=within, at_most=MAX_BYTES)
    try:
        loaded: Any = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # damaged bytes raise anything
        problem = f"is not a sound .npy ({error})".replace("\n", " ")
        raise RecordingError(path, problem, remedy=_AGAIN) from error
    rows = cast("np.ndarray", loaded) if isinstance(loaded, np.ndarray) else np.zeros((0, 0))
    if rows.ndim != 2 or rows.shape[1] != 17 or not len(rows):
        raise RecordingError(path, f"need N x 17 numbers, got {rows.shape}", remedy=_AGAIN)
    if rows.dtype.kind not in "fiu":
        raise RecordingError(path, f"need numbers, got {rows.dtype}", remedy=_AGAIN)
    return rows.astype(np.float64)


def _pictures(root: Path, images: Path | None, count: int) -> list[Path]:
    """Return as many pictures as there are poses, in the order of their names."""
    folders = [images] if images is not None else [root / name for name in FOLDERS]
    numbers: list[str] = []
    for folder in folders:
        if folder.is_dir():
            found = sorted(
                path
                for path in folder.iterdir()
                if path.suffix.lower() in ENDINGS and path.is_file()
            )
            if len(found) == count:
                return found
            if found:
                numbers.append(f"{folder.name or folder}/ has {len(found)}")
    problem = f"has {count} poses, and no folder with as many pictures"
    said = f" ({', '.join(numbers)})" if numbers else ""
    remedy = "put the pictures into images/, one for each pose, or name their folder by --images"
    raise RecordingError(root / FILE_NAME, problem + said, remedy=remedy)


def _lens(path: Path, field: str, size: Float64[np.ndarray, "3"]) -> Lens:
    try:
        height, width, focal_px = (float(number) for number in size)
        pinhole = Pinhole(round(width), round(height), focal_px, focal_px, width / 2, height / 2)
    except (ValueError, OverflowError) as error:
        raise RecordingError(path, str(error), field=field, remedy=_AGAIN) from error
    return Lens(pinhole, (0.0, 0.0, 0.0, 0.0, 0.0))
