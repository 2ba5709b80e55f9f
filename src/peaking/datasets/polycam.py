"""Polycam's raw data ("developer mode"): keyframes/, with corrected pictures and cameras if any.

Poses are camera-to-world, OpenGL axes, y up (PolyCam/polyform, capture_folder.py). Depth is 16
bits, millimetres, smaller than the picture; confidence is 0, 127 or 255 (0: not sure).
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredDepth, StoredPicture
from peaking.datasets.text_tables import counted, in_number_order, pose_of_matrix
from peaking.errors import RecordingError
from peaking.foreign_json import decode_json
from peaking.geometry import OPENCV_FROM_OPENGL, Pinhole

UNIT_M = 0.001
SURE = 1
"""The least confidence whose depth is taken: all but the lowest of three."""
_MAX_CAMERA_BYTES = 1 << 20
_AGAIN = "export the raw data again from Polycam"


class _Camera(msgspec.Struct):
    """What is read of a camera's JSON."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    t_00: float
    t_01: float
    t_02: float
    t_03: float
    t_10: float
    t_11: float
    t_12: float
    t_13: float
    t_20: float
    t_21: float
    t_22: float
    t_23: float


def recognises(path: Path) -> bool:
    """Return whether a folder is an export of raw data."""
    keyframes = path / "keyframes"
    return (keyframes / "cameras").is_dir() or (keyframes / "corrected_cameras").is_dir()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open an export; frames that Polycam corrected are taken corrected.

    Where some frames are corrected, the others are left out: both kinds of poses do not fit.

    Args:
        root: The folder that holds keyframes/.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    keyframes = root / "keyframes"
    corrected = keyframes / "corrected_cameras"
    is_corrected = corrected.is_dir() and any(corrected.glob("*.json"))
    prefix = "corrected_" if is_corrected else ""
    cameras = in_number_order(list((keyframes / f"{prefix}cameras").glob("*.json")))
    frames: list[PosedFrame] = []
    for path in cameras:
        picture_path = keyframes / f"{prefix}images" / f"{path.stem}.jpg"
        if not picture_path.is_file():
            continue
        frame = _frame(path, picture_path, keyframes, within)
        if frame is not None:
            frames.append(frame)
    if not frames:
        raise RecordingError(keyframes, "has no camera with a picture", remedy=_AGAIN)
    raw = len(list((keyframes / "cameras").glob("*.json")))
    notes = counted(len(cameras) - len(frames), "without a picture or a finite pose")
    notes += counted(max(0, raw - len(cameras)), "that Polycam did not correct")
    if not is_corrected:
        notes.append("poses are the phone's, not corrected by Polycam")
    return PosedRecording(root.resolve().name, root, "polycam", tuple(frames), tuple(notes), within)


def _frame(
    path: Path, picture_path: Path, keyframes: Path, within: Path | None
) -> PosedFrame | None:
    data = read_bytes(path, within=within, at_most=_MAX_CAMERA_BYTES)
    try:
        c = decode_json(data, _Camera)
        pinhole = Pinhole(c.width, c.height, c.fx, c.fy, c.cx, c.cy)
    except ValueError as error:
        raise RecordingError(path, str(error), remedy=_AGAIN) from error
    matrix = np.array(
        [
            [c.t_00, c.t_01, c.t_02, c.t_03],
            [c.t_10, c.t_11, c.t_12, c.t_13],
            [c.t_20, c.t_21, c.t_22, c.t_23],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    pose = pose_of_matrix(path, matrix @ OPENCV_FROM_OPENGL, field="t_00…t_23")
    if pose is None:
        return None
    picture = StoredPicture.at(picture_path, within=within)
    depth_path = keyframes / "depth" / f"{path.stem}.png"
    sure_path = keyframes / "confidence" / f"{path.stem}.png"
    depth = None
    if depth_path.is_file():
        depth = StoredDepth.at(
            depth_path,
            UNIT_M,
            confidence=sure_path if sure_path.is_file() else None,
            least_confidence=SURE,
            within=within,
        )
    lens = Lens(pinhole.resized(*picture.size_px), (0.0, 0.0, 0.0, 0.0, 0.0))
    return PosedFrame(picture_path.name, picture, lens, pose, depth=depth)
