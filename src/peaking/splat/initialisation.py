"""Coloured points to start training from: fused depth maps, or a plane sweep without depth."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float32

from peaking.depth.plane_sweep import focus_distance_m, plane_sweep_depths_m
from peaking.frame import Frame, working_size_px
from peaking.point_cloud import PointCloud

WORKING_PIXELS = 8000
"""Pictures are shrunk to this many pixels first."""
MIN_POINTS = 100
"""With fewer, nothing was found."""


def initial_points(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> PointCloud:
    """Return at most `count` points on surfaces; where none are found, random ones in view."""
    points = surface_points(frames)
    if len(points) < MIN_POINTS:
        points = _random_points([_small(frame) for frame in frames], count, rng)
    return points.thinned(count, rng)


def surface_points(frames: Sequence[Frame]) -> PointCloud:
    """Return points on surfaces, many or none.

    They come from the frames' depth or, where no frame has depth, from a plane sweep.
    """
    small = [_small(frame) for frame in frames]
    with_depth = [frame for frame in small if frame.depth_m is not None]
    if with_depth:
        depths_m = [_depth_of_picture_m(frame) for frame in with_depth]
        pairs = zip(with_depth, depths_m, strict=True)
    else:
        pairs = zip(small, plane_sweep_depths_m(small), strict=True)
    return PointCloud.joined([PointCloud.from_depth(frame, depth_m) for frame, depth_m in pairs])


def _small(frame: Frame) -> Frame:
    width, height = working_size_px(*frame.camera.pinhole.size_px, pixels=WORKING_PIXELS)
    return frame.resized(width, height)


def _depth_of_picture_m(frame: Frame) -> Float32[np.ndarray, "h w"]:
    height, width = frame.rgb.shape[:2]
    stored_m = np.asarray(frame.depth_m)
    return cv2.resize(stored_m, (width, height), interpolation=cv2.INTER_NEAREST)


def _random_points(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> PointCloud:
    """Return points at random pixels and random disparities."""
    focus_m = focus_distance_m([frame.camera for frame in frames])
    parts: list[PointCloud] = []
    for frame in frames:
        shape = frame.rgb.shape[:2]
        depth_m = focus_m / rng.uniform(0.2, 5.0, shape)
        depth_m[rng.random(shape) * depth_m.size > -(-count // len(frames))] = 0
        parts.append(PointCloud.from_depth(frame, depth_m))
    return PointCloud.joined(parts)
