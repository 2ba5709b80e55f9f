"""Coloured points of a place: what its frames saw, thinned."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.frame import Frame, as_float
from peaking.point_cloud import PointCloud

NUM_POINTS = 10_000
"""At most: they tell where surfaces are, and are not the picture."""
POINT_BYTES = 15
"""Of each in the file: three float32 and a colour."""
SAMPLED_PIXELS = 8000
"""Of a frame, at most."""


def seen_points(frames: Iterable[Frame], count: int = NUM_POINTS) -> PointCloud:
    """Return points of some frames: of their depth, or those that they name.

    Args:
        frames: With depth, with points, or without either.
        count: How many, at most; the same for the same frames.
    """
    cloud = PointCloud.joined([_points_of(frame) for frame in frames])
    return cloud.thinned(count, np.random.default_rng(0))


def encode_points(cloud: PointCloud, origin_m: Float64[np.ndarray, "3"]) -> bytes:
    """Return positions, counted from a point, as float32, then colours as bytes."""
    xyz_m = (cloud.xyz_m - origin_m).astype("<f4")
    rgb = np.rint(np.clip(cloud.rgb, 0, 1) * 255).astype(np.uint8)
    return xyz_m.tobytes() + rgb.tobytes()


def _points_of(frame: Frame) -> PointCloud:
    if frame.depth_m is None:
        return _named_points(frame)
    height, width = frame.depth_m.shape
    scale = min(1.0, (SAMPLED_PIXELS / (width * height)) ** 0.5)
    size_px = max(1, round(width * scale)), max(1, round(height * scale))
    depth_m = cv2.resize(frame.depth_m, size_px, interpolation=cv2.INTER_NEAREST)
    return PointCloud.from_depth(frame.resized(*size_px), np.asarray(depth_m, np.float32))


def _named_points(frame: Frame) -> PointCloud:
    """Return the points that a frame names and that lie in its picture."""
    points_m = np.zeros((0, 3)) if frame.points_m is None else frame.points_m
    xy_px, depth_m = frame.camera.project(points_m)
    inside = (depth_m > 0) & ((xy_px >= 0) & (xy_px < frame.camera.pinhole.size_px)).all(axis=1)
    column, row = xy_px[inside].astype(int).T
    return PointCloud(
        points_m[inside],
        as_float(frame.rgb)[row, column],
        depth_m[inside] / frame.camera.pinhole.fx_px,
    )
