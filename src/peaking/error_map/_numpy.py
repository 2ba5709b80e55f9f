"""The comparison as it is defined, in float64."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float32, UInt8


def compare(
    rgba: Float32[np.ndarray, "h w 4"],
    live: UInt8[np.ndarray, "h w 3"],
    gain: Float32[np.ndarray, "3"],
    *,
    threshold: float,
    shift_px: int,
    min_alpha: float,
) -> tuple[Float32[np.ndarray, "h w"], Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Compare; see `peaking.error_map.compare`."""
    alpha = rgba[..., 3:].astype(np.float64)
    straight = rgba[..., :3] / np.where(alpha > 0, alpha, 1.0)
    rendered = np.clip(straight * gain, 0.0, 1.0)
    video = live / 255.0
    height, width = alpha.shape[:2]
    padded = np.pad(rendered, ((shift_px, shift_px), (shift_px, shift_px), (0, 0)), mode="edge")
    error = np.full((height, width), np.inf)
    for dy in range(2 * shift_px + 1):
        for dx in range(2 * shift_px + 1):
            moved = padded[dy : dy + height, dx : dx + width]
            error = np.minimum(error, np.abs(moved - video).sum(axis=-1))
    error32 = error.astype(np.float32)
    return error32, error32 > np.float32(threshold), alpha[..., 0] < min_alpha
