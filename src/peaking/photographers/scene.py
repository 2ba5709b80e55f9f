# pyright: basic
"""A drawn scene that is drawn from anywhere: light is baked once, then triangles are rasterised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.photographers import _raster_numba
from peaking.photographers.drawn_mesh import DrawnMesh, Panel

LAMPS_PER_PANEL = 9
SHADOW_PX = 192
BOUNCES = 40
"""Small lamps on the surfaces, in place of light that was reflected once or more."""

REFLECTED = 0.45
"""Light that surfaces give back, of what they get."""

EXPOSURE = 0.3
"""Median of the light at all corners."""


@dataclass(frozen=True)
class Scene:
    """Triangles with their light.

    Attributes:
        mesh: What there is.
        light: Linear RGB at every corner; times the texture it is what a camera sees.
    """

    mesh: DrawnMesh
    light: Float32[np.ndarray, "n 3"]

    def draw(self, camera: Camera) -> tuple[UInt8[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]:
        """Return the picture, of 2×2 samples a pixel, and exact depth at the pixel centres.

        Depth is 0 where there is nothing.
        """
        width, height = camera.pinhole.size_px
        seen = _Seen(self.mesh, camera.world_from_cam.rotation, camera.position_m)
        finer = camera.pinhole.resized(2 * width, 2 * height)
        nearness, faces = seen.depth_pass(finer)
        picture = np.empty((height, width, 3), np.float32)
        mesh = self.mesh
        _raster_numba.shade(
            seen.points_m, mesh.faces, mesh.uvs, self.light, mesh.texture_of,
            mesh.density_px_per_m, mesh.textures, mesh.texels, TO_LINEAR, *_intrinsics(finer),
            nearness, faces, picture,
        )  # fmt: skip
        rgb = np.empty((height, width, 3), np.uint8)
        _raster_numba.encode(picture, TONES, TONE_STEPS, rgb)
        return rgb, _depth_m(seen.depth_pass(camera.pinhole)[0])

    def depth_m(self, camera: Camera) -> Float32[np.ndarray, "h w"]:
        """Return exact depth at the pixel centres alone; 0 where there is nothing."""
        seen = _Seen(self.mesh, camera.world_from_cam.rotation, camera.position_m)
        return _depth_m(seen.depth_pass(camera.pinhole)[0])


class _Seen:
    """The mesh in the frame of a camera, whose axes are the columns of a rotation."""

    def __init__(self, mesh: DrawnMesh, rotation: np.ndarray, origin_m: np.ndarray) -> None:
        self._mesh, self._rotation, self._origin_m = mesh, rotation, origin_m
        self.points_m = np.empty(mesh.points_m.shape)  # float64, so that depth is exact
        _raster_numba.to_camera(mesh.points_m, rotation, origin_m, self.points_m)

    def depth_pass(self, pinhole: Pinhole) -> tuple[np.ndarray, np.ndarray]:
        size = (pinhole.height_px, pinhole.width_px)
        nearness, faces = np.empty(size, np.float32), np.empty(size, np.int32)
        ahead = np.empty(len(self._mesh.clusters), np.bool_)
        intrinsics = _intrinsics(pinhole)
        _raster_numba.clusters_ahead(
            self._mesh.clusters, self._rotation, self._origin_m, *intrinsics, *pinhole.size_px,
            ahead,
        )  # fmt: skip
        _raster_numba.depth_pass(
            self.points_m, self._mesh.faces, ahead, *intrinsics, nearness, faces
        )
        return nearness, faces


def bake(mesh: DrawnMesh, panels: Sequence[Panel], rng: np.random.Generator) -> Scene:
    """Light every corner once: many small lamps on the panels, then on what those light.

    Each has six shadow maps. What is reflected is light of the second kind (Keller 1997, instant
    radiosity): lamps at random corners, as bright as these are lit.
    """
    light = np.zeros_like(mesh.points_m)
    for panel in panels:
        normal = np.cross(panel.half_u_m, panel.half_v_m)
        area_m2 = 4 * np.linalg.norm(normal)
        normal /= np.linalg.norm(normal)
        side = round(LAMPS_PER_PANEL**0.5)
        steps = (np.arange(side) + 0.5) / side * 2 - 1
        for a in steps:
            for b in steps:
                at_m = panel.centre_m + a * panel.half_u_m + b * panel.half_v_m + 0.03 * normal
                rgb = panel.rgb * area_m2 / side**2 / np.pi
                _add_lamp(mesh, light, at_m, normal, rgb)
    _bounce(mesh, light, rng)
    light *= EXPOSURE / np.median(light)
    return Scene(mesh, np.where(np.isnan(mesh.glow), light, mesh.glow))


def _bounce(mesh: DrawnMesh, light: np.ndarray, rng: np.random.Generator) -> None:
    corners = mesh.points_m[mesh.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    got = light[mesh.faces[:, 0]].astype(np.float64)
    power = areas * got.mean(axis=1)
    total = (areas[:, None] * got).sum(axis=0) / 2  # of a side alone
    chosen = rng.choice(len(areas), BOUNCES, p=power / power.sum())
    for f in chosen:
        normal = mesh.normals[mesh.faces[f, 0]].astype(np.float64)
        at_m = corners[f].mean(axis=0) + 0.05 * normal
        rgb = REFLECTED * total / BOUNCES / np.pi
        _add_lamp(mesh, light, at_m, normal, rgb)
    light += 0.06 * np.median(light, axis=0)


def _add_lamp(
    mesh: DrawnMesh, light: np.ndarray, at_m: np.ndarray, normal: np.ndarray, rgb: np.ndarray
) -> None:
    pinhole = Pinhole(SHADOW_PX, SHADOW_PX, *(SHADOW_PX / 2,) * 4)
    sides = np.stack([_side(k) for k in range(6)])
    nearness = np.zeros((6, SHADOW_PX, SHADOW_PX), np.float32)
    for k, axes in enumerate(sides):
        nearness[k], _ = _Seen(mesh, np.ascontiguousarray(axes.T), at_m).depth_pass(pinhole)
    _raster_numba.add_lamp(
        mesh.points_m, mesh.normals, at_m, normal, rgb, False, nearness, sides, light
    )


def _side(k: int) -> np.ndarray:
    """Return the axes of a camera that looks along +x, -x, +y, …, as rows."""
    forward = np.zeros(3)
    forward[k // 2] = 1.0 if k % 2 == 0 else -1.0
    right = np.roll(forward, 1)
    return np.stack([right, np.cross(forward, right), forward])


def look(
    pinhole: Pinhole, position_m: Sequence[float] | np.ndarray, yaw_rad: float, pitch_rad: float,
    roll_rad: float = 0.0,
) -> Camera:  # fmt: skip
    """Return a camera of a world with +Z up: yaw from +X towards +Y, pitch upwards."""
    cos_p, sin_p = np.cos(pitch_rad), np.sin(pitch_rad)
    cos_y, sin_y = np.cos(yaw_rad), np.sin(yaw_rad)
    forward = np.array([cos_p * cos_y, cos_p * sin_y, sin_p])
    right = np.array([sin_y, -cos_y, 0.0])
    down = np.cross(forward, right)
    cos_r, sin_r = np.cos(roll_rad), np.sin(roll_rad)
    axes = np.stack([cos_r * right + sin_r * down, cos_r * down - sin_r * right, forward], axis=1)
    return Camera(pinhole, Rigid(axes, np.asarray(position_m, dtype=np.float64)))


def _depth_m(nearness: np.ndarray) -> np.ndarray:
    seen = nearness > 0
    return np.where(seen, 1.0 / np.where(seen, nearness, 1.0), 0.0).astype(np.float32)


def _intrinsics(pinhole: Pinhole) -> tuple[float, float, float, float]:
    return pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px


def _to_linear() -> np.ndarray:
    s = np.arange(256) / 255.0
    return np.where(s > 0.04045, ((s + 0.055) / 1.055) ** 2.4, s / 12.92).astype(np.float32)


def _tones(steps_per_unit: float) -> np.ndarray:
    """Return 8-bit sRGB after a filmic curve (Narkowicz 2016), by the root of linear light."""
    x = (np.arange(int(3 * steps_per_unit)) / steps_per_unit) ** 2
    x = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    srgb = np.where(x > 0.0031308, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055, 12.92 * x)
    return (255 * srgb + 0.5).astype(np.uint8)


TO_LINEAR = _to_linear()
TONE_STEPS = 1024.0
TONES = _tones(TONE_STEPS)
