"""Stray Scanner: rgb.mp4, odometry.csv, camera_matrix.csv, depth/ and confidence/.

Poses are camera-to-world, OpenCV axes of the camera, y up in the world (strayrobots/scanner,
OdometryEncoder.swift). Each row of odometry.csv is a picture of the video; newer versions of the
app write its intrinsics too. Depth is 16 bits, millimetres; confidence 0, 1, 2.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth
from peaking.datasets.text_tables import (
    Row,
    backwards,
    counted,
    matrix_of,
    pose_of_quaternion,
)
from peaking.datasets.video_frames import VideoFile, VideoPicture
from peaking.errors import RecordingError
from peaking.geometry import Pinhole
from peaking.limits import MAX_TEXT_BYTES

VIDEO, ODOMETRY, MATRIX = "rgb.mp4", "odometry.csv", "camera_matrix.csv"
UNIT_M = 0.001
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_INTRINSICS = ("fx", "fy", "cx", "cy")
_AGAIN = "export the scan again from the app"


def recognises(path: Path) -> bool:
    """Return whether a folder is a scan."""
    return (path / VIDEO).is_file() and (path / ODOMETRY).is_file()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open a scan.

    Args:
        root: The folder.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    video = VideoFile(root / VIDEO, within=within)
    shared = _shared(root / MATRIX, within) if (root / MATRIX).is_file() else None
    header, rows = _table(root / ODOMETRY, within)
    frames: list[PosedFrame] = []
    missing = 0
    for place, row in enumerate(rows):
        number = _number(row, header, place)
        values = _columns(row, header, _POSE)
        pose = pose_of_quaternion(row, values[:3], values[3:])
        if pose is None:
            continue
        if video.stated_frames and number >= video.stated_frames:
            missing += 1
            continue
        k = _intrinsics(row, header)
        k = shared if k is None else k
        if k is None:
            raise RecordingError(root / MATRIX, "does not exist", remedy=_AGAIN)
        frames.append(
            PosedFrame(
                f"{number:06d}.jpg",
                VideoPicture(video, number),
                Lens(_pinhole(row, k, video.size_px), (0.0, 0.0, 0.0, 0.0, 0.0)),
                pose,
                depth=_depth(root, number, within),
                timestamp_s=_time(row, header),
            )
        )
    if not frames:
        raise RecordingError(root / ODOMETRY, "has no finite pose", remedy=_AGAIN)
    notes = counted(len(rows) - len(frames) - missing, "without a finite pose")
    notes += counted(missing, f"beyond the end of {VIDEO}")
    notes += backwards([frame.timestamp_s for frame in frames])
    return PosedRecording(root.resolve().name, root, "stray", tuple(frames), tuple(notes), within)


def _table(path: Path, within: Path | None) -> tuple[dict[str, int], list[Row]]:
    """Return which column each name has, and the lines below the header."""
    data = read_bytes(path, within=within, at_most=MAX_TEXT_BYTES)
    try:
        lines = list(csv.reader(io.StringIO(data.decode("utf-8-sig"))))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(path, f"is no table ({error})", remedy=_AGAIN) from error
    stripped = [tuple(word.strip() for word in line) for line in lines]
    if not stripped or not set(_POSE) <= set(stripped[0]):
        raise RecordingError(path, f"need the columns {', '.join(_POSE)}", remedy=_AGAIN)
    header = {name: column for column, name in enumerate(stripped[0]) if name}
    rows = [Row(path, i + 1, words) for i, words in enumerate(stripped) if i and any(words)]
    return header, rows


def _columns(row: Row, header: dict[str, int], names: Sequence[str]) -> Float64[np.ndarray, "n"]:
    return np.concatenate([row.numbers(header[name], 1) for name in names])


def _number(row: Row, header: dict[str, int], place: int) -> int:
    if "frame" not in header:
        return place
    (number,) = row.numbers(header["frame"], 1)
    if not 0 <= number < 1e9 or number != int(number):
        raise row.wrong(f"need the number of a frame, got {number:g}")
    return int(number)


def _time(row: Row, header: dict[str, int]) -> float | None:
    if "timestamp" not in header:
        return None
    (time_s,) = row.numbers(header["timestamp"], 1)
    return float(time_s) if np.isfinite(time_s) else None


def _intrinsics(row: Row, header: dict[str, int]) -> Float64[np.ndarray, "4"] | None:
    """Return fx, fy, cx, cy of a row, None where it has none."""
    if not set(_INTRINSICS) <= set(header):
        return None
    places = [header[name] for name in _INTRINSICS]
    if max(places) >= len(row.words) or not all(row.words[place] for place in places):
        return None
    return _columns(row, header, _INTRINSICS)


def _shared(path: Path, within: Path | None) -> Float64[np.ndarray, "4"]:
    k = matrix_of(path, 3, 3, within=within)
    return np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2]])


def _pinhole(row: Row, k: Float64[np.ndarray, "4"], size_px: tuple[int, int]) -> Pinhole:
    try:
        return Pinhole(*size_px, *(float(number) for number in k))
    except ValueError as error:
        raise row.wrong(str(error)) from error


def _depth(root: Path, number: int, within: Path | None) -> StoredDepth | None:
    path = next(
        (p for end in ("png", "npy") if (p := root / "depth" / f"{number:06d}.{end}").is_file()),
        None,
    )
    if path is None:
        return None
    sure = root / "confidence" / f"{number:06d}.png"
    return StoredDepth.at(path, UNIT_M, confidence=sure if sure.is_file() else None, within=within)
