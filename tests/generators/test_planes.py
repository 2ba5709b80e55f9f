from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.generators.planes import plane_disparities_per_m


def test_an_even_spread_gives_even_planes() -> None:
    disparity = np.broadcast_to(np.linspace(0.5, 2.0, 2000), (8, 2000))
    planes = plane_disparities_per_m(disparity, 16)
    steps = np.diff(planes)
    # The ends are smoothed against nothing, so their steps are a little wider.
    np.testing.assert_allclose(steps[2:-2], steps[8], rtol=0.03)
    assert planes[0] == pytest.approx(0.5, abs=0.01)
    assert planes[-1] == pytest.approx(2.0, abs=0.01)


def test_planes_are_denser_where_the_pixels_are() -> None:
    rng = np.random.default_rng(0)
    crowd = np.concatenate([rng.uniform(0.4, 0.5, 9000), rng.uniform(0.4, 2.0, 1000)])
    planes = plane_disparities_per_m(crowd.reshape(100, 100), 32)
    # 9.6 times the density gives cbrt(9.6 · 16) ≈ 5 times the planes per 1/m.
    inside = np.count_nonzero(planes <= 0.5)
    even = 32 * 0.1 / 1.6
    assert inside > 2.5 * even
    assert (planes[1:] > planes[:-1]).all()
    assert planes[-1] > 1.9


def test_a_flat_wall_still_has_planes() -> None:
    planes = plane_disparities_per_m(np.full((20, 20), 0.5), 8)
    assert (np.diff(planes) > 0).all()
    assert planes[0] < 0.5 < planes[-1]
    assert planes[-1] - planes[0] == pytest.approx(0.02 * 0.5)


@given(st.integers(0, 2**31), st.integers(2, 64))
def test_planes_ascend_within_the_scene(seed: int, num_planes: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = 1 / rng.uniform(0.3, 5.0, (30, 20)) ** rng.uniform(0, 2)
    planes = plane_disparities_per_m(disparity, num_planes)
    assert len(planes) == num_planes
    assert (np.diff(planes) > 0).all()
    assert planes[0] > 0


@pytest.mark.parametrize(
    ("disparity", "num_planes"),
    [(np.ones((4, 4)), 1), (np.zeros((4, 4)), 8), (np.full((4, 4), np.nan), 8)],
)
def test_impossible_arguments_are_refused(disparity: np.ndarray, num_planes: int) -> None:
    with pytest.raises(ValueError, match="need"):
        plane_disparities_per_m(disparity, num_planes)
