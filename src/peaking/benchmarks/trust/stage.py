"""A scene made ready: frames and truth at the working size, views that are built once."""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.benchmarks.trust.judge import Judge
from peaking.benchmarks.trust.scene import BETWEEN, TrustScene
from peaking.frame import Frame, as_float
from peaking.geometry import Camera
from peaking.metric_depth import CapturedView
from peaking.metrics.flip import flip_map
from peaking.options import DEFAULT, Options
from peaking.rendering import Rendering
from peaking.view_builder import ViewBuilder

T = TypeVar("T")

SEED = 18

FRAMES_KEPT = 48
"""Decoded frames in memory: half a megabyte each."""

VIEWS = 15
"""How many views there are where a measure does not say otherwise."""

TURN_M_PER_RAD = 0.5
"""A turn of one radian counts as much as so many metres, when the nearest frame is looked for."""

COVERED = 0.95
"""Opacity of a rendering from which on a pixel counts as rendered."""

WRONG, RIGHT = 0.5, 0.2
"""FLIP from which on a rendered pixel is truly wrong, and up to which it is right; what lies
between counts as neither. From 0.5 on, the median L1 over RGB is above 0.42 (desk and 7-Scenes
kitchen, views 10 and 20 cm away), about the paper's threshold of 0.4."""


@dataclass(frozen=True)
class Plan:
    """How much is measured.

    Attributes:
        poses: Pictures of each group, or of each kind of disturbance.
        constructed: Pictures that faults are put into.
        steps: Views that are added one by one, of `useful`.
        frames: Consecutive frames, of `steady`.
    """

    poses: int = 6
    constructed: int = 3
    steps: int = 12
    frames: int = 36


QUICK = Plan(poses=2, constructed=1, steps=4, frames=10)


