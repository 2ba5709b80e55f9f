from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.view_weights import nearest_by_distance, nearest_by_overlap, overlap_shares

PINHOLE = Pinhole(100, 100, 100.0, 100.0, 50.0, 50.0)


def at(x_m: float, *, turned_deg: float = 0.0) -> Camera:
    c, s = np.cos(np.deg2rad(turned_deg)), np.sin(np.deg2rad(turned_deg))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Camera(PINHOLE, Rigid(turn, np.array([x_m, 0.0, 0.0])))


def test_the_papers_weights_by_hand() -> None:
    """l = 5, 10, 20 cm: γ = 20 cm, w ∝ e^-1/4, e^-1/2, e^-1 = .44, .35, .21."""
    cameras = [at(0.30), at(0.20), at(0.05), at(-0.10)]
    near = nearest_by_distance(cameras, at(0.0), count=3)
    assert [n.index for n in near] == [2, 3, 1]
    np.testing.assert_allclose([n.distance_m for n in near], [0.05, 0.1, 0.2])
    np.testing.assert_allclose([n.weight for n in near], [0.444, 0.346, 0.210], atol=1e-3)


def test_of_equal_distances_the_first_captured_comes_first() -> None:
    near = nearest_by_distance([at(0.1), at(-0.1), at(0.1), at(-0.1)], at(0.0), count=2)
    assert [(n.index, n.weight) for n in near] == [(0, 0.5), (1, 0.5)]


def test_more_asked_for_than_there_are() -> None:
    assert [n.index for n in nearest_by_distance([at(1.0), at(0.5)], at(0.0), count=3)] == [1, 0]
    assert len(nearest_by_overlap([at(1.0)], at(0.0), 2.0, count=3)) == 1


def test_all_views_at_the_target_count_the_same() -> None:
    near = nearest_by_distance([at(0.0)] * 3, at(0.0), count=3)
    assert [n.weight for n in near] == [pytest.approx(1 / 3)] * 3


@pytest.mark.parametrize("count", (0, -1))
def test_nothing_asked_for_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match="count"):
        nearest_by_distance([at(0.0)], at(0.0), count=count)
    with pytest.raises(ValueError, match="at least one"):
        nearest_by_distance([], at(0.0))


def test_overlap_by_hand() -> None:
    """A step of 1 m before a wall at 2 m moves by half of the picture; 5×5 points are asked."""
    views = [at(0.0), at(1.0), at(0.0, turned_deg=180)]
    np.testing.assert_allclose(overlap_shares(views, at(0.0), 2.0), [1.0, 0.6, 0.0])


def test_a_near_view_that_looks_elsewhere_loses_against_one_that_looks_here() -> None:
    cameras = [at(0.05, turned_deg=90), at(0.1)]
    best = nearest_by_overlap(cameras, at(0.0), 2.0, count=1)[0]
    assert best.index == 1
    assert nearest_by_distance(cameras, at(0.0), count=1)[0].index == 0


def test_the_view_at_the_target_takes_nearly_all() -> None:
    near = nearest_by_overlap([at(0.0), at(0.1), at(0.2), at(0.3)], at(0.0), 2.0, count=3)
    assert near[0].index == 0
    assert near[0].weight > 0.95


positions = st.lists(st.floats(-1, 1), min_size=1, max_size=8)


@given(positions, st.floats(-1, 1), st.integers(1, 4))
def test_weights_sum_to_one_and_fall_with_distance(xs: list[float], x: float, count: int) -> None:
    cameras = [at(p) for p in xs]
    for near in (
        nearest_by_distance(cameras, at(x), count=count),
        nearest_by_overlap(cameras, at(x), 2.0, count=count),
    ):
        assert len(near) == min(count, len(xs))
        assert sum(n.weight for n in near) == pytest.approx(1.0)
        assert all(n.weight >= 0 for n in near)
        assert len({n.index for n in near}) == len(near)
    ordered = nearest_by_distance(cameras, at(x), count=count)
    assert all(a.weight >= b.weight - 1e-12 for a, b in pairwise(ordered))


def test_no_view_jumps_in_or_out_while_the_target_moves() -> None:
    """Each view's share changes by little over a step of 1 mm; measured 0.016; the paper's
    jump by up to 0.205."""
    cameras = [at(0.1 * k) for k in range(8)]

    def shares(x_m: float, paper: bool) -> np.ndarray:
        near = (
            nearest_by_distance(cameras, at(x_m), count=3)
            if paper
            else nearest_by_overlap(cameras, at(x_m), 5.0, count=3)
        )
        found = np.zeros(len(cameras))
        for n in near:
            found[n.index] = n.weight
        return found

    steps = np.arange(0.21, 0.49, 0.001)
    jumps = {
        paper: max(np.abs(shares(b, paper) - shares(a, paper)).max() for a, b in pairwise(steps))
        for paper in (False, True)
    }
    assert jumps[True] > 0.15
    assert jumps[False] < 0.03
