"""What transforms.json says about each picture, checked against the headers of the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from peaking.datasets.depth_files import depth_size_px, is_floating
from peaking.datasets.lens import Lens, same_aspect
from peaking.datasets.stored_images import picture_size_px
from peaking.datasets.transforms_json import UNIT, Fields, Json, depth_of, pose_of
from peaking.datasets.transforms_lens import lens_of
from peaking.errors import RecordingError
from peaking.geometry import Camera

ASIDES = ("mask_path", "ply_file_path", "exact_depth_file_path", "materials_file_path")
"""Files that a frame may have beside picture and depth."""


@dataclass(frozen=True)
class RecordedView:
    """What transforms.json says about one picture; paths are relative to the recording."""

    name: str
    picture: Path
    depth: Path | None
    depth_unit_m: float
    lens: Lens
    camera: Camera
    timestamp_s: float | None
    points: Path | None
    """A point cloud, where there is no depth map."""
    mask: Path | None
    points_unit_m: float
    entry: Json


def view_of(root: Path, fields: Fields, applied_scale: float, within: Path | None) -> RecordedView:
    """Return what a frame says, once its files are looked at.

    Args:
        root: The folder that holds transforms.json.
        fields: Of the frame.
        applied_scale: What its positions were multiplied by.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: A field is missing or wrong, or a file is.
    """
    fields.check_paths()
    picture = fields.file("file_path")
    if picture is None:
        raise fields.wrong("file_path", "is missing")
    world_from_cam = pose_of(fields, applied_scale)
    lens = lens_of(fields, picture_size_px(root / picture, within=within))
    depth, depth_unit_m = depth_of(fields) or (None, 0.001)
    points = None
    if depth is not None:
        _check_aspect(root / depth, depth_size_px(root / depth, within=within), lens)
        if not states_unit(fields) and is_floating(root / depth, within=within):
            raise fields.wrong(
                UNIT,
                "is missing, and floating-point depth is in metres as often as in millimetres",
                remedy="write 1 for metres or 0.001 for millimetres, in the frame or at the top",
            )
    else:
        points = fields.file("ply_file_path")
    mask = fields.file("mask_path")
    if mask is not None:
        _check_aspect(root / mask, picture_size_px(root / mask, within=within), lens)
    for key in ASIDES:  # what is missing is found now, also where it is not needed to read on
        fields.file(key)
    has_time = fields.own.get("timestamp") is not None
    return RecordedView(
        name=picture.stem,
        picture=picture,
        depth=depth,
        depth_unit_m=depth_unit_m,
        lens=lens,
        camera=Camera(lens.pinhole, world_from_cam),
        timestamp_s=fields.number("timestamp") if has_time else None,
        points=points,
        mask=mask,
        points_unit_m=1.0 / applied_scale,
        entry=fields.own,
    )


def states_unit(fields: Fields) -> bool:
    """Return whether a frame's depth states its unit; that of `depth_path` always does."""
    return fields.get(UNIT) is not None or fields.get("depth_file_path") is None


def _check_aspect(path: Path, size_px: tuple[int, int], lens: Lens) -> None:
    if not same_aspect(size_px, lens.pinhole.size_px):
        (width, height), (full_width, full_height) = size_px, lens.pinhole.size_px
        raise RecordingError(
            path,
            f"is {width}x{height}, not of the aspect of its picture ({full_width}x{full_height})",
            remedy="crop or pad it to the picture's field of view",
        )


def refuse_twice(path: Path, views: Sequence[RecordedView]) -> None:
    """Refuse two frames of one picture.

    Raises:
        RecordingError: There are.
    """
    first: dict[Path, int] = {}
    for number, view in enumerate(views):
        if view.picture in first:
            raise RecordingError(
                path,
                f"is the picture of frames[{first[view.picture]}] too",
                field=f"frames[{number}].file_path",
                remedy="remove one of the two frames",
            )
        first[view.picture] = number