class Stage:
    """A scene at the working size."""

    def __init__(
        self, scene: TrustScene, options: Options = DEFAULT, *, plan: Plan | None = None
    ) -> None:
        """Build nothing yet.

        Args:
            scene: The recording and its truth.
            options: Of the method.
            plan: How much is measured.
        """
        self.scene = scene
        self.options = options
        self.plan = plan or Plan()
        self._builder = ViewBuilder(options)
        self._views: dict[int, CapturedView] = {}
        self.frame = lru_cache(FRAMES_KEPT)(self._frame)
        self.seen_truth = lru_cache(128)(self._seen_truth)

    def rng(self, *words: object) -> np.random.Generator:
        """Return a source of random numbers that follows from the scene and some words."""
        told = " ".join(str(word) for word in (self.scene.recording.name, *words))
        return np.random.default_rng([SEED, zlib.crc32(told.encode())])

    def judge(self, numbers: Sequence[int]) -> Judge:
        """Return a judge that has these views."""
        return Judge(self.options, [self.view(number) for number in numbers])

    def view(self, number: int) -> CapturedView:
        """Return the view of a frame."""
        if number not in self._views:
            self._views[number] = self._builder.build(self.scene.recording.read(number))
        return self._views[number]

    def views(self, count: int) -> tuple[int, ...]:
        """Return so many of the scene's views, spread evenly; all where there are fewer."""
        return tuple(spread(self.scene.views, count))

    def held_out(self, group: str | None = None) -> list[int]:
        """Return the held-out frames, or those of a group."""
        return [i for i, own in self.scene.held_out.items() if group in (None, own)]

    def close_to(self, numbers: Sequence[int], count: int) -> list[int]:
        """Return held-out frames that are near views: of each part of the list, the nearest one.

        They are those between the views, where there are any.
        """
        every = self.held_out(BETWEEN) or self.held_out()
        count = min(count, len(every))
        cameras = [self.camera(number) for number in numbers]
        chosen: list[int] = []
        for k in range(count):
            part = every[len(every) * k // count : len(every) * (k + 1) // count]
            away = [min(apart(self.camera(i), view) for view in cameras) for i in part]
            chosen.append(part[int(np.argmin(away))])
        return chosen

    def camera(self, number: int) -> Camera:
        """Return a frame's camera, as it was recorded."""
        return self.scene.recording.cameras[number]

    def materials(self, number: int) -> UInt8[np.ndarray, "h w"]:
        """Return what a frame's pixels show; 0 everywhere where nobody knows."""
        height, width = self.frame(number).rgb.shape[:2]
        labels = self.scene.materials(number)
        if labels is None:
            return np.zeros((height, width), np.uint8)
        return _resized(labels, width, height)

    def depth_m(self, number: int) -> Float32[np.ndarray, "h w"]:
        """Return the true depth; 0 = unknown."""
        height, width = self.frame(number).rgb.shape[:2]
        depth_m = self.scene.true_depth_m(number)
        return cv2.resize(depth_m, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)

    def _frame(self, number: int) -> Frame:
        """Return a frame at the working size, with the depth of its sensor."""
        return self._builder.prepare(self.scene.recording.read(number))

    def _seen_truth(
        self, numbers: tuple[int, ...], index: int
    ) -> tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
        """Return what of a frame some views saw, and where that is known."""
        height, width = self.frame(index).rgb.shape[:2]
        seen, known = self.scene.seen_truth(numbers, index)
        return (
            _resized(seen.astype(np.uint8), width, height) > 0,
            _resized(known.astype(np.uint8), width, height) > 0,
        )


def as_picture(rendering: Rendering) -> UInt8[np.ndarray, "h w 3"]:
    """Return a rendering as a camera's picture; holes take the colours around them."""
    rgba = rendering.rgba
    if rendering.alpha.min() < COVERED:
        around = cv2.GaussianBlur(rgba, (0, 0), 12.0)
        around[..., :3] /= np.maximum(around[..., 3:], np.float32(1e-3))
        around[..., 3] = 1
        rgba = rgba + (1 - rgba[..., 3:]) * around
    return np.round(255 * np.clip(rgba[..., :3], 0, 1)).astype(np.uint8)


def true_error(
    rendering: Rendering, live: UInt8[np.ndarray, "h w 3"], counted: Bool[np.ndarray, "h w"]
) -> Float32[np.ndarray, "h w"]:
    """Return how different a rendering looks from the picture of the same pose: FLIP, 0…1.

    FLIP because it is neither rule's. What changed in between is the camera's exposure, which is no
    error: the rendering is given, per channel, the gain that fits the pixels that count best.
    """
    photo = as_float(live)
    shown = rendering.rgba[..., :3].copy()
    for c in range(3):
        ours, theirs = rendering.rgba[..., c][counted], photo[..., c][counted]
        shown[..., c] *= _fitted_gain(ours, theirs)
    return flip_map(np.clip(shown, 0, 1), photo)


def _fitted_gain(ours: Float32[np.ndarray, "n"], theirs: Float32[np.ndarray, "n"]) -> np.float32:
    """Return the gain of least squares over pixels that are not clipped, the worst left out."""
    good = (theirs < 0.97) & (theirs > 0.03) & (ours > 0.03) & (ours < 0.97)
    ours, theirs = ours[good], theirs[good]
    gain = 1.0
    for _ in range(5):
        if len(ours) < 100:
            return np.float32(1)
        gain = float(ours @ theirs) / float(ours @ ours)
        off = np.abs(gain * ours - theirs)
        keep = off <= max(0.02, 2.5 * float(np.median(off)))
        ours, theirs = ours[keep], theirs[keep]
    return np.float32(gain)


def spread(items: Sequence[T], count: int) -> list[T]:
    """Return at most `count` of the items, evenly, the first and the last among them."""
    if len(items) <= count:
        return list(items)
    if count == 1:
        return [items[len(items) // 2]]
    return [items[round(k * (len(items) - 1) / (count - 1))] for k in range(count)]


def apart(a: Camera, b: Camera) -> float:
    """Return how far two cameras are apart, in metres; a turn counts too."""
    return distance_m(a, b) + TURN_M_PER_RAD * angle_rad(a, b)


def distance_m(a: Camera, b: Camera) -> float:
    """Return the distance between two cameras."""
    return float(np.linalg.norm(a.position_m - b.position_m))


def angle_rad(a: Camera, b: Camera) -> float:
    """Return the angle of the rotation between two cameras."""
    turn = a.world_from_cam.rotation.T @ b.world_from_cam.rotation
    return float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))


def grown(mask: Bool[np.ndarray, "h w"], radius_px: int) -> Bool[np.ndarray, "h w"]:
    """Return a mask and what lies within a radius (a square) around it."""
    return cv2.dilate(mask.astype(np.uint8), _square(radius_px)) > 0


def shrunk(mask: Bool[np.ndarray, "h w"], radius_px: int) -> Bool[np.ndarray, "h w"]:
    """Return a mask without what lies within a radius (a square) of its border."""
    return cv2.erode(mask.astype(np.uint8), _square(radius_px)) > 0


def _square(radius_px: int) -> UInt8[np.ndarray, "n n"]:
    return np.ones((2 * radius_px + 1, 2 * radius_px + 1), np.uint8)


def _resized(
    labels: UInt8[np.ndarray, "h w"], width_px: int, height_px: int
) -> UInt8[np.ndarray, "height width"]:
    return cv2.resize(labels, (width_px, height_px), interpolation=cv2.INTER_NEAREST_EXACT)
