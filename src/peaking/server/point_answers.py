"""What a capture sees, as a few coloured points of the world: for pictures of the whole place."""

from __future__ import annotations

import cv2
import numpy as np

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.server.open_session import OpenSession

MAX_POINTS = 3000
"""Of one capture."""

STEEP = 0.1
"""Where depth changes by more than this share from one place to the next there is an edge, and
what is measured there lies between the two."""


def captured_points(session: OpenSession, capture_id: str) -> bytes | None:
    """Return the points of a capture; None where nothing is known of its depth. For a thread.

    Returns:
        n × 3 float32 (little-endian), metres of the session's world; then n × 3 bytes of sRGB.

    Raises:
        UnknownCapture: The capture is not here, or was undone.
        RecordingError: Its files cannot be read.
    """
    session.shown_capture(capture_id)
    return encode_points(session.frame_of(capture_id))


def encode_points(frame: Frame) -> bytes | None:
    """Return the points that a frame sees, as `captured_points` does."""
    if frame.depth_m is not None:
        depth_m = frame.depth_m.astype(np.float64)
        height, width = depth_m.shape
        every = max(1, int(np.ceil(np.sqrt(height * width / MAX_POINTS))))
        rows, cols = np.mgrid[every // 2 : height : every, every // 2 : width : every]
        camera = frame.camera.resized(width, height)
        there = _measured(depth_m)[rows, cols]
        rows, cols = rows[there], cols[there]
        in_cam_m = camera.pinhole.rays()[rows, cols] * depth_m[rows, cols][:, None]
        xyz_m = camera.world_from_cam.apply(in_cam_m)
    elif frame.points_m is not None:
        every = -(-len(frame.points_m) // MAX_POINTS)
        xyz_m = frame.points_m[:: max(every, 1)].astype(np.float64)
        xyz_m = xyz_m[frame.camera.sees(xyz_m)]
    else:
        return None
    colours = _colours(frame, xyz_m)
    return xyz_m.astype("<f4").tobytes() + colours.tobytes()


def _measured(depth_m: np.ndarray) -> np.ndarray:
    """Return where there is depth, and no edge."""
    there = depth_m > 0
    known = np.where(there, depth_m, np.inf)
    kernel = np.ones((3, 3))
    nearest = cv2.erode(known, kernel)
    farthest = cv2.dilate(np.where(there, depth_m, 0.0), kernel)
    return there & (farthest - nearest < STEEP * depth_m)


def _colours(frame: Frame, xyz_m: np.ndarray) -> np.ndarray:
    """Return the colours of points where they are in the picture."""
    camera: Camera = frame.camera
    px, _ = camera.project(xyz_m)
    height, width = frame.rgb.shape[:2]
    scale = np.array([width, height]) / camera.pinhole.size_px
    at = np.clip((px * scale).astype(int), 0, [width - 1, height - 1])
    return frame.rgb[at[:, 1], at[:, 0]]
