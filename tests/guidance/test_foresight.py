"""What is foreseen of pictures that were never taken: by hand, by laws, and both backends alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.guidance import _foresight_numba, _foresight_numpy
from peaking.guidance._foresight_numpy import FAR_RAD, MOST, NOISE, PRIOR, PRIOR_WEIGHT
from peaking.guidance.foresight import GOOD, NOTHING, SmallViews
from peaking.memory import Memory
from peaking.options import DEFAULT
from peaking.rendering import Backend
from test_memory import camera, view

BACKENDS = {"numpy": _foresight_numpy, "numba": _foresight_numba}


@pytest.fixture(params=["numpy", "numba"])
def backend(request: pytest.FixtureRequest) -> Backend:
    return request.param


def pixel(*colours: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return one pixel as some views show it in grey, 1 m away; None: they show nothing."""
    rgba = np.zeros((len(colours), 1, 1, 4), np.float32)
    for k, grey in enumerate(colours):
        if grey is not None:
            rgba[k, 0, 0] = (grey, grey, grey, 1.0)
    return rgba, np.ones((len(colours), 1, 1), np.float32)


def test_a_view_alone_is_believed_as_the_prior_says(backend: Backend) -> None:
    error, seen_by, alike = BACKENDS[backend].foretell(
        *pixel(0.5, None), np.array([0.7, 0.3]), np.array([0.1, 0.2])
    )
    assert error[0, 0] == pytest.approx(PRIOR * 0.1**2)
    assert seen_by[0, 0] == 1
    assert not alike[0, 0]


def test_two_views_that_differ_tell_how_wrong_they_are(backend: Backend) -> None:
    """By hand: they are 0.1 and 0.3 off in angle, and differ by 0.2."""
    error, _, _ = BACKENDS[backend].foretell(
        *pixel(0.4, 0.6), np.array([0.75, 0.25]), np.array([0.1, 0.3])
    )
    differ = 0.2**2 - NOISE + PRIOR * PRIOR_WEIGHT
    per_squared_rad = differ / (0.1**2 + 0.3**2 + PRIOR_WEIGHT)
    assert error[0, 0] == pytest.approx(per_squared_rad * (0.75 * 0.1**2 + 0.25 * 0.3**2), rel=1e-5)


def test_views_nearby_that_differ_will_not_agree(backend: Backend) -> None:
    weights = np.array([0.5, 0.5])
    foretell = BACKENDS[backend].foretell
    assert foretell(*pixel(0.2, 0.8), weights, np.array([0.05, 0.05]))[2][0, 0]
    assert not foretell(*pixel(0.2, 0.8), weights, np.array([0.05, 0.4]))[2][0, 0]
    assert not foretell(*pixel(0.5, 0.5), weights, np.array([0.05, 0.05]))[2][0, 0]


def test_what_no_view_shows_is_not_wrong(backend: Backend) -> None:
    error, seen_by, _ = BACKENDS[backend].foretell(*pixel(None), np.ones(1), np.array([0.1]))
    assert error[0, 0] == 0
    assert seen_by[0, 0] == 0


@given(seed=st.integers(0, 10_000), views=st.integers(1, 5))
@settings(max_examples=30, deadline=None)
def test_backends_agree(seed: int, views: int) -> None:
    random = np.random.default_rng(seed)
    alpha = random.uniform(0, 1, (views, 6, 5, 1))
    rgba = np.concatenate([alpha * random.uniform(0, 1, (views, 6, 5, 3)), alpha], axis=-1)
    depth_m = random.uniform(0.5, 3, (views, 6, 5))
    weights = random.dirichlet(np.ones(views))
    distance_m = random.uniform(0, FAR_RAD, views)
    given_ = rgba.astype(np.float32), depth_m.astype(np.float32), weights, distance_m
    error, seen_by, alike = _foresight_numpy.foretell(*given_)
    error_2, seen_by_2, alike_2 = _foresight_numba.foretell(*given_)
    np.testing.assert_allclose(error_2, error, rtol=1e-4, atol=1e-7)
    np.testing.assert_array_equal(seen_by_2, seen_by)
    np.testing.assert_array_equal(alike_2, alike)
    assert error.min() >= 0
    assert error.max() <= np.float32(MOST)


@pytest.fixture(scope="module")
def views() -> SmallViews:
    mpis = [view(camera(0.0)), view(camera(0.3))]
    return SmallViews(mpis, Memory(mpis), 2.0, replace(DEFAULT, pixels=96 * 72))


def test_where_a_view_was_taken_all_is_well(views: SmallViews) -> None:
    foreseen = views.foresee(camera(0.0))
    assert foreseen.new < 0.02
    assert foreseen.wrong < 0.1
    assert foreseen.complete > 0.9


def test_farther_aside_more_is_new(views: SmallViews) -> None:
    aside = [views.foresee(camera(x_m)) for x_m in (0.3, 0.6, 0.9, 1.2)]
    new = [foreseen.new for foreseen in aside]
    assert new == sorted(new)
    assert new[-1] > 0.15
    assert [foreseen.complete for foreseen in aside] == sorted(
        (foreseen.complete for foreseen in aside), reverse=True
    )
    assert aside[-1].towards[0] > 0.3  # on the right


def test_both_backends_foresee_the_same(views: SmallViews) -> None:
    fast, slow = (views.foresee(camera(0.5), backend=b) for b in ("numba", "numpy"))
    assert fast.error == pytest.approx(slow.error, rel=0.01)
    assert fast.wrong == pytest.approx(slow.wrong, abs=0.01)


def test_what_views_nearby_looked_at_in_vain_is_lost(views: SmallViews) -> None:
    """Of what lies in no picture, more views help; of what a view nearby has not shown, none."""
    beside = views.foresee(camera(0.31))
    far = views.foresee(camera(1.0))
    assert beside.lost >= 0.5 * beside.new
    assert far.lost < 0.5 * far.new


def test_a_picture_that_shows_nothing_is_not_complete(views: SmallViews) -> None:
    behind = camera(0.0)
    turned = replace(
        behind,
        world_from_cam=replace(behind.world_from_cam, rotation=np.diag([-1.0, 1.0, -1.0])),
    )
    foreseen = views.foresee(turned)
    assert foreseen.new == 1.0
    assert foreseen.error == pytest.approx(NOTHING + GOOD)
    assert foreseen.complete == pytest.approx(0.0, abs=1e-6)
