"""Coloured points of a recording for trainers to start from, and which frames see them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from peaking.export.material import Material, points_seen_m
from peaking.frame import Frame, as_float
from peaking.point_cloud import MAX_POINTS, PointCloud

NUM_POINTS = 100_000
"""Written at most."""
LEAST_OF_A_FRAME = 64
NO_POINTS = (
    "the recording has neither depth nor points: none are written for training to start from"
)
SAME_SURFACE = 0.02
"""A frame sees a point where its depth is that of the point to within this share, …"""
SAME_SURFACE_M = 0.005
"""… or this distance."""


@dataclass(frozen=True, eq=False)
class SeedPoints:
    """Points in the world, as written.

    Attributes:
        xyz_m: Where they are.
        rgb: Their colours, 0…255.
    """

    xyz_m: Float64[np.ndarray, "n 3"]
    rgb: UInt8[np.ndarray, "n 3"]

    def __len__(self) -> int:
        return len(self.xyz_m)

    def encode_ply(self) -> bytes:
        """Return a binary .ply: x, y, z in double precision, red, green, blue in bytes."""
        kinds = [*(("double", axis) for axis in "xyz")]
        kinds += [("uchar", colour) for colour in ("red", "green", "blue")]
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(self)}"]
        head += [f"property {kind} {name}" for kind, name in kinds]
        rows = np.zeros(len(self), [("xyz", "<f8", 3), ("rgb", "u1", 3)])
        rows["xyz"], rows["rgb"] = self.xyz_m, self.rgb
        return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes()


@dataclass(eq=False)
class Gathering:
    """Takes some points of every frame, and thins them in the end.

    Attributes:
        material: The frames.
        rng: Chooses points.
    """

    material: Material
    rng: np.random.Generator
    _parts: list[PointCloud] = field(default_factory=list[PointCloud])

    def add(self, frame: Frame) -> None:
        """Take points of a frame."""
        seen = self.material.seen_m(frame)
        quota = max(LEAST_OF_A_FRAME, MAX_POINTS // len(self.material))
        if frame.depth_m is not None and len(seen) > quota:
            seen = seen[np.sort(self.rng.choice(len(seen), quota, replace=False))]
        column, row = np.minimum(seen[:, :2].astype(int), np.array(frame.rgb.shape[1::-1]) - 1).T
        pixel_m = seen[:, 2] / frame.camera.pinhole.fx_px
        xyz_m = points_seen_m(frame.camera, seen)
        self._parts.append(PointCloud(xyz_m, as_float(frame.rgb)[row, column], pixel_m))

    def points(self) -> SeedPoints:
        """Return what was gathered, in any order: at most `NUM_POINTS`.

        Points that many frames name are there once.
        """
        cloud = PointCloud.joined(self._parts)
        if len(cloud):
            _, first = np.unique(np.round(cloud.xyz_m, 9), axis=0, return_index=True)
            cloud = cloud.select(np.sort(first)).thinned(NUM_POINTS, self.rng)
            cloud = cloud.select(self.rng.permutation(len(cloud)))
        return SeedPoints(cloud.xyz_m, np.rint(cloud.rgb * 255).astype(np.uint8))


def seen_points(frame: Frame, points: SeedPoints) -> Int32[np.ndarray, "m"]:
    """Return the numbers of the points that a frame sees: in the picture, not hidden by its depth.

    A frame without depth sees those that it names itself.
    """
    xy_px, depth_m = frame.camera.project(points.xyz_m)
    size_px = frame.camera.pinhole.size_px
    inside = (depth_m > 0) & ((xy_px >= 0) & (xy_px < size_px)).all(axis=1)
    numbers = np.nonzero(inside)[0]
    if frame.depth_m is not None:
        height, width = frame.depth_m.shape
        column, row = (xy_px[numbers] * [width / size_px[0], height / size_px[1]]).astype(int).T
        measured_m = frame.depth_m[np.minimum(row, height - 1), np.minimum(column, width - 1)]
        away_m = np.abs(measured_m - depth_m[numbers])
        near = away_m < np.maximum(SAME_SURFACE_M, SAME_SURFACE * depth_m[numbers])
        numbers = numbers[(measured_m > 0) & near]
    elif frame.points_m is not None and len(frame.points_m):
        own = _keys(frame.points_m)
        numbers = numbers[np.isin(_keys(points.xyz_m[numbers]), own)]
    else:
        numbers = numbers[:0]
    return numbers.astype(np.int32)


def _keys(points_m: Float64[np.ndarray, "n 3"]) -> np.ndarray:
    """Return points to the micrometre, each as one value that can be compared."""
    whole = np.ascontiguousarray(np.round(points_m * 1e6).astype(np.int64))
    return whole.view([("", np.int64)] * 3).ravel()
