"""Coloured points to start from: fused depth maps, or a plane sweep where there is no depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera

SEED_PIXELS = 8000
"""Every picture is looked at so small."""
FEWEST_POINTS = 100
"""With fewer, nothing was found."""
MOST_POINTS = 400_000
"""More are thinned at random before they are thinned with care."""


@dataclass(frozen=True, eq=False)
class Points:
    """Coloured points on surfaces.

    Attributes:
        places_m: In the world.
        rgb: Colours in 0…1.
        pixel_m: How much of the surface one pixel of a small picture covered.
    """

    places_m: Float64[np.ndarray, "n 3"]
    rgb: Float32[np.ndarray, "n 3"]
    pixel_m: Float64[np.ndarray, "n"]

    def __len__(self) -> int:
        return len(self.places_m)

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """Return all points of several sets."""
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.places_m for part in parts)]),
            np.concatenate([np.zeros((0, 3), np.float32), *(part.rgb for part in parts)]),
            np.concatenate([np.zeros(0), *(part.pixel_m for part in parts)]),
        )

    @classmethod
    def seen(
        cls, frame: Frame, depth_m: Float64[np.ndarray, "h w"] | Float32[np.ndarray, "h w"]
    ) -> Points:
        """Return the points of the pixels of a picture whose depth is known (finite, not 0)."""
        known = np.isfinite(depth_m) & (depth_m > 0)
        pinhole = frame.camera.pinhole
        distance_m = depth_m[known].astype(np.float64)
        in_cam_m = pinhole.rays()[known] * distance_m[:, None]
        return cls(
            frame.camera.world_from_cam.apply(in_cam_m),
            unit(frame.rgb)[known],
            distance_m / pinhole.fx_px,
        )

    def chosen(self, indices: np.ndarray) -> Points:
        """Return those that are named."""
        return Points(self.places_m[indices], self.rgb[indices], self.pixel_m[indices])


def seed_points(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> Points:
    """Return at most `count` points on surfaces; where none are found, random ones in view."""
    points = surface_points(frames)
    if len(points) < FEWEST_POINTS:
        points = _strewn([_small(frame) for frame in frames], count, rng)
    return thinned(points, count, rng)


def surface_points(frames: Sequence[Frame]) -> Points:
    """Return points on surfaces, many or none.

    Frames with depth give theirs; without any depth, each frame is compared with others over a
    range of distances (`sweep.py`).
    """
    small = [_small(frame) for frame in frames]
    with_depth = [frame for frame in small if frame.depth_m is not None]
    if with_depth:
        return Points.joined([Points.seen(one, _depth_of_picture_m(one)) for one in with_depth])
    from peaking.splat.sweep import swept_depths_m

    depths_m = swept_depths_m(small)
    return Points.joined([Points.seen(*one) for one in zip(small, depths_m, strict=True)])


def thinned(points: Points, count: int, rng: np.random.Generator) -> Points:
    """Return at most `count`, as densely on every surface as the nearest pictures see it.

    One point is kept in each occupied voxel; a voxel is as wide as so many pixels were there.
    """
    if len(points) <= count:
        return points
    points = points.chosen(rng.permutation(len(points))[:MOST_POINTS])
    first = np.arange(len(points))
    pixels = 1.0
    while len(first) > 1.2 * count:
        level = np.round(np.log2(points.pixel_m * pixels)).astype(np.int64)
        cells = np.floor(points.places_m / np.exp2(level)[:, None]).astype(np.int64)
        key = (cells * np.array([73856093, 19349663, 83492791])).sum(axis=1) ^ (level * 49979687)
        first = np.unique(key, return_index=True)[1]
        pixels *= 1.19
    return points.chosen(np.sort(rng.permutation(first)[:count]))


def unit(rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    """Return colours in 0…1."""
    return rgb.astype(np.float32) / np.float32(255)


def looked_at_m(cameras: Sequence[Camera]) -> float:
    """Return how far off what the cameras look at is: where their axes come nearest each other."""
    positions = np.array([camera.position_m for camera in cameras])
    spread = float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max())
    across = [np.eye(3) - np.outer(camera.forward, camera.forward) for camera in cameras]
    right = np.sum([a @ p for a, p in zip(across, positions, strict=True)], axis=0)
    focus = np.linalg.lstsq(np.sum(across, axis=0), right, rcond=1e-3)[0]
    ahead = [float((focus - camera.position_m) @ camera.forward) for camera in cameras]
    middle = float(np.median(ahead))
    return middle if middle > 0.5 * spread else max(2 * spread, 0.5)


def _small(frame: Frame) -> Frame:
    width, height = working_size_px(*frame.camera.pinhole.size_px, pixels=SEED_PIXELS)
    return frame.resized(width, height)


def _depth_of_picture_m(frame: Frame) -> Float32[np.ndarray, "h w"]:
    height, width = frame.rgb.shape[:2]
    stored_m = np.asarray(frame.depth_m)
    return cv2.resize(stored_m, (width, height), interpolation=cv2.INTER_NEAREST)


def _strewn(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> Points:
    """Return points at random pixels and random disparities."""
    middle_m = looked_at_m([frame.camera for frame in frames])
    found: list[Points] = []
    for frame in frames:
        shape = frame.rgb.shape[:2]
        depth_m = middle_m / rng.uniform(0.2, 5.0, shape)
        depth_m[rng.random(shape) * depth_m.size > -(-count // len(frames))] = 0
        found.append(Points.seen(frame, depth_m))
    return Points.joined(found)
