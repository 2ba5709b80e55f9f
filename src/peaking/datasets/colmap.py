"""COLMAP's folders: a sparse model, text or binary, and the pictures beside it.

Poses are world-to-camera in OpenCV axes (doc/format.rst), pixels have corner origin. A picture's
points are those of its own tracks. Depth is that of a dense reconstruction (stereo/depth_maps),
where it is there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64

from peaking.datasets.colmap_model import (
    Model,
    ModelCamera,
    ModelImage,
    ModelPoints,
    ending_of,
    read_model,
)
from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.picture_files import (
    FOLDERS,
    MissingPicture,
    found_pictures,
    in_order,
    lens_for,
    mask_of,
    offset_of,
)
from peaking.datasets.posed_frames import DepthSource, PosedFrame, PosedRecording, StoredPicture
from peaking.datasets.text_tables import counted, rotation_of_quaternion
from peaking.errors import RecordingError
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.limits import MAX_PICTURE_BYTES
from peaking.pictures.too_costly import TooCostly, check_pixels

_PLACES = ("", "sparse", "colmap/sparse", "distorted/sparse", "colmap", "dense/sparse")
"""Where a model lies in a folder, itself or in one of the numbered folders there."""
_DEPTHS = "stereo/depth_maps"
_DEPTH_HEAD = re.compile(rb"(\d{1,6})&(\d{1,6})&1&")
_TOOL = "colmap image_undistorter"
_AGAIN = "run COLMAP's patch_match_stereo again, or remove stereo/depth_maps"

_ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
_TWO_FOCALS = ("PINHOLE", "OPENCV", "FULL_OPENCV")
_ONE_FOCAL_FISHEYES = ("SIMPLE_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
_TWO_FOCALS_FISHEYES = ("FISHEYE", "OPENCV_FISHEYE")
_FISHEYES = _ONE_FOCAL_FISHEYES + _TWO_FOCALS_FISHEYES
"""Models whose parameters are f or fx, fy, then cx, cy, then coefficients in OpenCV's order."""


@dataclass(frozen=True)
class DenseDepth:
    """A depth map of COLMAP's: "W&H&1&" and float32, row by row (mvs/mat.h), in the model's unit.

    Attributes:
        path: The file.
        size_px: Width and height.
        within: A folder; links that lead out of it are refused.
    """

    path: Path
    size_px: tuple[int, int]
    within: Path | None = None

    @classmethod
    def at(cls, path: Path, *, within: Path | None = None) -> DenseDepth:
        """Read its size from its header.

        Raises:
            RecordingError: It cannot be read, or is no depth map of COLMAP's.
        """
        found = _DEPTH_HEAD.match(read_bytes(path, 32, within=within))
        if found is None:
            raise RecordingError(path, "is no depth map of COLMAP's", remedy=_AGAIN)
        size_px = int(found[1]), int(found[2])
        try:
            check_pixels(*size_px)
        except TooCostly as error:
            raise RecordingError(path, str(error), remedy=error.remedy) from error
        return cls(path, size_px, within)

    @property
    def pinhole(self) -> Pinhole | None:
        """None: it covers what the picture covers."""
        return None

    @property
    def token(self) -> str:
        """Name and length of the file."""
        return f"{self.path.name}:{self.path.stat().st_size}"

    @property
    def picture_from_depth(self) -> Rigid[Cam, Cam] | None:
        """None: both are of one camera."""
        return None

    def read(self) -> Float32[np.ndarray, "h w"] | None:
        """Decode it; None where nothing is known.

        Raises:
            RecordingError: It cannot be read, or is cut off.
        """
        data = read_bytes(self.path, within=self.within, at_most=MAX_PICTURE_BYTES)
        width, height = self.size_px
        start = len(f"{width}&{height}&1&")
        if _DEPTH_HEAD.match(data) is None or len(data) != start + 4 * width * height:
            raise RecordingError(self.path, "is cut off", remedy=_AGAIN)
        depth = np.frombuffer(data, "<f4", offset=start).reshape(height, width)
        known = np.isfinite(depth) & (depth > 0)
        return np.where(known, depth, np.float32(0)) if known.any() else None


def recognises(path: Path) -> bool:
    """Return whether a folder is a sparse model, or holds one where COLMAP's users put it."""
    return bool(_models_in(path))


