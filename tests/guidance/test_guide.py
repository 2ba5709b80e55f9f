from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.guidance import PlenopticBound, hemisphere, plane_stack, plenoptic_grid
from peaking.guidance.guide import Tolerance, next_target, progress, within_reach

PINHOLE = Pinhole(100, 100, 50.0, 50.0, 50.0, 50.0)
HERE = Rigid[World, Cam].identity()
BOUND = PlenopticBound(
    area_side_m=0.3, z_min_m=1.0, num_planes=5, width_px=100.0, fov_rad=math.pi / 2
)
"""Δu = 0.1 m: targets at x, y in {-0.1, 0, 0.1}; the one in the middle is number 4."""
GRID = plenoptic_grid(
    HERE, BOUND, near_enough=Tolerance(position_m=0.03, direction_rad=math.radians(10))
)


def at(x_m: float, y_m: float = 0.0, *, turned_deg: float = 0.0) -> Camera:
    c, s = np.cos(np.deg2rad(turned_deg)), np.sin(np.deg2rad(turned_deg))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Camera(PINHOLE, Rigid(turn, np.array([x_m, y_m, 0.0])))


def test_a_view_near_a_target_takes_it() -> None:
    done = progress(GRID, [at(0.02), at(0.09)])
    assert done.taken_by == (None, None, None, None, 0, 1, None, None, None)
    assert (done.num_taken, done.num_targets) == (2, 9)
    assert done.open == (0, 1, 2, 3, 6, 7, 8)


def test_too_far_or_looking_elsewhere_takes_nothing() -> None:
    views = [at(0.05), at(0.0, turned_deg=11), at(0.0, -0.031)]
    assert progress(GRID, views).num_taken == 0
    assert progress(GRID, [at(0.0, turned_deg=9)]).num_taken == 1


def test_one_view_takes_one_target_and_the_nearest() -> None:
    wide = plenoptic_grid(HERE, BOUND, near_enough=Tolerance(position_m=1.0))
    assert progress(wide, [at(0.01)]).taken_by[4] == 0
    assert progress(wide, [at(0.01)]).num_taken == 1
    # A second one from there takes the next that is open: to the right.
    assert progress(wide, [at(0.01), at(0.01)]).taken_by[5] == 1


def test_the_next_is_the_nearest_that_is_open() -> None:
    taken = progress(GRID, [at(0.0)]).taken_by
    assert next_target(GRID, at(0.001), taken) == 5
    assert next_target(GRID, at(-0.001), taken) == 3
    assert next_target(GRID, at(0.0), [0] * 9) is None
    assert within_reach(GRID, at(0.0), taken) is None
    assert within_reach(GRID, at(0.12), taken) == 5


def test_views_at_all_targets_take_them_in_turn() -> None:
    for guide in (GRID, plane_stack(HERE, BOUND), hemisphere(HERE, 1.0)):
        views = [Camera(PINHOLE, target) for target in guide.targets]
        done = progress(guide, views)
        assert done.taken_by == tuple(range(len(views)))
        assert done.open == ()


places = st.tuples(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15))
walks = st.lists(places, max_size=12)


@given(walks, walks)
def test_more_views_open_nothing_again(first: list, more: list) -> None:  # type: ignore[type-arg]
    views = [at(*place) for place in first]
    before = progress(GRID, views)
    after = progress(GRID, [*views, *(at(*place) for place in more)])
    assert set(after.open) <= set(before.open)
    assert after.num_taken <= len(first) + len(more)


@given(walks)
def test_a_view_takes_at_most_one_and_only_within_the_tolerance(walk: list) -> None:  # type: ignore[type-arg]
    views = [at(*place) for place in walk]
    taken = [
        (target, views[by])
        for target, by in zip(GRID.targets, progress(GRID, views).taken_by, strict=True)
        if by is not None
    ]
    assert len({id(view) for _, view in taken}) == len(taken)
    for target, view in taken:
        assert np.linalg.norm(target.translation_m - view.position_m) <= 0.03


@pytest.mark.parametrize("name", ["position_m", "direction_rad"])
def test_a_tolerance_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Tolerance(**{"position_m": 0.1, name: 0.0})
