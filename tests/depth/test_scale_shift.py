"""Scale and shift from points of known distance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float64

from peaking.depth.scale_shift import (
    MIN_POINTS,
    Evidence,
    evidence_of_depth,
    evidence_of_points,
    fit_metric,
    metric_depth_m,
    sampled,
)
from peaking.errors import NothingToAlign
from peaking.geometry import Camera, Pinhole, Rigid

RIGHT = 1e-4
"""Worst measured: 5e-6 (float32 maps)."""

HEIGHT, WIDTH = 30, 40


def ramp() -> Float64[np.ndarray, "h w"]:
    return np.tile(np.linspace(0.0, 1.0, WIDTH), (HEIGHT, 1))


def points_on(relative: Float64[np.ndarray, "h w"], count: int, seed: int) -> Evidence:
    """Return evidence that says 2·relative + 0.5."""
    points_px = np.random.default_rng(seed).uniform(1, [WIDTH - 1, HEIGHT - 1], (count, 2))
    return Evidence(points_px, 2.0 * sampled(relative, points_px) + 0.5)


def test_pixels_are_looked_up_between_centres() -> None:
    looked = sampled(np.array([[0.0, 1.0]]), np.array([[0.5, 0.5], [1.0, 0.5], [1.5, 0.5]]))
    np.testing.assert_allclose(looked, [0.0, 0.5, 1.0])


def test_a_depth_map_is_evidence_at_its_pixels_centres() -> None:
    depth_m = np.array([[0.0, 2.0], [np.nan, 4.0]], np.float32)
    evidence = evidence_of_depth(depth_m, (40, 20))
    np.testing.assert_allclose(evidence.points_px, [[30, 5], [30, 15]])
    np.testing.assert_allclose(evidence.disparity_per_m, [0.5, 0.25])


def test_points_of_the_world_are_evidence_where_the_camera_sees_them() -> None:
    camera = Camera(
        Pinhole(40, 30, 20.0, 20.0, 20.0, 15.0), Rigid(np.eye(3), np.array([1.0, 0, 0]))
    )
    points_m = np.array([[1.0, 0, 2], [2.0, 0, 2], [1.0, 0, -2], [99.0, 0, 2]])
    evidence = evidence_of_points(points_m, camera)
    np.testing.assert_allclose(evidence.points_px, [[20, 15], [30, 15]])
    np.testing.assert_allclose(evidence.disparity_per_m, [0.5, 0.5])


def test_scale_and_shift_are_found() -> None:
    fit = fit_metric(ramp(), points_on(ramp(), 50, 1))
    assert (fit.scale, fit.shift_per_m) == pytest.approx((2.0, 0.5), abs=RIGHT)
    assert fit.residual < RIGHT
    assert (fit.num_points, fit.inliers) == (50, 1.0)


@settings(max_examples=25)
@given(st.floats(0.0, 0.4), st.integers(0, 1000))
def test_up_to_two_fifths_may_be_wrong(share: float, seed: int) -> None:
    evidence = points_on(ramp(), 100, seed)
    wrong = int(share * 100)
    evidence.disparity_per_m[:wrong] = np.random.default_rng(seed).uniform(0.1, 9, wrong)
    fit = fit_metric(ramp(), evidence)
    assert (fit.scale, fit.shift_per_m) == pytest.approx((2.0, 0.5), abs=0.05)


@settings(max_examples=15)
@given(st.floats(0.1, 50), st.floats(-5, 5))
def test_the_estimator_s_own_scale_and_shift_do_not_matter(scale: float, shift: float) -> None:
    evidence = points_on(ramp(), 60, 3)
    other = scale * ramp() + shift
    depth_m = metric_depth_m(other, fit_metric(other, evidence), evidence)
    np.testing.assert_allclose(1 / depth_m, 2 * ramp() + 0.5, rtol=1e-3)


def test_of_a_wall_only_the_scale_can_be_told() -> None:
    relative = ramp()
    relative[:, :20] = 0.5
    columns = np.arange(2.0, 18.0)
    evidence = Evidence(np.stack([columns, np.full(16, 9.0)], axis=1), np.full(16, 3.0))
    fit = fit_metric(relative, evidence)
    assert (fit.scale, fit.shift_per_m) == pytest.approx((6.0, 0.0))


def test_too_few_points_decide_nothing() -> None:
    with pytest.raises(NothingToAlign, match=f"need {MIN_POINTS} points of known distance, got 3"):
        fit_metric(ramp(), points_on(ramp(), 3, 0))


def test_near_and_far_exchanged_is_a_contradiction() -> None:
    evidence = points_on(ramp(), 40, 0)
    with pytest.raises(NothingToAlign, match="contradict"):
        fit_metric(1.0 - ramp(), evidence)


def test_nothing_comes_to_lie_behind_infinity() -> None:
    evidence = points_on(ramp(), 40, 0)
    relative = ramp()
    fit = fit_metric(relative, evidence)
    relative[0, 0] = -99.0
    depth_m = metric_depth_m(relative, fit, evidence)
    assert depth_m.min() > 0
    assert depth_m.max() < 20
