"""Metric depth of frames without: estimated from the picture, then aligned with what is known.

    picture ──estimator──► relative ──fit──► metres        known: sensor samples, tracked points,
                                      ▲                    depth rendered from neighbours in metres,
                                  evidence ◄─────────────  pixels matched with neighbours

A frame of which nothing is known is accepted all the same, with depths in a guessed range, and
flagged; when a neighbour comes it can be asked for again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from peaking.depth.estimator import DepthEstimator
from peaking.depth.scale_shift import (
    Evidence,
    MetricFit,
    evidence_of_depth,
    evidence_of_points,
    fit_metric,
    metric_depth_m,
)
from peaking.depth.triangulation import triangulate
from peaking.errors import NothingToAlign
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.mpi import Mpi
from peaking.rendering import render
from peaking.view_weights import nearest_by_distance

GUESSED_RANGE_M = (0.8, 4.0)
"""Where a frame's depths are put while nothing is known."""

NEIGHBOURS = 4
"""Views that are asked for evidence, the nearest."""

MIN_ALPHA = 0.95
RENDERED_SHRINK = 4
"""Neighbours are rendered in a quarter of the size per axis."""

MIN_INLIERS = 0.5
"""Share of the evidence that must agree with a fit for it to be believed."""


@dataclass(frozen=True)
class CapturedView:
    """A captured view.

    Attributes:
        frame: At the working size.
        mpi: Made of it.
        metric: Its planes are in metres; else their scale is a guess.
    """

    frame: Frame
    mpi: Mpi
    metric: bool


@dataclass(frozen=True)
class EstimatedDepth:
    """Depth at every pixel.

    Attributes:
        depth_m: In metres, or in a guessed range when `fit` is None.
        fit: How it was aligned.
    """

    depth_m: Float32[np.ndarray, "h w"]
    fit: MetricFit | None


def estimate_depth(
    frame: Frame, estimator: DepthEstimator, others: Sequence[CapturedView]
) -> EstimatedDepth:
    """Estimate the depth of a frame of the working size, in metres where anything is known.

    Args:
        frame: With or without sensor depth and tracked points.
        estimator: What guesses relative depth.
        others: Captured views to align with.
    """
    relative = estimator(frame.rgb)
    evidence = evidence_for(frame, others)
    try:
        fit = fit_metric(relative, evidence)
        if fit.inliers >= MIN_INLIERS:
            return EstimatedDepth(metric_depth_m(relative, fit, evidence), fit)
    except NothingToAlign:
        pass
    return EstimatedDepth(_guessed_m(relative, estimator), None)


def evidence_for(frame: Frame, others: Sequence[CapturedView]) -> Evidence:
    """Collect all that is known about distances in a frame."""
    size_px = frame.camera.pinhole.size_px
    evidence = Evidence.none()
    if frame.depth_m is not None:
        evidence = evidence.and_also(evidence_of_depth(frame.depth_m, size_px))
    if frame.points_m is not None:
        evidence = evidence.and_also(evidence_of_points(frame.points_m, frame.camera))
    cameras = [other.mpi.camera for other in others]
    for other in (others[number] for number in views_to_ask(cameras, frame.camera)):
        evidence = evidence.and_also(triangulate(frame, other.frame))
        if other.metric:
            evidence = evidence.and_also(_rendered(other.mpi, frame))
    return evidence


def views_to_ask(cameras: Sequence[Camera], target: Camera) -> list[int]:
    """Return which views may tell the scale of a frame's estimated depth: the nearest few."""
    if not cameras:
        return []
    count = min(NEIGHBOURS, len(cameras))
    return [neighbour.index for neighbour in nearest_by_distance(cameras, target, count=count)]


def _rendered(mpi: Mpi, frame: Frame) -> Evidence:
    """Return what a neighbour in metres knows about the distances in a frame."""
    width, height = frame.camera.pinhole.size_px
    small = frame.camera.resized(
        max(width // RENDERED_SHRINK, 1), max(height // RENDERED_SHRINK, 1)
    )
    seen = render(mpi, small)
    known_m = np.where(seen.alpha >= MIN_ALPHA, seen.depth_m, np.float32(0.0))
    return evidence_of_depth(known_m.astype(np.float32), (width, height))


def _guessed_m(
    relative: Float32[np.ndarray, "h w"], estimator: DepthEstimator
) -> Float32[np.ndarray, "h w"]:
    near_m, far_m = GUESSED_RANGE_M
    if estimator.metric:
        return (1.0 / np.clip(relative, 1e-3, 1e3)).astype(np.float32)
    low, high = float(relative.min()), float(relative.max())
    share = (relative - low) / max(high - low, 1e-9)
    return (1.0 / (1 / far_m + share * (1 / near_m - 1 / far_m))).astype(np.float32)
