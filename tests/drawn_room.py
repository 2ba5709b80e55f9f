"""A room with fine texture, photographed exactly, for tests of the alignment."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float64, UInt8

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.rendering import Rendering
from peaking.tracking.solution import rotation_of
from recordings import Room

Paint = Callable[[Float64[np.ndarray, "*n 3"]], Float64[np.ndarray, "*n"]]
"""From points in metres to brightness, 0…1."""

LENS = Pinhole(120, 160, 120.0, 121.0, 61.0, 79.0)
ROOM = Room(box_m=((-0.35, -0.3, 1.0), (0.1, 0.25, 1.3)))


def fine(points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n"]:
    """Return a texture with detail of some centimetres, 0…1."""
    x, y, z = np.moveaxis(points_m, -1, 0)
    waves = np.sin(31 * x + 9 * z) + np.cos(23 * y - 7 * x) + np.sin(17 * x + 29 * y + 5 * z)
    return 0.5 + waves / 8


def upright_stripes(points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n"]:
    """Return a texture that tells nothing of up and down."""
    return 0.5 + 0.3 * np.sin(30 * points_m[..., 0])


def bare(points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n"]:
    """Return no texture at all."""
    return np.full(points_m.shape[:-1], 0.6)


def photographed(
    camera: Camera, paint: Paint = fine
) -> tuple[UInt8[np.ndarray, "h w 3"], Rendering]:
    """Return picture and rendering of the painted room, both exact but for 8 bits."""
    _, depth_m = ROOM.photographed(camera)
    points_m = camera.world_from_cam.apply(camera.pinhole.rays() * depth_m[..., None].astype(float))
    grey = np.round(255 * paint(points_m)).astype(np.uint8)
    rgb = np.repeat(grey[..., None], 3, axis=-1)
    rgba = np.concatenate([rgb / 255, np.ones((*grey.shape, 1))], axis=-1).astype(np.float32)
    return rgb, Rendering(rgba, depth_m)


def disturbed(
    seed: int, move_m: float = 0.01, turn_rad: float = math.radians(0.5), lens: Pinhole = LENS
) -> Camera:
    """Return a camera so far from the origin of the room, some way."""
    random = np.random.default_rng(seed)
    move, turn = random.normal(size=(2, 3))
    rotation = rotation_of(turn / np.linalg.norm(turn) * turn_rad)
    return Camera(lens, Rigid(rotation, move / np.linalg.norm(move) * move_m))
