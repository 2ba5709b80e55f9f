"""What the network is shown: relative disparity, sharp at edges, at a size that it takes."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from peaking.errors import PeakingError

MULTIPLE_PX = 128
"""Sides that the network takes are multiples of this: it looks at 1/128 of the size."""
MIN_SIDE_PX = 128
"""Of pictures; smaller ones would mostly be padding."""

EDGE = 0.03
"""Change of relative disparity from pixel to pixel that counts as an edge."""

MIN_SPAN = 0.01
"""Least range of disparities, as a part of the largest: of a wall seen head-on."""


class Inputs(NamedTuple):
    """A picture ready for the network.

    Attributes:
        rgb: 0…1, padded on the right and below.
        disparity: 0 (farthest) … 1 (nearest), padded alike.
        range_per_m: Disparities in 1/m of 0 and 1.
    """

    rgb: Float32[np.ndarray, "ph pw 3"]
    disparity: Float32[np.ndarray, "ph pw"]
    range_per_m: tuple[float, float]


def inputs_of(rgb: UInt8[np.ndarray, "h w 3"], depth_m: Float32[np.ndarray, "h w"]) -> Inputs:
    """Prepare a picture and its depth as the network's training data were prepared.

    Raises:
        PeakingError: The picture is smaller than the network's least size.
        ValueError: Sizes differ, or a depth is not a number > 0.
    """
    height, width = rgb.shape[:2]
    if depth_m.shape != (height, width):
        raise ValueError(f"need depth of the picture's size {rgb.shape[:2]}, got {depth_m.shape}")
    if min(height, width) < MIN_SIDE_PX:
        raise PeakingError(
            f"the picture is {width}x{height}, AdaMPI needs {MIN_SIDE_PX} pixels per side or "
            "more; use more pixels (--pixels) or the generator `layered`"
        )
    if not (np.isfinite(depth_m).all() and depth_m.min() > 0):
        raise ValueError("need a depth > 0 at every pixel; complete the depth first")
    disparity_per_m = 1.0 / depth_m
    nearest = float(disparity_per_m.max())
    farthest = min(float(disparity_per_m.min()), nearest * (1.0 - MIN_SPAN))
    relative = (disparity_per_m - farthest) / (nearest - farthest)
    sharp = sharp_edges(relative.astype(np.float32))
    padding = (0, -height % MULTIPLE_PX, 0, -width % MULTIPLE_PX)
    return Inputs(
        cv2.copyMakeBorder(
            (rgb / np.float32(255.0)).astype(np.float32), *padding, cv2.BORDER_REPLICATE
        ).astype(np.float32),
        cv2.copyMakeBorder(sharp, *padding, cv2.BORDER_REPLICATE).astype(np.float32),
        (farthest, nearest),
    )


def sharp_edges(disparity: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    """Give pixels on slopes between two surfaces the disparity of the nearest pixel that is on one.

    Args:
        disparity: Relative, 0…1.
    """
    across = cv2.Sobel(disparity, cv2.CV_32F, 1, 0, scale=1 / 8, borderType=cv2.BORDER_REPLICATE)
    down = cv2.Sobel(disparity, cv2.CV_32F, 0, 1, scale=1 / 8, borderType=cv2.BORDER_REPLICATE)
    edge = np.hypot(across, down) > EDGE
    if edge.all() or not edge.any():
        return disparity
    _, labels = cv2.distanceTransformWithLabels(
        edge.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.asarray(labels, dtype=np.int64)
    values = np.zeros(int(nearest.max()) + 1, np.float32)
    values[nearest[~edge]] = disparity[~edge]
    return np.where(edge, values[nearest], disparity).astype(np.float32)
