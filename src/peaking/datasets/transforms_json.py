"""The fields of transforms.json, each checked once, with the field's name in every complaint.

A field may stand in a frame or, for all frames, at the top. Of the dialects, nerfstudio's,
instant-ngp's and Blender's are read. Paths are made relative to the recording when the file is
read (`transforms_paths`); its lenses are read in `transforms_lens`.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.transforms_paths import (
    PICTURE_ENDINGS,
    inner_values,
    leaves,
    make_relative,
    paths_in,
)
from peaking.errors import RecordingError
from peaking.geometry import OPENCV_FROM_OPENGL, Cam, Rigid, World
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
            raise self.wrong(key, f"need a number, got {shown(value)}")
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
            raise self.wrong(key, f"need a text, got {shown(value)}")
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
        endings = PICTURE_ENDINGS if key == "file_path" else ("",)
        # os.path's test answers False for names that no file can have; Path's raises.
        root = self.path.parent
        found = (name + end for end in endings if os.path.isfile(root / (name + end)))  # noqa: PTH113
        existing = next(found, None)
        if existing is None:
            raise self.wrong(
                key,
                f"there is no file {shown(text)}",
                remedy=f"put it there or remove {'the frame' if key == 'file_path' else key}",
            )
        return Path(existing)

    def has_file(self, key: str) -> bool:
        """Return whether a field names a file that exists.

        Raises:
            RecordingError: No text, or outside the folder.
        """
        text = self.text(key)
        return text is not None and os.path.isfile(self.path.parent / self._inside(key, text))  # noqa: PTH113

    def check_paths(self) -> None:
        """Refuse every own field that is a path, also of other programs, and leaves the recording.

        Fields are paths whose names end in `_path`, `_paths`, `_filename` or `_filenames`, however
        deep they lie.

        Raises:
            RecordingError: It has a root, a drive, a backslash or a zero byte, or goes up by "..".
        """
        for key, value in self.own.items():
            if key != "frames":
                for path in paths_in(key, value):
                    self._inside(key, path)

    def _inside(self, key: str, text: str) -> str:
        """Return a path in its shortest form."""
        if leaves(text):
            raise self.wrong(
                key,
                f"points outside the recording: {shown(text)}",
                remedy="put the file into the folder and name it relative to transforms.json, "
                'with "/" between folders',
            )
        return os.path.normpath(text)


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
        problem = f"need a JSON object, got {shown(value)}"
        raise RecordingError(path, problem, remedy=_EXPORT_AGAIN)
    if _is_deep(cast(Json, value)):
        problem = f"is nested more than {MAX_TRANSFORMS_DEPTH} deep"
        raise RecordingError(path, problem, remedy=_EXPORT_AGAIN)
    make_relative(cast("dict[str, Any]", value), path.parent)
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
        raise fields.wrong("frames", f"need a list, got {shown(frames)}")
    if not frames:
        raise fields.wrong("frames", "is empty", remedy="record at least one picture")
    shared = {key: value for key, value in top.items() if key != "frames"}
    for number, own in enumerate(cast(list[Any], frames)):
        place = f"frames[{number}]"
        if not isinstance(own, dict):
            problem = f"need an object, got {shown(own)}"
            raise RecordingError(path, problem, field=place, remedy=_EXPORT_AGAIN)
        yield Fields(path, cast(Json, own), shared, place)


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
        raise fields.wrong(key, f"need 4 rows of 4 numbers, got {shown(value)}")
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
    is_nerfcaptures = fields.get(_NGP_UNIT) is None and fields.get(_NERFCAPTURE_UNIT) is not None
    if is_nerfcaptures and not fields.has_file("depth_path"):
        return None  # the app names maps that it does not write
    path = fields.file("depth_path")
    if path is None:
        return None
    if fields.get(UNIT) is not None:
        return path, fields.positive(UNIT)
    if is_nerfcaptures:
        raise fields.wrong(
            _NERFCAPTURE_UNIT,
            "is no unit of depth_path: NeRFCapture writes 1, whatever the unit",
            remedy=f"say it in metres as {_NGP_UNIT}, {MILLIMETRE_M:g} for millimetres, or remove "
            "depth_path from the frames",
        )
    return path, fields.positive(_NGP_UNIT)  # instant-ngp has no default


def _is_deep(value: Json) -> bool:
    """Return whether lists and objects are nested deeper than is read."""
    level: list[Any] = [value]
    for _ in range(MAX_TRANSFORMS_DEPTH):
        level = [inner for outer in level for inner in inner_values(outer)]
    return bool(level)


def shown(value: object) -> str:
    """Return a value as it stands in the file, shortened to fit in a sentence."""
    text = json.dumps(value, ensure_ascii=False)
    text = text if text.isprintable() else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
