"""A picture of the result: photographs, renderings from the same cameras, and their depth."""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from peaking.frame import Frame
from peaking.splat.gaussians import Gaussians
from peaking.splat.rasterise import render

GAP_PX = 4
MIN_ALPHA = 0.5
"""Depth is shown where the opacity is above this."""


def preview(gaussians: Gaussians, frames: Sequence[Frame]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a row for each frame; depth goes from red (near) to blue (far).

    Raises:
        ValueError: There are no frames.
    """
    if not frames:
        raise ValueError("need at least one frame to show, got none")
    rows = [_row(gaussians, frame) for frame in frames]
    width = max(row.shape[1] for row in rows)
    return np.concatenate(
        [np.pad(row, ((0, GAP_PX), (0, width - row.shape[1]), (0, 0))) for row in rows]
    )[:-GAP_PX]


def _row(gaussians: Gaussians, frame: Frame) -> UInt8[np.ndarray, "h w 3"]:
    rendering = render(gaussians, frame.camera)
    rgb = (np.clip(rendering.rgb, 0, 1) * 255 + 0.5).astype(np.uint8)
    depth = _coloured_depth(rendering.depth_m, rendering.alpha)
    gap = np.zeros((len(rgb), GAP_PX, 3), np.uint8)
    return np.concatenate([frame.rgb, gap, rgb, gap, depth], axis=1)


def _coloured_depth(
    depth_m: Float[np.ndarray, "h w"], alpha: Float[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    known = (alpha > MIN_ALPHA) & (depth_m > 0)
    if not known.any():
        return np.zeros((*depth_m.shape, 3), np.uint8)
    disparity = np.divide(1, depth_m, out=np.zeros_like(depth_m), where=known)
    low, high = np.percentile(disparity[known], [2, 98])
    level = np.clip((disparity - low) / max(high - low, 1e-12), 0, 1)
    coloured = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    return np.where(known[..., None], coloured[..., ::-1], 0).astype(np.uint8)
