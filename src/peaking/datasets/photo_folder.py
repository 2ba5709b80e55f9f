"""A folder of photos: poses from COLMAP; focal length, and the turn of each, from EXIF.

A folder without photos of its own is one too, where its folders hold nothing else, as a camera has.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking.datasets.cache import made_once
from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.found_poses import (
    FoundFrame,
    Unplaced,
    find_once,
    for_features,
    recording_in,
)
from peaking.datasets.posed_frames import PictureSource, PosedRecording, StoredPicture
from peaking.datasets.stored_images import (
    explained,
    picture_bytes,
    picture_size_px,
    read_picture,
)
from peaking.pictures import heif
from peaking.pictures.decoding import heif_head
from peaking.pictures.exif import HEAD_BYTES, exif_of, exif_of_block
from peaking.poses.extra import imported
from peaking.poses.structure import Photograph

ENDINGS = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".heic", ".heif")
_BESIDE = (".aae", ".db", ".ini", ".mov", ".mp4")
"""What phones and file managers put beside photos."""
_DEPTH = 3
"""Of folders in folders."""
_TURNS = {3: cv2.ROTATE_180, 6: cv2.ROTATE_90_CLOCKWISE, 8: cv2.ROTATE_90_COUNTERCLOCKWISE}
_MIRRORED = {2: 1, 4: 3, 5: 8, 7: 6}
"""EXIF's mirrored orientations: each is this turn, of the picture flipped left to right."""


@dataclass(frozen=True)
class TurnedPicture:
    """A picture in a file whose EXIF says that it is to be turned (`posed_frames.PictureSource`).

    Attributes:
        path: The file.
        size_px: Upright.
        orientation: EXIF's, 2…8.
        within: A folder; links that lead out of it are refused.
    """

    path: Path
    size_px: tuple[int, int]
    orientation: int
    within: Path | None = None

    @property
    def token(self) -> str:
        """Name and length of the file, and the turn."""
        return f"{self.path.name}:{self.path.stat().st_size}:{self.orientation}"

    def read(self) -> UInt8[np.ndarray, "h w 3"]:
        """Decode and turn it."""
        return upright(read_picture(self.path, within=self.within), self.orientation)

    def stored(self) -> bytes | None:
        """Return None: the stored pixels lie differently."""
        return None


def upright(
    rgb: UInt8[np.ndarray, "h w 3"], orientation: int
) -> UInt8[np.ndarray, "rows columns 3"]:
    """Return a stored picture as EXIF's orientation (1…8) says that it is to be seen."""
    if orientation in _MIRRORED:
        rgb, orientation = np.ascontiguousarray(rgb[:, ::-1]), _MIRRORED[orientation]
    if orientation not in _TURNS:
        return rgb
    return np.asarray(cv2.rotate(rgb, _TURNS[orientation]), np.uint8)


def recognises(path: Path) -> bool:
    """Return whether a folder holds pictures."""
    try:
        return path.is_dir() and bool(_names(path))
    except OSError:
        return False


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open a folder of photos; the first time their poses are looked for, which takes minutes.

    Args:
        root: The folder; those in it are looked at where it holds no photo itself.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        RecordingError: A photo cannot be decoded, or they cannot be joined.
    """
    within = root if confined else None

    def source(kept: FoundFrame) -> PictureSource:
        path = root / kept.name
        if kept.orientation == 1:
            return StoredPicture(path, kept.size_px, within)
        return TurnedPicture(path, kept.size_px, kept.orientation, within)

    def make(out: Path) -> None:
        imported()
        pictures = [_unplaced(root, name, within) for name in _names(root)]
        find_once(out, root, pictures, source, in_order=False)

    return recording_in(made_once(root, "photos", make), root, "photos", source, within=within)


def _names(root: Path) -> list[str]:
    """Return the pictures, relative to the folder, numbers in their names in order."""
    own = [name for name in _files(root) if Path(name).suffix.lower() in ENDINGS]
    return sorted(own or _in_folders(root), key=_natural)


def _in_folders(root: Path) -> list[str]:
    """Return the pictures of the folders in a folder; none where these hold anything else."""
    found: list[str] = []
    level = [Path()]
    for _ in range(_DEPTH):
        level = [folder / name for folder in level for name in _folders(root / folder)]
        for folder in level:
            for name in _files(root / folder):
                ending = Path(name).suffix.lower()
                if ending not in ENDINGS + _BESIDE:
                    return []
                found += [str(folder / name)] if ending in ENDINGS else []
    return found


def _files(folder: Path) -> list[str]:
    entries = (entry for entry in folder.iterdir() if not entry.name.startswith("."))
    return [entry.name for entry in entries if entry.is_file()]


def _folders(folder: Path) -> list[str]:
    entries = (entry for entry in folder.iterdir() if not entry.name.startswith("."))
    return [entry.name for entry in entries if entry.is_dir() and not entry.is_symlink()]


def _natural(name: str) -> tuple[list[tuple[int, str]], str]:
    words = re.findall(r"[0-9]+|[^0-9]+", name.lower())
    return [(int(w), "") if w.isascii() and w.isdigit() else (-1, w) for w in words], name


def _unplaced(root: Path, name: str, within: Path | None) -> Unplaced:
    path = root / name
    head = read_bytes(path, HEAD_BYTES, within=within)
    if heif.is_heif(head):  # decoded upright
        data = picture_bytes(path, within)
        width, height, block = explained(path, heif_head, data)
        exif = replace(exif_of_block(block), orientation=1)
    else:
        exif = exif_of(head)
        width, height = picture_size_px(path, within=within)
    focal_px = exif.focal_px(width, height)
    size_px = (height, width) if exif.orientation >= 5 else (width, height)
    source = TurnedPicture(path, size_px, exif.orientation, within)
    known = "" if focal_px is None else f" {focal_px:.0f}"
    return Unplaced(
        name,
        Photograph(lambda: for_features(source.read()), size_px, f"{size_px}{known}", focal_px),
        orientation=exif.orientation,
    )
