"""Metric scale alignment: by what factor the planes of an MPI must move (paper, equation 2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32

from peaking.errors import NothingToAlign
from peaking.mpi import Mpi
from peaking.options import ScaleMethod
from peaking.rendering import Backend, source_disparity

MIN_ALPHA = 0.5
"""Opacity that a pixel needs for its rendered disparity to count."""


@dataclass(frozen=True)
class ScaleAlignment:
    """A scale and how well the pixels agree on it.

    Attributes:
        scale: Factor for the plane depths, s of the paper.
        spread: Standard deviation of ln(scale) over the pixels (`paper`), or 1.4826 times the
            median absolute deviation (`robust`); 0.01 means that pixels agree to about 1 %.
        num_pixels: Pixels that had both depths.
    """

    scale: float
    spread: float
    num_pixels: int


def fit_scale(
    disparity: Float[np.ndarray, "h w"],
    metric_depth_m: Float[np.ndarray, "h w"],
    *,
    method: ScaleMethod = "robust",
) -> ScaleAlignment:
    """Return the scale that turns rendered disparities into metric ones.

    `paper`: s = exp(mean(ln D̂ - ln d⁻¹)), the geometric mean of D̂·d, where D̂ is the rendered
    *disparity* and d the metric depth. `robust` takes the median instead of the mean, so that up
    to half of the pixels may be wrong (depth on glass, flying pixels, holes filled in).

    Args:
        disparity: Rendered disparity; pixels that are not > 0 do not count.
        metric_depth_m: Metric depth at the same pixels; pixels that are not > 0 do not count.
        method: The mean of the paper, or the median.

    Raises:
        NothingToAlign: No pixel has both.
    """
    both = (disparity > 0) & (metric_depth_m > 0)
    both &= np.isfinite(disparity) & np.isfinite(metric_depth_m)
    count = int(both.sum())
    if count == 0:
        raise NothingToAlign(
            "no pixel has both a metric depth and something rendered; "
            "check the depth map, or capture where the phone knows the depth"
        )
    logs = np.log(disparity[both].astype(np.float64) * metric_depth_m[both])
    if method == "paper":
        middle, spread = float(logs.mean()), float(logs.std())
    else:
        middle = float(np.median(logs))
        spread = 1.4826 * float(np.median(np.abs(logs - middle)))
    return ScaleAlignment(float(np.exp(middle)), spread, count)


def align_scale(
    mpi: Mpi,
    metric_depth_m: Float32[np.ndarray, "dh dw"],
    *,
    method: ScaleMethod = "robust",
    backend: Backend = "numba",
) -> ScaleAlignment:
    """Compare an MPI, seen from where it was photographed, with metric depth of any size.

    The MPI is looked at with the pixels of the depth map, or with its own if these are fewer.

    Raises:
        NothingToAlign: No pixel has both.
    """
    height, width = metric_depth_m.shape
    mpi_width, mpi_height = mpi.camera.pinhole.size_px
    if width > mpi_width or height > mpi_height:
        width, height = mpi_width, mpi_height
        metric_depth_m = cv2.resize(
            metric_depth_m, (width, height), interpolation=cv2.INTER_NEAREST
        ).astype(np.float32)
    disparity, alpha = source_disparity(mpi, (width, height), backend=backend)
    disparity = np.where(alpha >= MIN_ALPHA, disparity, np.float32(0.0))
    return fit_scale(disparity, metric_depth_m, method=method)
