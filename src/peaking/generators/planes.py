"""Where to put the planes: where the scene's disparities are."""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float64

HISTOGRAM_BINS = 256
SMOOTHING_BINS = 3.0
FLOOR = 1e-3
"""Least density of planes where no pixel is, as a part of the greatest."""

MIN_SPAN = 0.02
"""Least range of disparities that the planes cover, as a part of their mean."""


def plane_disparities_per_m(
    disparity_per_m: Float[np.ndarray, "h w"], num_planes: int
) -> Float64[np.ndarray, "planes"]:
    """Place planes in proportion to the cube root of the density of the picture's disparities.

    That is the density of levels with the least squared error of a fine quantiser (Panter & Dite
    1951), and parallax error is proportional to the error in disparity. The outermost 0.1 % of
    pixels at each end share the first and the last plane.

    Args:
        disparity_per_m: 1/depth of every pixel, all > 0.
        num_planes: How many, at least 2.

    Returns:
        Disparities in 1/m, ascending (farthest plane first).

    Raises:
        ValueError: Fewer than 2 planes, or a disparity that is not a number > 0.
    """
    if num_planes < 2:
        raise ValueError(f"need num_planes >= 2, got {num_planes}")
    sample = np.sort(disparity_per_m[::2, ::2], axis=None)
    if not (np.isfinite(sample[-1]) and sample[0] > 0):
        raise ValueError("need disparities > 0 at every pixel")
    ranks = np.round(np.array([0.001, 0.999]) * (len(sample) - 1)).astype(int)
    low, high = sample[ranks].astype(np.float64)
    lacking = MIN_SPAN * (low + high) / 2 - (high - low)
    if lacking > 0:
        low, high = low - lacking / 2, high + lacking / 2
    edges = np.linspace(low, high, HISTOGRAM_BINS + 1)
    below = np.searchsorted(sample, edges)
    below[-1] = np.searchsorted(sample, high, side="right")
    counts = np.diff(below)
    reach = np.arange(-3 * SMOOTHING_BINS, 3 * SMOOTHING_BINS + 1)
    kernel = np.exp(-0.5 * (reach / SMOOTHING_BINS) ** 2)
    density = np.cbrt(np.convolve(counts, kernel / kernel.sum(), mode="same"))
    density = np.maximum(density, FLOOR * density.max())
    share = np.concatenate([[0.0], np.cumsum(density)])
    return np.interp(np.linspace(0.0, share[-1], num_planes), share, edges)
