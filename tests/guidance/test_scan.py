from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.guidance import DepthScan
from peaking.guidance.scan import middle_depth_m, near_depth_m


def wall(depth_m: float, *, near: int = 0, near_m: float = 0.1) -> np.ndarray:
    """A map of 20 × 20 at one depth, with `near` pixels that are nearer."""
    depth = np.full((20, 20), depth_m, np.float32)
    depth.ravel()[:near] = near_m
    return depth


def test_of_400_pixels_four_may_be_wrong() -> None:
    assert near_depth_m(wall(2.0, near=4)) == pytest.approx(2.0)
    assert near_depth_m(wall(2.0, near=5)) == pytest.approx(0.1)


def test_unknown_depths_are_not_near() -> None:
    depth = wall(2.0, near=200, near_m=0.0)
    depth[-1, -1] = np.nan
    assert near_depth_m(depth) == pytest.approx(2.0)
    assert near_depth_m(np.zeros((20, 20), np.float32)) is None
    assert near_depth_m(wall(2.0, near=390, near_m=0.0)) is None


def test_the_middle_ninth_is_what_one_looks_at() -> None:
    depth = np.full((9, 9), 5.0, np.float32)
    depth[3:6, 3:6] = [[1, 1, 0], [2, 2, 2], [3, 3, 3]]
    assert middle_depth_m(depth) == 2.0
    depth[3:6, 3:6] = 0
    assert middle_depth_m(depth) is None


def test_three_frames_make_a_depth() -> None:
    scan = DepthScan()
    seen: list[float | None] = []
    for depth_m in (2.0, 0.5, 1.0, 0.6, 3.0, 0.4):
        scan.add(wall(depth_m))
        seen.append(scan.z_min_m)
    assert seen[:2] == [None, None]
    # The third smallest of what came so far.
    np.testing.assert_allclose(np.array(seen[2:], float), [2.0, 1.0, 1.0, 0.6], rtol=1e-6)
    assert scan.frames == 6


def test_a_map_of_nothing_is_no_frame() -> None:
    scan = DepthScan(confirmations=1)
    scan.add(np.zeros((4, 4), np.float32))
    assert scan.frames == 0
    assert scan.z_min_m is None


def test_no_confirmation_is_refused() -> None:
    with pytest.raises(ValueError, match="confirmations"):
        DepthScan(confirmations=0)


depths_m = st.floats(0.25, 10.0, width=32)


def z_min_of(depths: list[float]) -> float:
    scan = DepthScan()
    for depth_m in depths:
        scan.add(wall(depth_m))
    assert scan.z_min_m is not None
    return scan.z_min_m


@given(st.lists(depths_m, min_size=3, max_size=12), st.lists(depths_m, max_size=5))
def test_looking_around_longer_only_brings_z_min_down(
    first: list[float], more: list[float]
) -> None:
    assert z_min_of(first + more) <= z_min_of(first)


@given(st.lists(depths_m, min_size=3, max_size=12), st.tuples(depths_m, depths_m))
def test_two_wrong_frames_do_not_count(right: list[float], wrong: tuple[float, float]) -> None:
    assert z_min_of([*right, *wrong]) >= np.float32(min(right)) * (1 - 1e-6)


@given(st.lists(depths_m, min_size=3, max_size=12), st.randoms())
def test_the_order_of_the_frames_does_not_matter(depths: list[float], random) -> None:  # type: ignore[no-untyped-def]
    shuffled = list(depths)
    random.shuffle(shuffled)
    assert z_min_of(shuffled) == z_min_of(depths)
