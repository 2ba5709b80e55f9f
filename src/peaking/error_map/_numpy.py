"""The comparison as it is defined, in float64."""

from __future__ import annotations

from itertools import product

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8


def compare(
    rgba: Float32[np.ndarray, "h w 4"],
    live: UInt8[np.ndarray, "h w 3"],
    gain: Float32[np.ndarray, "3"],
    falloff: Float32[np.ndarray, "h w"],
    *,
    threshold: float,
    shift_px: float,
    min_alpha: float,
) -> tuple[Float32[np.ndarray, "h w"], Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Compare; see `peaking.error_map.compare`."""
    alpha = rgba[..., 3:].astype(np.float64)
    straight = rgba[..., :3] / np.where(alpha > 0, alpha, 1.0)
    rendered = np.clip(straight * gain * falloff[..., None], 0.0, 1.0)
    video = live / 255.0
    error = np.maximum(_least(rendered, video, shift_px), _least(video, rendered, shift_px))
    error32 = error.astype(np.float32)
    return error32, error32 > np.float32(threshold), alpha[..., 0] < min_alpha


def _least(
    moved: Float64[np.ndarray, "h w 3"], still: Float64[np.ndarray, "h w 3"], shift_px: float
) -> Float64[np.ndarray, "h w"]:
    """Return the least L1 between the one, displaced in nine ways, and the other."""
    height, width = still.shape[:2]
    padded = np.pad(moved, ((1, 1), (1, 1), (0, 0)), mode="edge")
    least = np.full((height, width), np.inf)
    for dy, dx in product((-1, 0, 1), repeat=2):
        displaced = np.zeros_like(still)
        for (ay, wy), (ax, wx) in product(
            ((0, 1.0 - shift_px), (dy, shift_px)), ((0, 1.0 - shift_px), (dx, shift_px))
        ):
            part = padded[1 + ay : 1 + ay + height, 1 + ax : 1 + ax + width]
            displaced += wy * wx * part
        least = np.minimum(least, np.abs(displaced - still).sum(axis=-1))
    return least
