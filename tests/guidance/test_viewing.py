"""The extended bound: its factors by hand, and against pictures of the project's own renderer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.two_planes import blended
from peaking.guidance import PlenopticBound
from peaking.guidance.viewing import Viewing, extended_bound, limits

PAPER = PlenopticBound()

HALF_POWER = 1 / math.sqrt(2)
"""What the bound leaves of the finest detail that counts, in the worst case: cos(π/4)."""

APART_PX = 0.012
"""Error of the stripes' displacement; worst measured 0.0087 px, of the
bilinear taps, x86-64, November 2026."""

CROSSING = 0.005
"""Relative error of the spacing at which the contrast falls below `HALF_POWER`; worst measured
0.0017, which is the step of the bisection, x86-64, November 2026."""


def sizes(viewing: Viewing) -> dict[str, float]:
    return {limit.factor: limit.detail_px for limit in limits(PAPER, viewing)}


def test_the_papers_phone_by_hand() -> None:
    """A pixel of the screen is 25.4 mm / 460 = 55.2 µm; one of the MPI 1179 / 294 = 4.01 of them,
    221 µm; an arc minute at 35 cm is 350 mm · 0.000291 = 102 µm."""
    mpi, eye, display = limits(PAPER, Viewing())
    assert [limit.factor for limit in (mpi, eye, display)] == ["mpi", "eye", "display"]
    np.testing.assert_allclose(
        [limit.on_display_m * 1e6 for limit in (mpi, eye, display)], [221.4, 101.8, 55.2], rtol=1e-3
    )
    assert mpi.detail_px == pytest.approx(1.0)
    assert eye.arcmin == pytest.approx(1.0)
    assert extended_bound(PAPER, Viewing()) == PAPER


def test_the_eye_limits_from_afar() -> None:
    """At 1.522 m an arc minute is 442.8 µm, two pixels of the MPI: half the views per side."""
    far = Viewing(eye_m=0.76115 * 2)
    assert limits(PAPER, far)[0].factor == "eye"
    assert limits(PAPER, far)[0].detail_px == pytest.approx(2.0, rel=1e-3)
    assert extended_bound(PAPER, far).num_views_exact == pytest.approx(10.577 / 4, rel=2e-3)


def test_a_coarse_screen_limits() -> None:
    """A screen of 147 pixels across: two pixels of the MPI in one of it."""
    coarse = Viewing(display_ppi=57.4, display_width_px=147.0)
    assert limits(PAPER, coarse)[0].factor == "display"
    assert limits(PAPER, coarse)[0].detail_px == pytest.approx(2.0)


def test_motion_by_hand() -> None:
    """10 cm/s before 0.5 m: 69.4 px/s, on the screen 15.4 mm/s or 2.52 °/s. The eyes follow with
    0.82 · 2.52 + 0.15 = 2.21 °/s, 88 % of it, and 0.30 °/s slip. In 1/30 s that is
    69.4 · 0.88 / 30 = 2.03 px; the eye's minute grows by 2.30 / 2.15 to 1.07."""
    moving = Viewing(speed_m_per_s=0.1)
    first, *_ = limits(PAPER, moving)
    assert first.factor == "motion"
    assert first.detail_px == pytest.approx(2.03, abs=0.01)
    eye = next(limit for limit in limits(PAPER, moving) if limit.factor == "eye")
    assert eye.arcmin == pytest.approx(1.07, abs=0.005)


viewings = st.builds(
    Viewing,
    display_ppi=st.floats(50, 800),
    display_width_px=st.floats(100, 3000),
    eye_m=st.floats(0.1, 3.0),
    acuity_arcmin=st.floats(0.5, 10),
    speed_m_per_s=st.floats(0, 1),
    frames_per_s=st.floats(10, 120),
)


@given(viewings)
def test_it_never_asks_for_more_views_than_the_paper(viewing: Viewing) -> None:
    extended = extended_bound(PAPER, viewing)
    assert extended.spacing_m >= PAPER.spacing_m * (1 - 1e-9)
    assert extended.num_views <= PAPER.num_views


@given(viewings, st.floats(1.0, 5.0))
def test_farther_eyes_and_faster_cameras_see_no_more(viewing: Viewing, factor: float) -> None:
    spacing_m = extended_bound(PAPER, viewing).spacing_m
    farther = replace(viewing, eye_m=factor * viewing.eye_m)
    still = replace(viewing, speed_m_per_s=0.0)
    if viewing.speed_m_per_s == 0:
        assert extended_bound(PAPER, farther).spacing_m >= spacing_m * (1 - 1e-9)
    assert extended_bound(PAPER, still).spacing_m <= spacing_m * (1 + 1e-9)


@given(viewings)
def test_a_finer_mpi_changes_nothing_once_something_else_limits(viewing: Viewing) -> None:
    """Δu is a length in the room: where the eye or the screen limits, W drops out."""
    fine = replace(PAPER, width_px=100 * PAPER.width_px)
    finer = replace(PAPER, width_px=200 * PAPER.width_px)
    if limits(fine, viewing)[0].factor != "mpi":
        assert extended_bound(finer, viewing).spacing_m == pytest.approx(
            extended_bound(fine, viewing).spacing_m
        )


@pytest.mark.parametrize("name", ["display_ppi", "display_width_px", "eye_m", "acuity_arcmin"])
def test_what_is_no_viewing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Viewing(**{name: 0.0})
    with pytest.raises(ValueError, match="speed_m_per_s"):
        Viewing(speed_m_per_s=-1.0)


@pytest.mark.parametrize("num_planes", [8, 16, 32])
def test_at_the_papers_bound_neighbours_are_half_a_pixel_apart(num_planes: int) -> None:
    """Each is a quarter of a pixel wrong, to opposite sides; and it grows with the spacing."""
    bound = replace(PAPER, num_planes=num_planes)
    for share in (0.5, 1.0, 2.0):
        for surface in blended(bound, share * bound.spacing_m, 12.0):
            assert surface.apart_px == pytest.approx(share * 0.5, abs=APART_PX)


@pytest.mark.parametrize(
    ("viewing", "factor"),
    [
        (Viewing(eye_m=1.6), "eye"),
        (Viewing(eye_m=3.0), "eye"),
        (Viewing(display_ppi=40.0, display_width_px=100.0), "display"),
        (Viewing(speed_m_per_s=0.1), "motion"),
        (Viewing(speed_m_per_s=0.2), "motion"),
    ],
)
def test_the_finest_detail_falls_to_half_its_power_at_the_spacing_that_is_predicted(
    viewing: Viewing, factor: str
) -> None:
    """Stripes of two of the finest details that count: one light, one dark. The MPI is four times
    as fine as the paper's, so that its bilinear taps do not blur them as well."""
    fine = replace(PAPER, num_planes=8, width_px=4 * PAPER.width_px)
    assert limits(fine, viewing)[0].factor == factor
    bound = extended_bound(fine, viewing)
    for surface in (0, 1):
        crossing_m = _crossing_m(bound, 2 * bound.detail_px, surface)
        assert crossing_m == pytest.approx(bound.spacing_m, rel=CROSSING)


def _crossing_m(bound: PlenopticBound, period_px: float, surface: int) -> float:
    """Return the spacing at which the contrast falls to `HALF_POWER`, by bisection."""
    low, high = 0.5, 1.6
    for _ in range(9):
        middle = (low + high) / 2
        left = blended(bound, middle * bound.spacing_m, period_px)[surface].contrast
        low, high = (middle, high) if left > HALF_POWER else (low, middle)
    return (low + high) / 2 * bound.spacing_m
