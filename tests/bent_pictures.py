"""Pictures of the drawn room as a bent lens takes them, whatever its formula."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import UInt8

from peaking.geometry import Camera
from recordings import Room

Bend = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From x, y at z = 1 to where they are seen, over the focal length."""

SEEN_STRAIGHT_TOLERANCE = 1.5
"""Levels, 99th percentile, of the picture made straight again; measured 1.0."""


def bent_picture(camera: Camera, bend: Bend) -> UInt8[np.ndarray, "h w 3"]:
    """Return what the lens shows: the ray of each pixel is found by going back and forth."""
    straight = camera.pinhole.rays()
    x, y = straight[..., 0].copy(), straight[..., 1].copy()
    for _ in range(200):
        bent_x, bent_y = bend(x, y)
        x, y = x + straight[..., 0] - bent_x, y + straight[..., 1] - bent_y
    assert np.abs(np.stack(bend(x, y), axis=-1) - straight[..., :2]).max() < 1e-9
    return Room().seen(np.dstack([x, y, np.ones_like(x)]), camera.world_from_cam)[0]


def assert_straight(rgb: np.ndarray, stored: np.ndarray, camera: Camera, bend: Bend) -> None:
    """Compare a picture that was made straight with the room, where the lens saw it."""
    rays = camera.pinhole.rays()
    bent_x, bent_y = bend(rays[..., 0], rays[..., 1])
    px = camera.pinhole.project(np.dstack([bent_x, bent_y, np.ones_like(bent_x)]))
    inside = ((px > 1) & (px < np.array(camera.pinhole.size_px) - 1)).all(axis=-1)
    assert inside.mean() > 0.8
    expected, depth_m = Room().photographed(camera)
    edges = np.abs(np.gradient(depth_m)).max(axis=0) > 0.02
    kept = inside & ~edges
    away = np.abs(rgb.astype(float) - expected)[kept]
    assert np.percentile(away, 99) < SEEN_STRAIGHT_TOLERANCE
    assert np.percentile(np.abs(stored.astype(float) - expected)[kept], 99) > 8, "it was bent"
