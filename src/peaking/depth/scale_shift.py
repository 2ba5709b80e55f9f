"""Metric depth from relative: scale *and* shift, in disparity, from whatever is known in metres.

Depth Anything and MiDaS guess disparity up to scale and shift (Ranftl et al., TPAMI 2022). One
factor alone leaves the shift as an error of depth, so both are fitted, robustly: what is known
comes from sensors, tracked points and matched pixels, and part of it is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32, Float64

from peaking.errors import NothingToAlign
from peaking.geometry import Camera

MIN_POINTS = 12
"""Fewer do not decide two numbers when some are wrong."""

MAX_POINTS = 4000
MIN_DEPTH_M = 1e-3
CANDIDATES = 400
MIN_SPREAD = 0.05
"""Range of relative disparities, as a part of the picture's, that known points must cover for a
shift to be told from a scale."""

TUKEY = 4.685
FARTHEST_PART, NEAREST_PART = 1 / 8, 4.0
"""Fitted disparities stay within these multiples of the least and the largest known ones."""


@dataclass(frozen=True)
class Evidence:
    """Points of a picture whose distance is known.

    Attributes:
        points_px: Where they are, corner origin.
        disparity_per_m: 1/depth, all > 0.
    """

    points_px: Float64[np.ndarray, "n 2"]
    disparity_per_m: Float64[np.ndarray, "n"]

    def __len__(self) -> int:
        """Return how many."""
        return len(self.disparity_per_m)

    @staticmethod
    def none() -> Evidence:
        """Return no points."""
        return Evidence(np.zeros((0, 2)), np.zeros(0))

    def and_also(self, other: Evidence) -> Evidence:
        """Return the points of both."""
        return Evidence(
            np.concatenate([self.points_px, other.points_px]),
            np.concatenate([self.disparity_per_m, other.disparity_per_m]),
        )


def evidence_of_depth(depth_m: Float32[np.ndarray, "dh dw"], size_px: tuple[int, int]) -> Evidence:
    """Take a depth map of the picture's field of view: a sensor's, or a rendered one.

    Args:
        depth_m: Of any size; what is not > 0 is unknown.
        size_px: Width and height of the picture.
    """
    rows, cols = np.nonzero(np.isfinite(depth_m) & (depth_m > 0))
    scale = np.array(size_px) / np.array(depth_m.shape[::-1])
    points_px = (np.stack([cols, rows], axis=1) + 0.5) * scale
    return Evidence(points_px, 1.0 / depth_m[rows, cols].astype(np.float64))


def evidence_of_points(points_m: Float64[np.ndarray, "n 3"], camera: Camera) -> Evidence:
    """Take points of the world, such as a phone tracks, as far as the camera sees them."""
    points_px, depth_m = camera.project(points_m)
    inside = ((points_px >= 0) & (points_px < camera.pinhole.size_px)).all(axis=1)
    inside &= depth_m > MIN_DEPTH_M
    return Evidence(points_px[inside], 1.0 / depth_m[inside])


@dataclass(frozen=True)
class MetricFit:
    """`scale · relative + shift_per_m` is disparity in 1/m.

    Attributes:
        scale: Factor, > 0.
        shift_per_m: What is added.
        residual: Median of |fitted - known| / known over all points.
        num_points: Points it was fitted to.
        inliers: Share of them that agree with it.
    """

    scale: float
    shift_per_m: float
    residual: float
    num_points: int
    inliers: float


def fit_metric(relative: Float[np.ndarray, "h w"], evidence: Evidence) -> MetricFit:
    """Fit scale and shift; up to half of the evidence may be wrong.

    Least median of squares over pairs of points (Rousseeuw 1984), then Tukey's biweight. Where the
    known points are all about equally far, only the scale can be told.

    Raises:
        NothingToAlign: Too few points, or they contradict the estimate.
    """
    count = len(evidence)
    if count < MIN_POINTS:
        raise NothingToAlign(
            f"need {MIN_POINTS} points of known distance, got {count}; capture where the phone "
            "knows depth, or a second view a step aside"
        )
    generator = np.random.default_rng(count)  # the same evidence gives the same fit
    if count > MAX_POINTS:
        chosen = generator.choice(count, MAX_POINTS, replace=False)
        evidence = Evidence(evidence.points_px[chosen], evidence.disparity_per_m[chosen])
    p = sampled(relative, evidence.points_px)
    d = evidence.disparity_per_m
    low, high = np.percentile(p, [2, 98])
    span = float(relative.max() - relative.min())
    if high - low < MIN_SPREAD * span or span == 0:
        scale, shift = float(np.median(d / np.maximum(p, 1e-6))), 0.0
    else:
        scale, shift = _least_median(p, d, generator)
        scale, shift = _refined(p, d, scale, shift)
    fitted = scale * p + shift
    residuals = np.abs(fitted - d)
    residual = float(np.median(residuals / d))
    if not (np.isfinite(scale) and scale > 0):
        raise NothingToAlign("the known distances contradict the estimated depth")
    sigma = max(1.4826 * float(np.median(residuals)), 1e-3 * float(np.median(d)))
    inliers = float((residuals < 3 * sigma).mean())
    return MetricFit(scale, shift, residual, count, inliers)


def metric_depth_m(
    relative: Float[np.ndarray, "h w"], fit: MetricFit, evidence: Evidence
) -> Float32[np.ndarray, "h w"]:
    """Return depth in metres, > 0 at every pixel.

    What would lie far outside of all that is known (behind infinity, most of all) is brought to its
    border.
    """
    known = evidence.disparity_per_m
    least, most = float(np.percentile(known, 1)), float(np.percentile(known, 99))
    disparity = fit.scale * relative.astype(np.float64) + fit.shift_per_m
    limited = np.clip(disparity, FARTHEST_PART * least, NEAREST_PART * most)
    return (1.0 / limited).astype(np.float32)


def sampled(
    relative: Float[np.ndarray, "h w"], points_px: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, "n"]:
    """Look a map up at points, bilinearly."""
    xy = np.ascontiguousarray(points_px - 0.5, dtype=np.float32)
    looked = cv2.remap(
        relative.astype(np.float32),
        xy[None, :, 0],
        xy[None, :, 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return looked[0].astype(np.float64)


def _least_median(
    p: Float64[np.ndarray, "n"], d: Float64[np.ndarray, "n"], generator: np.random.Generator
) -> tuple[float, float]:
    """Return scale and shift of the pair of points that most others agree with best."""
    order = np.argsort(p)
    half = len(p) // 2
    near = order[half + generator.integers(0, len(p) - half, CANDIDATES)]
    far = order[generator.integers(0, half, CANDIDATES)]
    apart = p[near] - p[far]
    usable = apart > 1e-9
    scales = (d[near] - d[far])[usable] / apart[usable]
    shifts = d[far][usable] - scales * p[far][usable]
    usable = scales > 0
    if not usable.any():
        return 0.0, 0.0
    scales, shifts = scales[usable], shifts[usable]
    sample = slice(None, None, max(len(p) // 1000, 1))
    residuals = np.abs(scales[:, None] * p[None, sample] + shifts[:, None] - d[None, sample])
    best = int(np.argmin(np.median(residuals, axis=1)))
    return float(scales[best]), float(shifts[best])


def _refined(
    p: Float64[np.ndarray, "n"], d: Float64[np.ndarray, "n"], scale: float, shift: float
) -> tuple[float, float]:
    """Improve a fit by weighted least squares; what is far off has no weight."""
    for _ in range(10):
        residuals = scale * p + shift - d
        sigma = max(1.4826 * float(np.median(np.abs(residuals))), 1e-9)
        weights = np.clip(1 - (residuals / (TUKEY * sigma)) ** 2, 0, None) ** 2
        mean_p, mean_d = np.average(p, weights=weights), np.average(d, weights=weights)
        variance = float((weights * (p - mean_p) ** 2).sum())
        if variance < 1e-12:
            break
        better = float((weights * (p - mean_p) * (d - mean_d)).sum() / variance)
        if better <= 0:
            break
        scale, shift = better, float(mean_d - better * mean_p)
    return scale, shift
