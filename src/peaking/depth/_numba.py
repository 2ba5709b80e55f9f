# pyright: basic
"""Depth completion, fast on the CPU; what it computes is defined in `_numpy.py`."""

from __future__ import annotations

import cv2
import numpy as np

from peaking.depth import _fill_kernels as fill
from peaking.depth import _numpy as defined
from peaking.depth import _surface_kernels as surface
from peaking.depth._row_kernels import padded_size

F = np.float32

# What `_numpy.py` names is handed to the kernels: as globals they would be frozen into numba's
# cache, which does not see that another file has changed.


def reduce(disparity, rows, cols):
    out = np.empty((rows, cols), F)
    high, wide = disparity.shape
    first_row, first_col = np.arange(rows + 1) * high // rows, np.arange(cols + 1) * wide // cols
    samples = np.ascontiguousarray(disparity)
    fill.reduce(samples, F(defined.SAME_SURFACE), first_row, first_col, out)
    return out


def fill_holes(disparity, guide, colour, noise):
    known = disparity > 0
    if known.all():
        return disparity
    rows, cols = disparity.shape
    cost = np.empty((rows + 2, cols + 2), np.int32)
    source = np.empty((rows + 2, cols + 2), np.int32)
    holes = np.empty(rows * cols, np.int32)
    least = cv2.erode(np.where(known, disparity, F(1e30)), np.ones((5, 5), np.uint8))
    late = F(defined.NEAR_IS_LATE * defined.ALONG)
    holes = holes[: fill.begin(disparity, least, late, cost, source, holes)]
    lengths = np.empty((holes.size, 8), np.int32)
    steps = defined.ALONG, defined.DIAGONAL
    per_level = round(colour * steps[0] / 255.0), round(colour * steps[1] / 255.0)
    fill.measure_steps(guide, holes, steps, per_level, lengths)
    fill.spread(holes, lengths, defined.SWEEPS, cols, cost, source)
    powers = np.zeros((3, rows, padded_size(cols)), F)
    powers[0, :, :cols], powers[1, :, :cols], powers[2, :, :cols] = known, disparity, disparity**2
    moments = np.empty((10, *powers.shape[1:]), F)
    fill.moments(powers, defined.SLOPE_RADIUS, moments)
    limits = (
        F(defined.SLOPE_RIDGE),
        F(defined.SLOPE_RESIDUAL**2),
        F(noise**2),
        F(defined.FLATTEN_SAMPLES),
        F(defined.MAX_CHANGE),
    )
    out = disparity.copy()
    fill.continue_surfaces(disparity, holes, source, moments, limits, out)
    return out


def _patch_planes(disparity, sigma, margin):
    radius = defined.PATCH_RADIUS
    a = np.arange(-radius, radius + 1, dtype=np.float64)
    weights = np.exp(-a * a / (2.0 * sigma**2))
    weights /= weights.sum()
    spread = (weights * a * a).sum()
    kernels = np.stack([weights, weights * a / spread]).astype(F)
    rows, cols = disparity.shape
    powers = np.empty((2, rows + 2 * radius, padded_size(cols + 2 * radius)), F)
    surface.odd_rim(disparity, radius, powers[0])
    np.square(powers[0], out=powers[1])
    planes = np.empty((4, rows, padded_size(cols + 1) + 2 * margin), F)
    surface.patch_planes(powers, kernels, F(spread), cols, margin, planes)
    return planes


def sharpen(disparity, noise):
    out = np.empty_like(disparity)
    planes = _patch_planes(disparity, defined.PATCH_SIGMA, defined.REACH)
    limits = F(noise**2), F(defined.OWN_VALUE), F(disparity.min()), F(disparity.max())
    surface.sharpen(disparity, planes, defined.REACH, limits, out)
    return out


def choose_sides(disparity, guide, rgb, surface_range, colour_sigma, noise):
    planes = _patch_planes(disparity, defined.SURFACE_SIGMA, 0)
    surface.flatten(disparity, planes, F(defined.SURFACE_RESIDUAL**2), F(noise**2))
    limits = (
        F(surface_range),
        F(defined.RANGE_OF_NOISE * noise),
        F(defined.IN_BETWEEN),
        F(1.0 / (255.0 * colour_sigma) ** 2),
        F(disparity.min()),
        F(disparity.max()),
    )
    (rows, cols), (height, width) = disparity.shape, rgb.shape[:2]
    at_rows, at_cols = _between(rows, height), _between(cols, width)
    out = np.empty((height, width), F)
    surface.choose_sides(disparity, planes, guide, rgb, limits, at_rows, at_cols, out)
    return out


def _between(samples, pixels):
    """Return the first pixel of each gap between samples; of each pixel its gap and how far in."""
    position = (np.arange(pixels) + 0.5) * samples / pixels - 0.5
    before = np.floor(position)
    first = np.searchsorted(before, np.arange(-1, samples + 1))
    return first, (before + 1).astype(np.int32), (position - before).astype(F)
