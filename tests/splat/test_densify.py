"""More Gaussians where the loss pulls, fewer where they are of no use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from peaking.splat.densify import densify
from peaking.splat.optimiser import Moments
from peaking.splat.options import SplatOptions
from splat.scenes_of_gaussians import cloud

OPTIONS = SplatOptions(densify_gradient=1.0, split_size=0.1, max_count=100)


def moments_of(rows: np.ndarray) -> Moments:
    """Return moments that tell the rows apart."""
    rows = rows.astype(np.float32)
    marks = np.arange(len(rows), dtype=np.float32)[:, None] + np.zeros_like(rows)
    return Moments(rows, marks, marks + 0.5)


def four() -> np.ndarray:
    """Return a small one that is pulled, a large one that is, a calm one and a transparent one."""
    rows = cloud(4)
    rows[:, 3:6] = np.log(0.05)
    rows[1, 3:6] = np.log([0.5, 0.02, 0.02])
    rows[:, 10] = [2, 2, 2, -9]
    return rows


PULLS = np.array([2, 2, 0, 9], np.float32)


def test_doubled_split_kept_and_dropped() -> None:
    rows = four().astype(np.float32)
    rng = np.random.default_rng(0)
    after = densify(moments_of(rows), PULLS, OPTIONS, extent_m=1.0, rng=rng)
    p = after.parameters
    assert len(p) == 5
    np.testing.assert_array_equal(p[:3], rows[[0, 2, 0]])
    for half in p[3:]:
        np.testing.assert_allclose(half[3:6], rows[1, 3:6] - np.log(1.6), atol=1e-6)
        np.testing.assert_array_equal(half[6:], rows[1, 6:])
    # What was kept keeps its moments, what is new has none.
    np.testing.assert_array_equal(after.first[:, 0], [0, 2, 0, 0, 0])
    np.testing.assert_array_equal(after.second[:, 0], [0.5, 2.5, 0, 0, 0])


def test_halves_lie_along_the_long_axis() -> None:
    rows = np.repeat(four()[1:2], 400, axis=0)
    rows[:, 6:10] = [np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)]  # its x axis is the world's y
    moments = moments_of(rows)
    options = replace(OPTIONS, max_count=2000)
    pulls = np.full(400, 2, np.float32)
    rng = np.random.default_rng(0)
    after = densify(moments, pulls, options, extent_m=1.0, rng=rng).parameters
    spread = (after[:, :3] - rows[0, :3]).std(axis=0)
    np.testing.assert_allclose(spread, [0.02, 0.5, 0.02], rtol=0.1)


def test_no_more_than_allowed_and_the_strongest_first() -> None:
    rows = np.repeat(four()[:1], 10, axis=0)
    rows[:, 0] = np.arange(10)
    pulls = np.linspace(2, 3, 10).astype(np.float32)
    options = replace(OPTIONS, max_count=13)
    rng = np.random.default_rng(0)
    after = densify(moments_of(rows), pulls, options, extent_m=1.0, rng=rng).parameters
    assert len(after) == 13
    assert sorted(after[10:, 0]) == [7, 8, 9]


def test_broken_ones_are_dropped() -> None:
    rows = four()
    rows[2, 7] = np.inf
    rng = np.random.default_rng(0)
    after = densify(moments_of(rows), PULLS, OPTIONS, extent_m=1.0, rng=rng).parameters
    assert np.isfinite(after).all()
    assert len(after) == 4
