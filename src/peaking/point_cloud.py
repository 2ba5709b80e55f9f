"""Points in the world: coloured clouds, thinning them, and which points a camera sees.

A cloud of a whole data set (nerfstudio's `ply_file_path`) does not say which picture saw a point.
A point counts as hidden when it lies behind the nearest point of its part of the picture; a few
wrong guesses do no harm, since depth is fitted robustly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from peaking.frame import Frame, as_float
from peaking.geometry import Camera

PARTS = 32
"""The longer side of a picture is cut into so many parts, to find what hides what."""
BEHIND = 1.1
"""A point this many times as far as the nearest point of its part counts as hidden."""
MAX_POINTS = 400_000
"""Larger clouds are thinned at random before they are thinned by voxels."""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Coloured points on surfaces.

    Attributes:
        xyz_m: In the world.
        rgb: Colours in 0…1.
        pixel_m: Width of the surface that one pixel of the picture covered.
    """

    xyz_m: Float64[np.ndarray, "n 3"]
    rgb: Float32[np.ndarray, "n 3"]
    pixel_m: Float64[np.ndarray, "n"]

    def __len__(self) -> int:
        return len(self.xyz_m)

    @classmethod
    def joined(cls, parts: Sequence[PointCloud]) -> PointCloud:
        """Return the points of several clouds as one."""
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.xyz_m for part in parts)]),
            np.concatenate([np.zeros((0, 3), np.float32), *(part.rgb for part in parts)]),
            np.concatenate([np.zeros(0), *(part.pixel_m for part in parts)]),
        )

    @classmethod
    def from_depth(
        cls, frame: Frame, depth_m: Float64[np.ndarray, "h w"] | Float32[np.ndarray, "h w"]
    ) -> PointCloud:
        """Return a point for each pixel that counts and has known depth (finite and not 0)."""
        known = np.isfinite(depth_m) & (depth_m > 0)
        if frame.mask is not None:
            known &= frame.mask
        pinhole = frame.camera.pinhole
        known_m = depth_m[known].astype(np.float64)
        in_cam_m = pinhole.rays()[known] * known_m[:, None]
        return cls(
            frame.camera.world_from_cam.apply(in_cam_m),
            as_float(frame.rgb)[known],
            known_m / pinhole.fx_px,
        )

    def select(self, indices: np.ndarray) -> PointCloud:
        """Return the points with these indices."""
        return PointCloud(self.xyz_m[indices], self.rgb[indices], self.pixel_m[indices])

    def thinned(self, count: int, rng: np.random.Generator) -> PointCloud:
        """Return at most `count` points, densest where a picture was taken from near.

        One point is kept in each occupied voxel; the width of a voxel is the same number of pixels
        everywhere.
        """
        if len(self) <= count:
            return self
        points = self.select(rng.permutation(len(self))[:MAX_POINTS])
        first = np.arange(len(points))
        voxel_px = 1.0
        while len(first) > 1.2 * count:
            level = np.round(np.log2(points.pixel_m * voxel_px)).astype(np.int64)
            cells = np.floor(points.xyz_m / np.exp2(level)[:, None]).astype(np.int64)
            key = (cells * np.array([73856093, 19349663, 83492791])).sum(axis=1)
            first = np.unique(key ^ (level * 49979687), return_index=True)[1]
            voxel_px *= 1.19
        return points.select(np.sort(rng.permutation(first)[:count]))


def visible_points(
    points_m: Float64[np.ndarray, "n 3"], camera: Camera
) -> Float64[np.ndarray, "m 3"]:
    """Return the points that lie in a camera's picture and are not hidden there.

    The picture is cut into squares, `PARTS` along its longer side. In each, points more than
    `BEHIND` times as far as the nearest are left out. Where a cloud is so sparse that a square
    holds no point of the surface in front, the points behind it are kept.
    """
    xy_px, depth_m = camera.project(points_m)
    size_px = np.array(camera.pinhole.size_px)
    inside = (depth_m > 0) & ((xy_px >= 0) & (xy_px < size_px)).all(axis=1)
    points_m, xy_px, depth_m = points_m[inside], xy_px[inside], depth_m[inside]
    x, y = (xy_px * PARTS / size_px.max()).astype(np.int64).T
    part = y * PARTS + x
    nearest_m = np.full(PARTS * PARTS, np.inf)
    np.minimum.at(nearest_m, part, depth_m)
    return points_m[depth_m <= BEHIND * nearest_m[part]]
