from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.geometry import Cam, Pinhole, Rigid, World
from peaking.guidance import PlenopticBound, hemisphere, plane_stack, plenoptic_grid
from peaking.guidance.planes import num_layers

HERE = Rigid[World, Cam].identity()
LEFT_WALL = Rigid[World, Cam](
    np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), np.array([1.0, 2.0, 3.0])
)
"""Looks along the world's -x: a quarter turn to the left."""

RIGHT_ANGLE = PlenopticBound(
    area_side_m=1.0, z_min_m=1.0, num_planes=10, width_px=100.0, fov_rad=math.pi / 2
)
"""f = 50 px, so Δu = 10 · 1 / 50 = 0.2 m and N = 5² = 25."""


def positions_m(targets: tuple[Rigid[World, Cam], ...]) -> np.ndarray:
    return np.array([t.translation_m for t in targets])


def test_a_bound_by_hand() -> None:
    assert RIGHT_ANGLE.focal_px == pytest.approx(50)
    assert RIGHT_ANGLE.spacing_m == pytest.approx(0.2)
    assert RIGHT_ANGLE.num_views_exact == pytest.approx(25)
    assert (RIGHT_ANGLE.num_views, RIGHT_ANGLE.views_per_side) == (25, 5)
    assert RIGHT_ANGLE.pitch_m == pytest.approx(0.2)


def test_the_papers_setup() -> None:
    """294 px over 45.93°: f = 147 / tan 22.965° = 346.9 px; Δu = 32 · 0.5 / 346.9 = 46.1 mm;
    √N = 150 / 46.1 = 3.25, so N = 10.6, 11 views, of which a square grid has 4 × 4."""
    paper = PlenopticBound()
    assert paper.focal_px == pytest.approx(346.9, abs=0.05)
    assert paper.spacing_m == pytest.approx(0.0461, abs=5e-5)
    assert paper.num_views_exact == pytest.approx(10.58, abs=5e-3)
    assert (paper.num_views, paper.views_per_side) == (11, 4)
    assert paper.pitch_m == pytest.approx(0.0375)


def test_llffs_cap_by_hand() -> None:
    """128 planes on 100 px: half of the width, 50 px, caps before 64 does; on 400 px 64 does."""
    narrow = PlenopticBound(num_planes=128, width_px=100.0, cap_disparity=True)
    wide = PlenopticBound(num_planes=128, width_px=400.0, cap_disparity=True)
    assert (narrow.disparity_px, wide.disparity_px) == (50, 64)
    assert PlenopticBound(cap_disparity=True).disparity_px == 32


def test_of_a_camera_the_width_goes_with_the_focal_length_of_x() -> None:
    """f = 500 px over a width of 640: Δu = 32 · 1 / 500 = 64 mm, whatever fy and cx are."""
    bound = PlenopticBound.of_camera(Pinhole(640, 480, 500.0, 900.0, 10.0, 240.0), 1.0)
    assert bound.focal_px == pytest.approx(500)
    assert bound.spacing_m == pytest.approx(0.064)


def test_the_grid_by_hand() -> None:
    """Two views per metre: in the middles of four cells, rows from the top (y is down)."""
    bound = PlenopticBound(
        area_side_m=1.0, z_min_m=1.0, num_planes=25, width_px=100.0, fov_rad=math.pi / 2
    )
    q = 0.25
    here = positions_m(plenoptic_grid(HERE, bound).targets)
    np.testing.assert_allclose(here, [[-q, -q, 0], [q, -q, 0], [-q, q, 0], [q, q, 0]])
    turned = plenoptic_grid(LEFT_WALL, bound)
    # Its x axis is the world's z.
    np.testing.assert_allclose(positions_m(turned.targets)[1], [1, 2 - q, 3 + q])
    assert all((t.rotation == LEFT_WALL.rotation).all() for t in turned.targets)
    assert turned.near_enough.position_m == pytest.approx(0.125)


def test_planes_by_hand() -> None:
    """Δz = Δu / tan 45° = 0.2 m: five planes of 25 fill the cube; the last is 0.8 m back."""
    planes = plane_stack(HERE, RIGHT_ANGLE)
    assert num_layers(RIGHT_ANGLE) == 5
    assert len(planes.targets) == 125
    np.testing.assert_allclose(positions_m(planes.targets)[-1], [0.4, 0.4, -0.8])


