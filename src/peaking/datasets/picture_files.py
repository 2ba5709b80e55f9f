"""Pictures, masks and lenses of cameras that a file names: of COLMAP, Metashape, RealityCapture."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from jaxtyping import Float64, UInt8

from peaking.datasets.lens import Lens, same_aspect
from peaking.datasets.posed_frames import PosedFrame
from peaking.datasets.stored_images import picture_size_px
from peaking.errors import RecordingError
from peaking.geometry import Camera, near_origin_m

FOLDERS = ("images", "images_2", "images_4", "images_8", "input", "")
"""Where pictures lie beside a file of cameras, the largest first; "" is the folder itself."""
ENDINGS = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".heic", ".heif")
_MASKS = "masks"


@dataclass(frozen=True)
class MissingPicture:
    """A picture that is not there: its camera is, which is enough for what needs no pixels.

    Attributes:
        path: Of the file that names it.
        name: Its own.
        size_px: As the file says.
    """

    path: Path
    name: str
    size_px: tuple[int, int]

    @property
    def token(self) -> str:
        """A word that no file has."""
        return "missing"

    def read(self) -> UInt8[np.ndarray, "h w 3"]:
        """Complain.

        Raises:
            RecordingError: Always.
        """
        remedy = "name the folder of the pictures by --images"
        raise RecordingError(self.path, f"names {self.name!r}, which is not there", remedy=remedy)

    def stored(self) -> bytes | None:
        """Complain.

        Raises:
            RecordingError: Always.
        """
        self.read()


def found_pictures(
    path: Path, names: Sequence[str], folders: Sequence[Path]
) -> tuple[Path, list[Path | None]]:
    """Return the folder that holds most of some pictures, and where each is, None: it is not there.

    A name without an ending stands for the picture that has one.

    Args:
        path: Of the file that names them.
        names: Relative to the folder, or with a root where they come from another machine: then
            their last part is looked for.
        folders: Where they may be; of two that hold as many, the first is taken.

    Raises:
        RecordingError: A name leads out of the folder by "..".
    """
    for name in names:
        if ".." in PurePosixPath(name.replace("\\", "/")).parts or "\0" in name:
            problem = f"names a picture outside its folder: {name!r}"
            raise RecordingError(path, problem, remedy="name pictures relative to their folder")
    best: tuple[Path, list[Path | None]] = (folders[0], [None] * len(names))
    for folder in dict.fromkeys(folders):
        if folder.is_dir():
            by_stem = _by_stem(folder)
            found = [_found(folder, name, by_stem) for name in names]
            if sum(one is not None for one in found) > sum(one is not None for one in best[1]):
                best = folder, found
    return best


def mask_of(picture: Path, folder: Path, roots: Sequence[Path]) -> Path | None:
    """Return the mask of a picture: masks/NAME.jpg.png (COLMAP's way), masks/NAME.png or NAME.jpg.

    Args:
        picture: Where it lies.
        folder: The folder of pictures.
        roots: Folders that may hold the folder of masks.

    Raises:
        RecordingError: The mask is of another aspect than its picture, or is no picture.
    """
    name = picture.relative_to(folder)
    for root in dict.fromkeys(roots):
        masks = root / _MASKS
        tries = (Path(f"{name}.png"), name.with_suffix(".png"), name)
        found = next((masks / one for one in tries if (masks / one).is_file()), None)
        if found is not None:
            size_px, full_px = picture_size_px(found), picture_size_px(picture)
            if not same_aspect(size_px, full_px):
                problem = f"is {size_px[0]}x{size_px[1]}, its picture {full_px[0]}x{full_px[1]}"
                raise RecordingError(found, problem, remedy="store the mask at the picture's size")
            return found
    return None


def lens_for(path: Path, field: str, lens: Lens, stored_px: tuple[int, int], tool: str) -> Lens:
    """Return a lens for a stored picture, whose size may be a multiple of the stated one.

    Args:
        path: Of the file that states the lens.
        field: Where in the file.
        lens: As stated.
        stored_px: Width and height of the picture.
        tool: What undistorts pictures of this format.

    Raises:
        RecordingError: The picture has another aspect, or the lens folds or smears it.
    """
    width_px, height_px = lens.pinhole.size_px
    if not same_aspect(stored_px, (width_px, height_px)):
        problem = f"is for {width_px}x{height_px}, but its picture is {stored_px[0]}x{stored_px[1]}"
        remedy = "give the pictures that the cameras are of, not turned or cropped"
        raise RecordingError(path, problem, field=field, remedy=remedy)
    if lens.fault is not None:
        remedy = f"undistort the pictures first ({tool})"
        raise RecordingError(path, f"the lens would {lens.fault}", field=field, remedy=remedy)
    return lens.resized(*stored_px)


def offset_of(
    cameras: Sequence[Camera],
) -> tuple[Float64[np.ndarray, "3"], list[str]]:
    """Return what positions are counted from, in whole metres, and a note of it.

    It is the origin, and without a note, unless cameras are far from it: coordinates on the earth
    are too long for the numbers of graphics cards and trainers.
    """
    offset_m = near_origin_m(cameras)
    if not offset_m.any():
        return offset_m, []
    said = ", ".join(f"{value:.0f}" for value in offset_m)
    return offset_m, [f"coordinates are counted from ({said}), which is exact"]


def by_number(name: str) -> tuple[tuple[int, int | str], ...]:
    """Return a key that sorts names by the numbers in them: 2 comes before 10."""
    return tuple(
        (0, int(part)) if part.isdecimal() else (1, part)
        for part in re.split(r"([0-9]+)", name)
        if part
    )


def in_order(frames: Sequence[PosedFrame]) -> tuple[PosedFrame, ...]:
    """Return frames by the numbers in their names."""
    return tuple(sorted(frames, key=lambda frame: by_number(frame.name)))


def _by_stem(folder: Path) -> dict[str, Path]:
    """Return the pictures that lie in a folder itself, by their names without endings."""
    return {
        one.stem: one
        for one in sorted(folder.iterdir(), reverse=True)
        if one.suffix.lower() in ENDINGS and one.is_file()
    }


def _found(folder: Path, name: str, by_stem: Mapping[str, Path]) -> Path | None:
    inside = PurePosixPath(name.replace("\\", "/"))
    has_root = inside.is_absolute() or re.match("[A-Za-z]:", name) is not None
    if not has_root and inside.name and (folder / inside).is_file():
        return folder / inside
    if not has_root and len(inside.parts) > 1 and inside.suffix:
        return None
    known = inside.suffix.lower() in ENDINGS
    found = by_stem.get(inside.stem if known else inside.name)
    return found if found is None or not known or found.name == inside.name else None
