"""What a photographer sees on the screen: how much is red, where, and an arrow to what was red."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.pipeline import Reconstruction

SPOT = 24
"""Red is looked at in spots of a picture's width divided by this."""

REMEMBERED = 12
"""Places that were red and left the picture."""


@dataclass(frozen=True)
class Shown:
    """The screen at one moment.

    Attributes:
        peaked_share: How much is red, 0…1.
        towards_rad: How far to the right and up the middle of what is red is, or what the arrow
            shows where little is; None: nothing to go to.
    """

    peaked_share: float
    towards_rad: tuple[float, float] | None


class Screen:
    """Compares what the camera sees with what the views show, as the capture page does."""

    def __init__(self, scene: Reconstruction, little_share: float) -> None:
        """Show red of a scene; below so much of it, an arrow to what was red before."""
        self._scene = scene
        self._little_share = little_share
        self._spots_m: list[Float64[np.ndarray, "3"]] = []

    def show(self, frame: Frame) -> Shown:
        """Return what is on the screen for a frame."""
        seen = self._scene.compare(frame.rgb, frame.camera, depth_m=frame.depth_m)
        share = seen.errors.peaked_share
        middle_px, strength = _reddest(seen.errors.peaked)
        self._remember(frame, seen.errors.peaked, middle_px if strength > 0.5 else None)
        if share >= self._little_share:
            return Shown(share, _angles(frame.camera, _ray(frame.camera, middle_px)))
        return Shown(share, self._arrow(frame.camera))

    def _remember(
        self,
        frame: Frame,
        red: Bool[np.ndarray, "h w"],
        middle_px: tuple[float, float] | None,
    ) -> None:
        kept: list[Float64[np.ndarray, "3"]] = []
        for spot_m in self._spots_m:
            (xy_px,), (depth_m,) = frame.camera.project(spot_m[None])
            inside = depth_m > 0 and bool(frame.camera.sees(spot_m[None])[0])
            if not inside or red[int(xy_px[1]) - 1, int(xy_px[0]) - 1]:
                kept.append(spot_m)
        if middle_px is not None and frame.depth_m is not None and (frame.depth_m > 0).any():
            depth_m = float(np.median(frame.depth_m[frame.depth_m > 0]))
            kept.append(frame.camera.position_m + depth_m * _ray(frame.camera, middle_px))
        self._spots_m = kept[-REMEMBERED:]

    def _arrow(self, camera: Camera) -> tuple[float, float] | None:
        """Return the angles to the nearest place that was red and is outside the picture."""
        outside = [spot_m for spot_m in self._spots_m if not camera.sees(spot_m[None])[0]]
        if not outside:
            return None
        angles = [_angles(camera, spot_m - camera.position_m) for spot_m in outside]
        return min(angles, key=lambda angle: angle[0] ** 2 + angle[1] ** 2)


def _reddest(red: Bool[np.ndarray, "h w"]) -> tuple[tuple[float, float], float]:
    """Return the middle of the reddest part of a picture, and how red it is there, 0…1."""
    width = red.shape[1]
    soft = cv2.GaussianBlur(red.astype(np.float32), (0, 0), width / SPOT)
    row, col = np.unravel_index(int(soft.argmax()), soft.shape)
    return (float(col) + 0.5, float(row) + 0.5), float(soft[row, col])


def _ray(camera: Camera, xy_px: tuple[float, float]) -> Float64[np.ndarray, "3"]:
    """Return the direction of a pixel in the world, one metre ahead."""
    k = camera.pinhole
    ray = np.array([(xy_px[0] - k.cx_px) / k.fx_px, (xy_px[1] - k.cy_px) / k.fy_px, 1.0])
    return camera.world_from_cam.rotation @ ray


def _angles(camera: Camera, toward: Float64[np.ndarray, "3"]) -> tuple[float, float]:
    """Return how far to the right and up a direction of the world is, in radians."""
    x, y, z = camera.world_from_cam.rotation.T @ toward
    return float(np.arctan2(x, z)), float(np.arctan2(-y, np.hypot(x, z)))