def open_recording(
    root: Path, images: Path | None = None, *, confined: bool = False
) -> PosedRecording:
    """Open a model with its pictures.

    Without any of its pictures it opens for what needs cameras and points alone.

    Args:
        root: The model's folder, or one that holds it as sparse/0, sparse or colmap/sparse/0.
        images: The folder of its pictures; found beside the model by default.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    models = _models_in(root)
    if not models:
        remedy = "name a folder with cameras and images, .bin or .txt, in sparse/0"
        raise RecordingError(root, "holds no COLMAP model", remedy=remedy)
    folder = max(models, key=lambda one: (one / f"images{ending_of(one)}").stat().st_size)
    model = read_model(folder, within=within)
    path = folder / f"images{ending_of(folder)}"
    roots = _around(root, folder, confined=confined)
    if images is not None and not images.is_dir():
        raise RecordingError(images, "is not a folder", remedy="name the folder of the pictures")
    folders = [one / name for one in roots for name in FOLDERS] if images is None else [images]
    pictures, found = found_pictures(path, [image.name for image in model.images], folders)
    notes = ["its unit of length is taken for the metre: COLMAP's own scale is arbitrary"]
    if len(models) > 1:
        notes.append(f"of {len(models)} models the largest is read, {folder.relative_to(root)}")
    is_missing = all(one is None for one in found)
    if is_missing:
        notes.append("none of its pictures was found: name their folder by --images")
    posed = [(image, _pose(image), at) for image, at in zip(model.images, found, strict=True)]
    kept = [
        (image, pose, at)
        for image, pose, at in posed
        if pose is not None and (at is not None or is_missing)
    ]
    if not kept:
        problem = "has no picture with a finite pose" if model.images else "names no picture"
        raise RecordingError(path, problem, remedy="run COLMAP again")
    notes += counted(sum(pose is None for _, pose, _ in posed), "without a finite pose")
    if not is_missing:
        notes += counted(sum(at is None for at in found), f"whose picture is not in {pictures}")
    lenses = {number: _lens(folder, number, model) for number in {i.camera_id for i, _, _ in kept}}
    cameras = [Camera(lenses[image.camera_id].pinhole, pose) for image, pose, _ in kept]
    offset_m, said = offset_of(cameras)
    mask_roots = [*roots, *([] if confined else [pictures.parent])]
    frames: list[PosedFrame] = []
    for (image, _, at), camera in zip(kept, cameras, strict=True):
        lens = lenses[image.camera_id]
        picture = MissingPicture(path, image.name, lens.pinhole.size_px)
        if at is not None:
            own = images if confined and images is not None else within
            picture = StoredPicture.at(at, within=own)
            field = f"camera {image.camera_id}"
            lens = lens_for(path.with_stem("cameras"), field, lens, picture.size_px, _TOOL)
        frames.append(
            PosedFrame(
                image.name,
                picture,
                lens,
                camera.relative_to(offset_m).world_from_cam,
                depth=_depth(image, roots, within),
                mask=None if at is None else mask_of(at, pictures, mask_roots),
                points_m=None
                if model.points is None
                else partial(_seen, model.points, image, offset_m),
            )
        )
    is_inside = pictures.resolve().is_relative_to(root.resolve())
    return PosedRecording(
        root.resolve().name,
        root,
        "colmap",
        in_order(frames),
        (*notes, *said),
        within,
        None if is_inside else pictures,
    )


def _models_in(root: Path) -> list[Path]:
    """Return the folders of models in the first place that has any."""
    for place in _PLACES:
        folder = root / place
        try:
            numbered = sorted(one for one in folder.iterdir() if one.name.isdecimal())
        except (OSError, ValueError):
            continue
        models = [one for one in (folder, *numbered) if ending_of(one) is not None]
        if models:
            return models
    return []


def _around(root: Path, folder: Path, *, confined: bool) -> Sequence[Path]:
    """Return the folders that may hold pictures, masks and depth of a model, the upper ones first.

    They are those from the named one down to the model's, and two above where the model is named
    itself, unless nothing outside may be read.
    """
    around = [one for one in (folder, *folder.parents) if one.is_relative_to(root)]
    if len(around) == 1 and not confined:
        around += list(root.absolute().parents[:2])
        return [*around[1:], around[0]]
    return around[::-1]


def _pose(image: ModelImage) -> Rigid[World, Cam] | None:
    """Return an image's pose; None where it is not finite, or has no rotation."""
    w_x_y_z, translation = image.w_x_y_z, image.translation
    length = float(np.linalg.norm(w_x_y_z))
    if not (np.isfinite(translation).all() and 1e-6 < length < np.inf):
        return None
    cam_from_world = Rigid[Cam, World](rotation_of_quaternion(np.roll(w_x_y_z, -1)), translation)
    return cam_from_world.inverse()


def _lens(folder: Path, number: int, model: Model) -> Lens:
    path, field = folder / f"cameras{ending_of(folder)}", f"camera {number}"
    camera = model.cameras.get(number)
    if camera is None:
        remedy = "export the model again from COLMAP"
        raise RecordingError(path, "is missing, but took a picture", field=field, remedy=remedy)
    try:
        return lens_of(camera)
    except KeyError:
        remedy = f"undistort the pictures first ({_TOOL}; panoramas: colmap's panorama_sfm.py)"
        problem = f"{camera.model} cannot be undistorted here"
    except ValueError as error:
        problem, remedy = str(error), "export the model again from COLMAP"
    raise RecordingError(path, problem, field=field, remedy=remedy)


def lens_of(camera: ModelCamera) -> Lens:
    """Return the lens of a camera model.

    Raises:
        KeyError: The model is none that is read.
        ValueError: A parameter is not finite, or a length not > 0.
    """
    model, p = camera.model, camera.params
    if model not in _ONE_FOCAL + _TWO_FOCALS + _FISHEYES:
        raise KeyError(model)
    if not np.isfinite(p).all():
        raise ValueError(f"need finite parameters, got {p}")
    if model in _ONE_FOCAL + _ONE_FOCAL_FISHEYES:
        p = (p[0], *p)
    pinhole = Pinhole(camera.width_px, camera.height_px, *p[:4])
    k1, k2, p1, p2, k3, k4, k5, k6 = (*p[4:], *(0.0,) * 8)[:8]
    if model in _FISHEYES:
        return Lens(pinhole, fisheye=(k1, k2, p1, p2))
    return Lens(pinhole, (k1, k2, p1, p2, k3), (k4, k5, k6))


def _depth(image: ModelImage, roots: Sequence[Path], within: Path | None) -> DepthSource | None:
    for root in roots:
        path = root / _DEPTHS / f"{image.name}.geometric.bin"
        if path.is_file():
            return DenseDepth.at(path, within=within)
    return None


def _seen(
    points: ModelPoints, image: ModelImage, offset_m: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "n 3"]:
    return points.of(image) - offset_m
