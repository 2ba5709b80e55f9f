"""Duplicating, splitting and pruning Gaussians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from peaking.splat.columns import LOG_SCALES, MEAN_X, MEANS, OPACITY_LOGIT, QUAT_X, QUATS
from peaking.splat.optimiser import AdamState
from peaking.splat.options import SplatOptions
from peaking.splat.refinement import refine
from splat.scenes_of_gaussians import cloud

OPTIONS = SplatOptions(grow_grad2d=1.0, grow_scale3d=0.1, max_gaussians=100)


def state_of(rows: np.ndarray) -> AdamState:
    """Return a state whose moments tell the rows apart."""
    rows = rows.astype(np.float32)
    marks = np.arange(len(rows), dtype=np.float32)[:, None] + np.zeros_like(rows)
    return AdamState(rows, marks, marks + 0.5)


def four() -> np.ndarray:
    """Return a small and a large one that grow, one that does not, and a transparent one."""
    rows = cloud(4)
    rows[:, LOG_SCALES] = np.log(0.05)
    rows[1, LOG_SCALES] = np.log([0.5, 0.02, 0.02])
    rows[:, OPACITY_LOGIT] = [2, 2, 2, -9]
    return rows


GRAD2D = np.array([2, 2, 0, 9], np.float32)


def test_duplicated_split_kept_and_pruned() -> None:
    rows = four().astype(np.float32)
    rng = np.random.default_rng(0)
    after = refine(state_of(rows), GRAD2D, OPTIONS, scene_scale_m=1.0, rng=rng)
    p = after.parameters
    assert len(p) == 5
    np.testing.assert_array_equal(p[:3], rows[[0, 2, 0]])
    for half in p[3:]:
        np.testing.assert_allclose(half[LOG_SCALES], rows[1, LOG_SCALES] - np.log(1.6), atol=1e-6)
        np.testing.assert_array_equal(half[QUATS.start :], rows[1, QUATS.start :])
    # What was kept keeps its moments, what is new has none.
    np.testing.assert_array_equal(after.first_moment[:, 0], [0, 2, 0, 0, 0])
    np.testing.assert_array_equal(after.second_moment[:, 0], [0.5, 2.5, 0, 0, 0])


def test_halves_lie_along_the_long_axis() -> None:
    rows = np.repeat(four()[1:2], 400, axis=0)
    rows[:, QUATS] = [np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)]  # its x axis is the world's y
    options = replace(OPTIONS, max_gaussians=2000)
    grad2d = np.full(400, 2, np.float32)
    rng = np.random.default_rng(0)
    after = refine(state_of(rows), grad2d, options, scene_scale_m=1.0, rng=rng).parameters
    spread = (after[:, MEANS] - rows[0, MEANS]).std(axis=0)
    np.testing.assert_allclose(spread, [0.02, 0.5, 0.02], rtol=0.1)


def test_no_more_than_allowed_and_the_largest_gradients_first() -> None:
    rows = np.repeat(four()[:1], 10, axis=0)
    rows[:, MEAN_X] = np.arange(10)
    grad2d = np.linspace(2, 3, 10).astype(np.float32)
    options = replace(OPTIONS, max_gaussians=13)
    rng = np.random.default_rng(0)
    after = refine(state_of(rows), grad2d, options, scene_scale_m=1.0, rng=rng).parameters
    assert len(after) == 13
    assert sorted(after[10:, MEAN_X]) == [7, 8, 9]


def test_broken_ones_are_pruned() -> None:
    rows = four()
    rows[2, QUAT_X] = np.inf
    rng = np.random.default_rng(0)
    after = refine(state_of(rows), GRAD2D, OPTIONS, scene_scale_m=1.0, rng=rng).parameters
    assert np.isfinite(after).all()
    assert len(after) == 4