def test_a_hemisphere_by_hand() -> None:
    """Steps of 90° around a point 2 m ahead: the anchor, and four views from the sides."""
    cap = hemisphere(HERE, 2.0, step_rad=math.pi / 2, extent_rad=math.pi / 2)
    np.testing.assert_allclose(
        positions_m(cap.targets), [[0, 0, 0], [2, 0, 2], [0, 2, 2], [-2, 0, 2], [0, -2, 2]],
        atol=1e-12,
    )  # fmt: skip
    right = cap.targets[1].rotation
    np.testing.assert_allclose(right[:, 2], [-1, 0, 0], atol=1e-12)  # looks to the left
    np.testing.assert_allclose(right[:, 1], [0, 1, 0], atol=1e-12)  # and does not roll


lengths_m = st.floats(0.05, 3.0)
bounds = st.builds(
    PlenopticBound,
    area_side_m=lengths_m,
    z_min_m=lengths_m,
    num_planes=st.integers(2, 64),
    width_px=st.floats(100, 2000),
    fov_rad=st.floats(0.3, 2.0),
)


@given(bounds)
def test_the_spacing_is_the_side_over_the_root_of_n(bound: PlenopticBound) -> None:
    """The paper's two formulas, word by word."""
    s, w, d = bound.area_side_m, bound.width_px, bound.num_planes
    n = (s * w / (2 * d * bound.z_min_m * math.tan(bound.fov_rad / 2))) ** 2
    assert bound.num_views_exact == pytest.approx(n)
    assert bound.spacing_m == pytest.approx(s / math.sqrt(n))


@given(bounds, st.floats(0.1, 10))
def test_only_ratios_of_lengths_count(bound: PlenopticBound, factor: float) -> None:
    larger = PlenopticBound(
        area_side_m=factor * bound.area_side_m,
        z_min_m=factor * bound.z_min_m,
        num_planes=bound.num_planes,
        width_px=bound.width_px,
        fov_rad=bound.fov_rad,
    )
    assert larger.num_views_exact == pytest.approx(bound.num_views_exact)
    assert larger.spacing_m == pytest.approx(factor * bound.spacing_m)


@given(bounds)
def test_the_grid_is_as_dense_as_the_bound_asks_and_no_row_denser(bound: PlenopticBound) -> None:
    assert bound.pitch_m <= bound.spacing_m * (1 + 1e-6)
    assert bound.views_per_side == 1 or bound.area_side_m / (
        bound.views_per_side - 1
    ) > bound.spacing_m * (1 - 1e-6)
    assert bound.views_per_side**2 >= bound.num_views


@given(bounds.filter(lambda bound: bound.views_per_side < 30))
def test_every_place_of_the_area_is_within_half_a_spacing_of_a_view(
    bound: PlenopticBound,
) -> None:
    xs = np.unique(positions_m(plenoptic_grid(HERE, bound).targets)[:, 0])
    half_m = bound.area_side_m / 2
    asked = np.linspace(-half_m, half_m, 101)
    farthest_m = np.abs(asked[:, None] - xs[None]).min(axis=1).max()
    assert farthest_m <= bound.spacing_m / 2 * (1 + 1e-6)


@given(st.floats(0.2, 1.0), st.floats(0.0, math.pi / 2), st.floats(0.2, 3.0))
def test_of_a_hemisphere_all_look_at_the_point_and_neighbours_are_a_step_apart(
    step_rad: float, extent_rad: float, radius_m: float
) -> None:
    cap = hemisphere(LEFT_WALL, radius_m, step_rad=step_rad, extent_rad=extent_rad)
    point = np.array([1.0 - radius_m, 2.0, 3.0])
    places = positions_m(cap.targets)
    forward = np.array([t.rotation[:, 2] for t in cap.targets])
    np.testing.assert_allclose(places + radius_m * forward, np.broadcast_to(point, places.shape))
    apart = np.arccos(np.clip(forward @ forward.T, -1, 1)) + 10 * np.eye(len(places))
    assert len(places) == 1 or apart.min(axis=1).max() <= step_rad * (1 + 1e-6)


@pytest.mark.parametrize(
    ("name", "value"),
    [("z_min_m", 0.0), ("area_side_m", -1.0), ("z_min_m", math.nan), ("fov_rad", 3.2),
     ("num_planes", 0), ("detail_px", math.inf)],
)  # fmt: skip
def test_what_is_no_setup_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        PlenopticBound(**{name: value})  # type: ignore[arg-type]


def test_what_is_no_hemisphere_is_refused() -> None:
    with pytest.raises(ValueError, match="radius_m"):
        hemisphere(HERE, 0.0)
    with pytest.raises(ValueError, match="step_rad"):
        hemisphere(HERE, 1.0, step_rad=0.0)
