"""Rendering as the method is defined: float64, dense, one plane after the other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Float64

from peaking.mpi import Mpi


def render(
    mpi: Mpi,
    homographies: Float64[np.ndarray, "planes 3 3"],
    depth_times_w: Float64[np.ndarray, "planes"],
    disparity: Float64[np.ndarray, "planes"],
    size_px: tuple[int, int],
) -> tuple[Float32[np.ndarray, "h w 4"], Float32[np.ndarray, "h w"]]:
    """Render; see `peaking.rendering.render`."""
    width, height = size_px
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    p_target = np.stack([x, y, np.ones_like(x)], axis=-1)
    rgba = np.zeros((height, width, 4))
    weighted = np.zeros((height, width))
    planes = mpi.dense() / 255.0
    for plane, homography, per_w, constant in zip(
        planes, homographies, depth_times_w, disparity, strict=True
    ):
        if np.isnan(homography[0, 0]):
            continue
        p_source = p_target @ homography.T
        w = p_source[..., 2]
        in_front = w > 1e-9
        safe_w = np.where(in_front, w, 1.0)
        layer = sample_bilinear(plane, p_source[..., 0] / safe_w, p_source[..., 1] / safe_w)
        layer *= in_front[..., None]
        keep = 1.0 - layer[..., 3]
        rgba = layer + keep[..., None] * rgba
        weighted = layer[..., 3] * (per_w / safe_w + constant) + keep * weighted
    alpha = rgba[..., 3]
    average = weighted / np.where(alpha > 0, alpha, 1.0)
    return rgba.astype(np.float32), average.astype(np.float32)


def sample_bilinear(
    plane: Float64[np.ndarray, "ph pw 4"],
    x_px: Float64[np.ndarray, "h w"],
    y_px: Float64[np.ndarray, "h w"],
) -> Float64[np.ndarray, "h w 4"]:
    """Sample between texel centres; what lies outside the plane is transparent black."""
    height, width = plane.shape[:2]
    padded = np.zeros((height + 2, width + 2, 4))
    padded[1:-1, 1:-1] = plane
    # Texel centres are at +0.5, and the rim of zeros moves everything by one texel.
    u = np.clip(x_px + 0.5, 0.0, width + 1.0)
    v = np.clip(y_px + 0.5, 0.0, height + 1.0)
    left = np.minimum(np.floor(u).astype(int), width)
    top = np.minimum(np.floor(v).astype(int), height)
    fx, fy = (u - left)[..., None], (v - top)[..., None]
    upper = (1 - fx) * padded[top, left] + fx * padded[top, left + 1]
    lower = (1 - fx) * padded[top + 1, left] + fx * padded[top + 1, left + 1]
    return (1 - fy) * upper + fy * lower
