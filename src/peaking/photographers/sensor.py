# pyright: basic
"""What a phone makes of a drawn scene: blur, sparse depth with holes, a pose that is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from peaking.frame import Frame
from peaking.geometry import Camera, Rigid
from peaking.photographers.drawn.phone import phone_depth
from peaking.photographers.scene import Scene
from peaking.photographers.tasks import PINHOLE

EXPOSURE_S = 1 / 60
POSE_NOISE_M, POSE_NOISE_RAD = 0.0015, 0.0012
"""Deviation of the pose, per axis, from frame to frame."""

DRIFT_M = 0.003
"""Deviation of what stays off for a while; it changes within some ten seconds."""

SCALE_NOISE = 0.005
"""Deviation of the scale of a depth map."""

LEAST_BLUR_PX = 0.5


@dataclass(frozen=True)
class Shot:
    """A moment at which the camera looks: all that its frame is made of.

    Attributes:
        number: Of the moment; decides its noise.
        time_s: Since the beginning.
        world_from_cam: Where the camera truly is, row by row, 3×4.
        blur_px: How far the middle of the picture moves while it is exposed, right and down.
    """

    number: int
    time_s: float
    world_from_cam: tuple[float, ...]
    blur_px: tuple[float, float]

    @property
    def camera(self) -> Camera:
        """The camera where it truly is."""
        rows = np.array(self.world_from_cam).reshape(3, 4)
        return Camera(PINHOLE, Rigid(rows[:, :3].copy(), rows[:, 3].copy()))


def as_numbers(camera: Camera) -> tuple[float, ...]:
    """Return a pose as a `Shot` keeps it."""
    matrix = camera.world_from_cam.matrix()[:3]
    return tuple(float(x) for x in matrix.ravel())


def take_frame(scene: Scene, shot: Shot, seed: Sequence[int]) -> Frame:
    """Return what the phone gives for a moment; the same shot and seed give the same frame."""
    rng = np.random.default_rng((*seed, 5, shot.number))
    rgb, depth_m = scene.draw(shot.camera)
    rgb = _blurred(rgb, *shot.blur_px)
    noise = rng.normal(0, 1.2, size=rgb.shape).astype(np.float32)
    rgb = np.clip(rgb + noise + 0.5, 0, 255).astype(np.uint8)
    scale = float(1.0 + SCALE_NOISE * rng.standard_normal())
    sensed = phone_depth(
        np.where(depth_m > 0, depth_m, 20.0), rgb, np.zeros(depth_m.shape, np.float32),
        scale=scale, rng=rng,
    )  # fmt: skip
    return Frame(
        f"frame_{shot.number:05d}",
        rgb,
        told_camera(shot, seed),
        sensed.astype(np.float32) / np.float32(1000),
        timestamp_s=shot.time_s,
    )


def told_camera(shot: Shot, seed: Sequence[int]) -> Camera:
    """Return where the phone says that it is."""
    rng = np.random.default_rng((*seed, 6, shot.number))
    slow = np.random.default_rng((*seed, 7))
    phase = slow.uniform(0, 2 * np.pi, size=(3, 3))
    hertz = slow.uniform(0.02, 0.08, size=(3, 3))
    drift_m = DRIFT_M * np.sqrt(2 / 3) * np.sin(2 * np.pi * hertz * shot.time_s + phase).sum(axis=1)
    turn, _ = cv2.Rodrigues(rng.normal(0, POSE_NOISE_RAD, size=3))
    true = shot.camera.world_from_cam
    off_m = drift_m + rng.normal(0, POSE_NOISE_M, size=3)
    return Camera(PINHOLE, Rigid(true.rotation @ turn, true.translation_m + off_m))


def blur_px(
    camera: Camera, a_moment_later: Camera, moment_s: float, depth_m: float
) -> tuple[float, float]:
    """Return how far the middle of the picture moves while it is exposed.

    Args:
        camera: Where it is.
        a_moment_later: Where it is then.
        moment_s: How much later.
        depth_m: How far away things are.
    """
    ahead_m = camera.world_from_cam.apply(np.array([0.0, 0.0, depth_m]))
    before, _ = camera.project(ahead_m)
    after, _ = a_moment_later.project(ahead_m)
    moved = (after - before) * (EXPOSURE_S / moment_s)
    return float(moved[0]), float(moved[1])


def _blurred(rgb: np.ndarray, right_px: float, down_px: float) -> np.ndarray:
    """Smear a picture along a line."""
    length = float(np.hypot(right_px, down_px))
    if length < LEAST_BLUR_PX:
        return rgb
    steps = np.linspace(-0.5, 0.5, 2 * int(np.ceil(length)) + 1)
    reach = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    for step in steps:
        x, y = reach + step * right_px, reach + step * down_px
        x0, y0 = int(x), int(y)
        for dy, wy in ((0, 1 - y + y0), (1, y - y0)):
            for dx, wx in ((0, 1 - x + x0), (1, x - x0)):
                if wx * wy > 0:
                    kernel[y0 + dy, x0 + dx] += wx * wy
    return cv2.filter2D(rgb, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
