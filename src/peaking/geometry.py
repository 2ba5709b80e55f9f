"""Cameras and rigid transforms whose names and types say between which frames they go.

Axes, pixel centres and units: CONVENTIONS.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Float64, Real


class World:
    """The frame of the recording: fixed in the room."""


class Cam:
    """The frame of one camera: x right, y down, z forward."""


class Target(Cam):
    """The camera that a view is rendered for."""


class Source(Cam):
    """The camera that photographed an MPI."""


To = TypeVar("To")
Via = TypeVar("Via")
From = TypeVar("From")

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns camera axes; as a right factor of a camera-to-world matrix it is its own inverse."""

RIGID_TOLERANCE = 2e-3
"""How far R^T R may be from the identity. float32 poses of phones are within 1e-6, rotations that
were rounded to three decimals within 2 √3 · 0.0005 = 1.74e-3."""


FAR_M = 1000.0
"""Farther from the origin than this, float32 coordinates are counted from another point."""


@dataclass(frozen=True, eq=False)
class Rigid(Generic[To, From]):
    """A rotation and a translation: `p_to = rotation @ p_from + translation_m`."""

    rotation: Float64[np.ndarray, "3 3"]
    translation_m: Float64[np.ndarray, "3"]

    @classmethod
    def identity(cls) -> Rigid[To, From]:
        """Return the transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: Real[np.ndarray, "4 4"]) -> Rigid[To, From]:
        """Read a 4×4 matrix and make its rotation exactly orthonormal.

        Raises:
            ValueError: An entry is not finite, the last row is not 0 0 0 1, or the 3×3 part is not
                a rotation (to within `RIGID_TOLERANCE`).
        """
        matrix = np.asarray(matrix, dtype=np.float64)
        if not np.isfinite(matrix).all():
            raise ValueError("need finite entries, got NaN or infinity")
        if not np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], atol=1e-6):
            raise ValueError(f"need 0 0 0 1 as the last row, got {matrix[3].tolist()}")
        rotation = matrix[:3, :3]
        away = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if away > RIGID_TOLERANCE:
            raise ValueError(f"need a rotation, got a matrix with |RᵀR - I| = {away:.3g}")
        if np.linalg.det(rotation) < 0:
            raise ValueError("need a rotation, got a mirroring (determinant -1)")
        u, _, vt = np.linalg.svd(rotation)
        return cls(u @ vt, matrix[:3, 3].copy())

    def matrix(self) -> Float64[np.ndarray, "4 4"]:
        """Return the homogeneous 4×4 matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation_m
        return matrix

    def inverse(self) -> Rigid[From, To]:
        """Return the transform the other way."""
        return Rigid(self.rotation.T, -self.rotation.T @ self.translation_m)

    def __matmul__(self, other: Rigid[From, Via]) -> Rigid[To, Via]:
        return Rigid(
            self.rotation @ other.rotation,
            self.rotation @ other.translation_m + self.translation_m,
        )

    def apply(self, points_m: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Move points, in metres."""
        return points_m @ self.rotation.T + self.translation_m


@dataclass(frozen=True)
class Pinhole:
    """Intrinsics without distortion, in pixels with corner origin."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    def __post_init__(self) -> None:
        if self.width_px < 1 or self.height_px < 1:
            raise ValueError(f"need a size of at least 1x1, got {self.width_px}x{self.height_px}")
        numbers = (self.fx_px, self.fy_px, self.cx_px, self.cy_px)
        if not np.isfinite(numbers).all():
            raise ValueError(f"need finite fx, fy, cx, cy, got {numbers}")
        if self.fx_px <= 0 or self.fy_px <= 0:
            raise ValueError(f"need focal lengths > 0, got fx={self.fx_px}, fy={self.fy_px}")

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.width_px, self.height_px

    @property
    def px_from_cam(self) -> Float64[np.ndarray, "3 3"]:
        """The matrix K: homogeneous pixels from camera coordinates."""
        return np.array(
            [[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]]
        )

    @property
    def cam_from_px(self) -> Float64[np.ndarray, "3 3"]:
        """The inverse of K: rays with z = 1 from homogeneous pixels."""
        return np.array(
            [
                [1 / self.fx_px, 0.0, -self.cx_px / self.fx_px],
                [0.0, 1 / self.fy_px, -self.cy_px / self.fy_px],
                [0.0, 0.0, 1.0],
            ]
        )

    def resized(self, width_px: int, height_px: int) -> Pinhole:
        """Return the same camera with another number of pixels."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return Pinhole(
            width_px, height_px, self.fx_px * sx, self.fy_px * sy, self.cx_px * sx, self.cy_px * sy
        )

    def cropped(self, left_px: int, top_px: int, width_px: int, height_px: int) -> Pinhole:
        """Return the camera of a rectangle cut out of the picture."""
        return Pinhole(
            width_px, height_px, self.fx_px, self.fy_px, self.cx_px - left_px, self.cy_px - top_px
        )

    def pixel_centers(self) -> Float64[np.ndarray, "h w 2"]:
        """Return (x, y) of every pixel's centre."""
        x, y = np.meshgrid(np.arange(self.width_px) + 0.5, np.arange(self.height_px) + 0.5)
        return np.stack([x, y], axis=-1)

    def project(self, points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 2"]:
        """Return where points in the camera's frame are seen; NaN where z is not > 0."""
        z_m = points_m[..., 2]
        safe_m = np.where(z_m > 0, z_m, np.nan)
        x_px = self.fx_px * points_m[..., 0] / safe_m + self.cx_px
        y_px = self.fy_px * points_m[..., 1] / safe_m + self.cy_px
        return np.stack([x_px, y_px], axis=-1)

    def rays(self) -> Float64[np.ndarray, "h w 3"]:
        """Return for every pixel's centre the point with z = 1 that is seen there."""
        xy = self.pixel_centers()
        return np.stack(
            [
                (xy[..., 0] - self.cx_px) / self.fx_px,
                (xy[..., 1] - self.cy_px) / self.fy_px,
                np.ones(xy.shape[:2]),
            ],
            axis=-1,
        )


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a picture was taken from, and how its pixels look out."""

    pinhole: Pinhole
    world_from_cam: Rigid[World, Cam]

    @property
    def position_m(self) -> Float64[np.ndarray, "3"]:
        """The centre of projection, in the world."""
        return self.world_from_cam.translation_m

    @property
    def forward(self) -> Float64[np.ndarray, "3"]:
        """The viewing direction, in the world."""
        return self.world_from_cam.rotation[:, 2]

    def relative_to(self, origin_m: Float64[np.ndarray, "3"]) -> Camera:
        """Return the same camera in a world whose origin is at a point of this one."""
        here = self.world_from_cam
        return Camera(self.pinhole, Rigid(here.rotation, here.translation_m - origin_m))

    def resized(self, width_px: int, height_px: int) -> Camera:
        """Return the same camera with another number of pixels."""
        return Camera(self.pinhole.resized(width_px, height_px), self.world_from_cam)

    def project(
        self, points_m: Float[np.ndarray, "*n 3"]
    ) -> tuple[Float64[np.ndarray, "*n 2"], Float64[np.ndarray, "*n"]]:
        """Project points of the world.

        Returns:
            Pixels (NaN where the depth is not > 0), and depth in metres.
        """
        in_cam_m = self.world_from_cam.inverse().apply(np.asarray(points_m, dtype=np.float64))
        return self.pinhole.project(in_cam_m), in_cam_m[..., 2]

    def sees(self, points_m: Float[np.ndarray, "*n 3"]) -> Bool[np.ndarray, "*n"]:
        """Return which points of the world lie in the picture, whatever may hide them."""
        xy_px, depth_m = self.project(points_m)
        inside = (xy_px >= 0).all(axis=-1) & (xy_px <= self.pinhole.size_px).all(axis=-1)
        return (depth_m > 0) & inside


def near_origin_m(cameras: Sequence[Camera]) -> Float64[np.ndarray, "3"]:
    """Return a point, in whole metres, near which float32 is fine enough for what cameras see.

    It is the world's origin where the cameras are within `FAR_M` of it: float32 has 0.06 mm there.
    """
    middle_m = np.stack([camera.position_m for camera in cameras]).mean(axis=0)
    return np.rint(middle_m) if np.linalg.norm(middle_m) > FAR_M else np.zeros(3)


def seen_by(
    cameras: Sequence[Camera], points_m: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, "cameras n"]:
    """Return which points of the world lie in which camera's picture: `Camera.sees` of many."""
    rotations = np.stack([camera.world_from_cam.rotation for camera in cameras])
    positions_m = np.stack([camera.position_m for camera in cameras])
    in_cam_m = (points_m[None] - positions_m[:, None]) @ rotations
    px_from_cam = np.stack([camera.pinhole.px_from_cam for camera in cameras])
    homogeneous = in_cam_m @ px_from_cam.transpose(0, 2, 1)
    ahead = homogeneous[..., 2] > 0
    xy_px = homogeneous[..., :2] / np.where(ahead, homogeneous[..., 2], 1.0)[..., None]
    sizes_px = np.array([camera.pinhole.size_px for camera in cameras])[:, None]
    return ahead & (xy_px >= 0).all(axis=-1) & (xy_px <= sizes_px).all(axis=-1)


def source_from_target(source: Camera, target: Camera) -> Rigid[Source, Target]:
    """Return the transform from the target camera's frame into the source camera's."""
    relative = source.world_from_cam.inverse() @ target.world_from_cam
    return Rigid(relative.rotation, relative.translation_m)
