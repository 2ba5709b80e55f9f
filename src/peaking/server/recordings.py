"""Recordings that are played as the camera."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from peaking.datasets import Recording
from peaking.geometry import Camera
from peaking.output import depth_mm, encode_jpeg
from peaking.server import wire

DEFAULT_FPS = 15.0


class PlayedRecording:
    """A recording as phones' cameras deliver it: pictures without distortion, depth in mm."""

    def __init__(self, name: str, recording: Recording) -> None:
        """Take an opened recording."""
        self.name = name
        self.recording = recording

    @cached_property
    def index(self) -> wire.RecordingIndex:
        """Cameras and sizes of all frames."""
        frames: list[wire.RecordedFrame] = []
        for number, camera in enumerate(self.recording.cameras):
            size_px = self.recording.depth_size_px(number)
            depth = None if size_px is None else wire.DepthLayout(*size_px)
            frames.append(wire.RecordedFrame(wire_of_camera(camera), depth))
        return wire.RecordingIndex(self.name, _fps(self.recording.timestamps_s), frames)

    def photo(self, index: int) -> bytes:
        """Return a picture as JPEG, its distortion taken out.

        Raises:
            IndexError: There is no such frame.
            RecordingError: Its file is damaged.
        """
        return encode_jpeg(self.recording.read(self._checked(index)).rgb)

    def depth(self, index: int) -> bytes | None:
        """Return a depth map: uint16 millimetres, little-endian, 0 = unknown; None without one.

        Raises:
            IndexError: There is no such frame.
            RecordingError: Its file is damaged.
        """
        depth_m = self.recording.read(self._checked(index)).depth_m
        if depth_m is None:
            size_px = self.recording.depth_size_px(index)
            return None if size_px is None else bytes(2 * size_px[0] * size_px[1])
        return depth_mm(depth_m).astype("<u2").tobytes()

    def _checked(self, index: int) -> int:
        if not 0 <= index < len(self.recording):
            raise IndexError(f"need a frame in 0..{len(self.recording) - 1}, got {index}")
        return index


def wire_of_camera(camera: Camera) -> wire.Camera:
    """Return a camera as it is sent."""
    k = camera.pinhole
    return wire.Camera(
        wire.Pinhole(k.width_px, k.height_px, k.fx_px, k.fy_px, k.cx_px, k.cy_px),
        camera.world_from_cam.matrix()[:3].reshape(-1).tolist(),
    )


def _fps(timestamps: Sequence[float | None]) -> float:
    """Return the rate at which a recording was taken, as far as it says so."""
    known = [t for t in timestamps if t is not None]
    if len(known) < 2 or known[-1] <= known[0]:
        return DEFAULT_FPS
    return float(np.clip((len(known) - 1) / (known[-1] - known[0]), 1.0, 60.0))
