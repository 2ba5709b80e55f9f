"""The fields of transforms.json, each checked once, with the field's name in every complaint.

A field may stand in a frame or, for all frames, at the top. Of the dialects, nerfstudio's,
instant-ngp's and Blender's are read; lenses that are no pinhole with OpenCV's five distortion
coefficients are refused.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.errors import RecordingError
from peaking.geometry import OPENCV_FROM_OPENGL, Cam, Pinhole, Rigid, World
from peaking.limits import MAX_TRANSFORMS_BYTES, MAX_TRANSFORMS_DEPTH, MAX_TRANSFORMS_VALUES

Json = Mapping[str, Any]

FILE_NAME = "transforms.json"
SPLIT_NAMES = ("transforms_train.json", "transforms_val.json", "transforms_test.json")
"""Of data sets in several files (NeRF's synthetic scenes, nerfstudio's older exports)."""

UNIT = "depth_unit_scale_factor"
"""Metres per value of a depth map."""
MILLIMETRE_M = 0.001
"""The unit of depth maps in whole numbers that state none, as nerfstudio has it."""
_NGP_UNIT, _NERFCAPTURE_UNIT = "integer_depth_scale", "depth_integer_scale"
_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
_BENDS = ("k1", "k2", "p1", "p2", "k3")
_BENDS_TOO_MUCH = ("k4", "k5", "k6")
_PICTURE_ENDINGS = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG")
_LEAVES = re.compile(r"/|\.\.(/|\Z)|[A-Za-z]:")
"""How a path begins that leaves its folder: a root, the folder above, a drive."""
_PATHS = ("_path", "_paths", "_filename", "_filenames")
_EXPORT_AGAIN = "export the recording again as nerfstudio's transforms.json"


@dataclass(frozen=True)
class Fields:
    """The fields of one frame, or of the top when `place` is empty."""

    path: Path
    own: Json
    shared: Json
    place: str = ""

    def wrong(self, key: str, problem: str, *, remedy: str = _EXPORT_AGAIN) -> RecordingError:
        """Return the complaint about a field, wherever it stands."""
        at_top = not self.place or (key in self.shared and key not in self.own)
        prefix = "" if at_top else f"{self.place}."
        return RecordingError(self.path, problem, field=f"{prefix}{key}", remedy=remedy)

    def get(self, key: str) -> Any:
        """Return a field of the frame or of the top; None when there is none."""
        return self.own.get(key, self.shared.get(key))

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number.

        Raises:
            RecordingError: It is missing and has no default, no number, or not finite.
        """
        value = self.get(key)
        if value is None and default is not None:
            return default
        if value is None:
            raise self.wrong(key, f"is missing{', here and at the top' if self.place else ''}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.wrong(key, f"need a number, got {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.wrong(key, f"need a finite number, got {number}")
        return number

    def positive(self, key: str, default: float | None = None) -> float:
        """Return a finite number above 0."""
        number = self.number(key, default)
        if number <= 0:
            raise self.wrong(key, f"need a number > 0, got {number:g}")
        return number

    def count(self, key: str) -> int:
        """Return a whole number above 0."""
        number = self.positive(key)
        if number != round(number):
            raise self.wrong(key, f"need a whole number, got {number:g}")
        return round(number)

    def text(self, key: str) -> str | None:
        """Return a text, or None when it is missing or null."""
        value = self.get(key)
        if value is None:
            return None
        if not isinstance(value, str) or not value:
            raise self.wrong(key, f"need a text, got {_shown(value)}")
        return value

    def file(self, key: str) -> Path | None:
        """Return the path, relative to the recording, of a file that exists; None when missing.

        Raises:
            RecordingError: No text, outside the folder, or no such file.
        """
        text = self.text(key)
        if text is None:
            return None
        name = self._inside(key, text)
        endings = _PICTURE_ENDINGS if key == "file_path" else ("",)
        # os.path's test answers False for names that no file can have; Path's raises.
        root = self.path.parent
        found = (name + end for end in endings if os.path.isfile(root / (name + end)))  # noqa: PTH113
        existing = next(found, None)
        if existing is None:
            raise self.wrong(
                key,
                f"there is no file {_shown(text)}",
                remedy=f"put it there or remove {'the frame' if key == 'file_path' else key}",
            )
        return Path(existing)

    def check_paths(self) -> None:
        """Refuse every own field that is a path, also of other programs, and leaves the recording.

        Fields are paths whose names end in `_path`, `_paths`, `_filename` or `_filenames`, however
        deep they lie.

        Raises:
            RecordingError: It has a root, a drive, a backslash or a zero byte, or goes up by "..".
        """
        for key, value in self.own.items():
            if key != "frames":
                for path in _texts(value, is_path=key.endswith(_PATHS)):
                    self._inside(key, path)

    def _inside(self, key: str, text: str) -> str:
        """Return a path in its shortest form."""
        name = os.path.normpath(text)
        if _LEAVES.match(name) or "\\" in text or "\0" in text:
            raise self.wrong(
                key,
                f"points outside the recording: {_shown(text)}",
                remedy="put the file into the folder and name it relative to transforms.json, "
                'with "/" between folders',
            )
        return name


def file_of(root: Path) -> Path:
    """Return the file of a folder that tells its frames: transforms.json, or the first of several.

    Where there is none it is transforms.json.
    """
    names = (FILE_NAME, *SPLIT_NAMES)
    return next((root / name for name in names if os.path.lexists(root / name)), root / FILE_NAME)


def read_json(root: Path, *, within: Path | None = None) -> Json:
    """Read transforms.json of a folder, or transforms_train.json and the others as one.

    Frames of several files have all fields of their own file.

    Args:
        root: The folder.
        within: A folder; a link that leads out of it is refused.

    Raises:
        RecordingError: The folder or the file is missing, or it is not a JSON object, or holds more
            than is read (`peaking.limits`).
    """
    if not root.is_dir():
        problem = "is not a folder" if root.exists() else "does not exist"
        raise RecordingError(root, problem, remedy="give the folder that holds transforms.json")
    first = file_of(root)
    if not os.path.lexists(first):
        remedy = "give the folder that holds it: a recording in nerfstudio's format"
        raise RecordingError(first, "does not exist", remedy=remedy)
    if first.name == FILE_NAME:
        return _read(first, within)
    frames: list[Any] = []
    for name in SPLIT_NAMES:
        if os.path.lexists(root / name):
            top = _read(root / name, within)
            shared = {key: value for key, value in top.items() if key != "frames"}
            frames += [{**shared, **fields.own} for fields in frames_of(root / name, top)]
    return {"frames": frames}


def _read(path: Path, within: Path | None) -> Json:
    data = read_bytes(path, within=within, at_most=MAX_TRANSFORMS_BYTES)
    # Every field and item follows one of these; a few more stand in texts. One may take 200 bytes.
    values = sum(data.count(mark) for mark in b",[{")
    if values > MAX_TRANSFORMS_VALUES:
        problem = f"holds {values:,} values, and at most {MAX_TRANSFORMS_VALUES:,} are read"
        raise RecordingError(path, problem, remedy="leave out frames, or fields of frames")
    try:
        value = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise RecordingError(path, f"is not JSON ({error})", remedy=_EXPORT_AGAIN) from error
    if not isinstance(value, dict):
        problem = f"need a JSON object, got {_shown(value)}"
        raise RecordingError(path, problem, remedy=_EXPORT_AGAIN)
    if _is_deep(cast(Json, value)):
        problem = f"is nested more than {MAX_TRANSFORMS_DEPTH} deep"
        raise RecordingError(path, problem, remedy=_EXPORT_AGAIN)
    return cast(Json, value)


def frames_of(path: Path, top: Json) -> Iterator[Fields]:
    """Yield the fields of every frame, in the order of the file.

    Raises:
        RecordingError: `frames` is missing, no list, or empty, or a frame is no object.
    """
    fields = Fields(path, top, {})
    if "frames" not in top:
        raise fields.wrong("frames", "is missing")
    frames = top["frames"]
    if not isinstance(frames, list):
        raise fields.wrong("frames", f"need a list, got {_shown(frames)}")
    if not frames:
        raise fields.wrong("frames", "is empty", remedy="record at least one picture")
    shared = {key: value for key, value in top.items() if key != "frames"}
    for number, own in enumerate(cast(list[Any], frames)):
        place = f"frames[{number}]"
        if not isinstance(own, dict):
            problem = f"need an object, got {_shown(own)}"
            raise RecordingError(path, problem, field=place, remedy=_EXPORT_AGAIN)
        yield Fields(path, cast(Json, own), shared, place)


def lens_of(fields: Fields, stored_px: tuple[int, int]) -> Lens:
    """Return the lens of a frame for its stored picture, whose size may be a multiple of w, h.

    Raises:
        RecordingError: A field is missing or wrong, the lens is of another kind or folds the
            picture, or the picture has another aspect.
    """
    _refuse_other_lenses(fields)
    by_angle = fields.get("fl_x") is None and fields.get("camera_angle_x") is not None
    if by_angle and fields.get("w") is None and fields.get("h") is None:
        width_px, height_px = stored_px  # Blender's files hold no size
    else:
        width_px, height_px = fields.count("w"), fields.count("h")
    if by_angle:
        fx_px = width_px / 2 / math.tan(_angle_rad(fields, "camera_angle_x") / 2)
        fy_px = fx_px
        if fields.get("camera_angle_y") is not None:
            fy_px = height_px / 2 / math.tan(_angle_rad(fields, "camera_angle_y") / 2)
        cx_px, cy_px = fields.number("cx", width_px / 2), fields.number("cy", height_px / 2)
    else:
        fx_px = fields.positive("fl_x")
        fy_px = fields.positive("fl_y", fx_px)
        cx_px, cy_px = fields.number("cx"), fields.number("cy")
    if not same_aspect(stored_px, (width_px, height_px)):
        raise fields.wrong(
            "w",
            f"w, h are {width_px}x{height_px}, but the picture is {stored_px[0]}x{stored_px[1]}",
            remedy="turn or crop the picture to that aspect, or correct the intrinsics",
        )
    pinhole = Pinhole(width_px, height_px, fx_px, fy_px, cx_px, cy_px)
    k1, k2, p1, p2, k3 = (fields.number(key, 0.0) for key in _BENDS)
    lens = Lens(pinhole, (k1, k2, p1, p2, k3))
    if lens.fault is not None:
        bends = ", ".join(f"{key} {fields.number(key, 0.0):g}" for key in _BENDS)
        raise fields.wrong(
            next(key for key in _BENDS if fields.number(key, 0.0) != 0),
            f"the lens would {lens.fault} ({bends})",
            remedy="calibrate the camera again with more pictures, or with k1 and k2 alone",
        )
    return lens.resized(*stored_px)


def pose_of(fields: Fields, applied_scale: float) -> Rigid[World, Cam]:
    """Return `world_from_cam` in OpenCV axes, in the units that depth is stored in.

    Raises:
        RecordingError: The matrix is missing, not 4×4 numbers, not finite or not rigid.
    """
    key = "transform_matrix"
    value = fields.own.get(key)
    if value is None:
        raise fields.wrong(key, "is missing")
    try:
        matrix = np.array(value)
    except (ValueError, OverflowError):
        matrix = np.array(None)
    if matrix.shape != (4, 4) or matrix.dtype.kind not in "if":
        raise fields.wrong(key, f"need 4 rows of 4 numbers, got {_shown(value)}")
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers end as "not rigid"
            world_from_opengl = Rigid[World, Cam].from_matrix(matrix.astype(np.float64))
    except ValueError as error:
        remedy = "correct the pose or remove the frame"
        raise fields.wrong(key, str(error), remedy=remedy) from error
    rotation = world_from_opengl.rotation @ OPENCV_FROM_OPENGL[:3, :3]
    return Rigid(rotation, world_from_opengl.translation_m / applied_scale)


def depth_of(fields: Fields) -> tuple[Path, float] | None:
    """Return the depth map's relative path and its unit in metres; None when there is none.

    Raises:
        RecordingError: The file is missing or outside the folder, or the unit is wrong.
    """
    path = fields.file("depth_file_path")
    if path is not None:
        return path, fields.positive(UNIT, MILLIMETRE_M)
    path = fields.file("depth_path")
    if path is None:
        return None
    if fields.get(UNIT) is not None:
        return path, fields.positive(UNIT)
    if fields.get(_NGP_UNIT) is None and fields.get(_NERFCAPTURE_UNIT) is not None:
        raise fields.wrong(
            _NERFCAPTURE_UNIT,
            "is no unit of depth_path: NeRFCapture writes 1, whatever the unit",
            remedy=f"say it in metres as {_NGP_UNIT}, {MILLIMETRE_M:g} for millimetres, or remove "
            "depth_path from the frames",
        )
    return path, fields.positive(_NGP_UNIT)  # instant-ngp has no default


def same_aspect(small_px: tuple[int, int], large_px: tuple[int, int]) -> bool:
    """Return whether both cover the same field of view, to within one pixel of the first."""
    (width, height), (large_width, large_height) = small_px, large_px
    return (
        abs(width * large_height / large_width - height) <= 1
        or abs(height * large_width / large_height - width) <= 1
    )


def _refuse_other_lenses(fields: Fields) -> None:
    model = fields.text("camera_model") or "OPENCV"
    remedy = "undistort the pictures first (colmap image_undistorter, or nerfstudio's own tools)"
    if model not in _MODELS:
        raise fields.wrong(
            "camera_model",
            f"{_shown(model)} cannot be read: only {', '.join(_MODELS)}",
            remedy=remedy,
        )
    if fields.get("is_fisheye"):
        raise fields.wrong("is_fisheye", "fisheye lenses cannot be read", remedy=remedy)
    for key in _BENDS_TOO_MUCH:
        if fields.number(key, 0.0) != 0:
            raise fields.wrong(
                key,
                f"only {', '.join(_BENDS)} can be undistorted, but {key} is not 0",
                remedy=remedy,
            )


def _is_deep(value: Json) -> bool:
    """Return whether lists and objects are nested deeper than is read."""
    level: list[Any] = [value]
    for _ in range(MAX_TRANSFORMS_DEPTH):
        level = [inner for outer in level for inner in _inside(outer)]
    return bool(level)


def _inside(value: Any) -> Iterator[Any]:
    """Yield the lists and objects that a list or an object holds."""
    inner = cast("Json", value).values() if isinstance(value, dict) else cast("list[Any]", value)
    yield from (cast(Any, one) for one in inner if isinstance(one, list | dict))


def _texts(value: Any, *, is_path: bool) -> Iterator[str]:
    """Yield the texts in a value that are paths."""
    if isinstance(value, str) and is_path:
        yield value
    elif isinstance(value, list):
        for inner in cast("list[Any]", value):
            yield from _texts(inner, is_path=is_path)
    elif isinstance(value, dict):
        for key, inner in cast("dict[str, Any]", value).items():
            yield from _texts(inner, is_path=is_path or key.endswith(_PATHS))


def _angle_rad(fields: Fields, key: str) -> float:
    angle_rad = fields.positive(key)
    if angle_rad >= math.pi:
        raise fields.wrong(key, f"need an angle in radians, below pi, got {angle_rad:g}")
    return angle_rad


def _shown(value: object) -> str:
    """Return a value as it stands in the file, shortened to fit in a sentence."""
    text = json.dumps(value, ensure_ascii=False)
    text = text if text.isprintable() else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
