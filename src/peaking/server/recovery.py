"""What a damaged log lost, read from the transforms.json beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from peaking.datasets.transforms_json import read_json
from peaking.errors import RecordingError
from peaking.geometry import OPENCV_FROM_OPENGL
from peaking.server import wire
from peaking.server.dataset import depth_name, photo_name, points_name
from peaking.server.session_log import CaptureStored


def recovered_captures(transforms: Path, *, at_s: float) -> list[CaptureStored]:
    """Return the captures that a session's transforms.json tells of, those that can be read.

    Args:
        transforms: The file.
        at_s: When they are recovered, seconds since 1970.
    """
    folder = transforms.parent
    try:
        frames = read_json(folder, within=folder).get("frames")
    except RecordingError:
        return []
    if not isinstance(frames, list):
        return []
    found = [_stored(frame, at_s) for frame in cast("list[Any]", frames)]
    return [stored for stored in found if stored is not None]


def _stored(frame: Any, at_s: float) -> CaptureStored | None:
    try:
        number = int(frame["file_path"].removeprefix("images/").removesuffix(".jpg"))
        size_px = [frame[key] for key in ("w", "h")]
        lens = [frame[key] for key in ("fl_x", "fl_y", "cx", "cy")]
        matrix = np.array(frame["transform_matrix"], dtype=np.float64) @ OPENCV_FROM_OPENGL
        stored = {
            "type": "CaptureStored",
            "at_s": at_s,
            "id": frame["capture_id"],
            "number": number,
            "camera": wire.Camera(wire.Pinhole(*size_px, *lens), matrix[:3].reshape(-1).tolist()),
            "time_s": frame["timestamp"],
            "depth": frame.get("depth_file_path") == depth_name(number),
            "points": frame.get("ply_file_path") == points_name(number),
        }
        if photo_name(number) != frame["file_path"]:
            return None
        return msgspec.json.decode(msgspec.json.encode(stored), type=CaptureStored)
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError):
        return None
