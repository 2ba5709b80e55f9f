from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float32, UInt8

from peaking.benchmarks.baselines import mesh, splat
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World

Baseline = Callable[..., tuple[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]]

EXACT = 1e-6
"""Worst measured: 8.2e-8 (colours are float32)."""

SMOOTH: dict[Baseline, float] = {splat: 0.05, mesh: 0.01}
"""A wave of 20 px seen from any pose; 0.09 is one pixel. Worst of 300 poses: splat 0.037 (its
points lie unevenly in turned views), mesh 0.007."""

PINHOLE = Pinhole(50, 40, 60.0, 60.0, 25.0, 20.0)
HERE = Camera(PINHOLE, Rigid.identity())

both = pytest.mark.parametrize("draw", [splat, mesh])


def moved(x_m: float, y_m: float = 0.0, z_m: float = 0.0) -> Camera:
    return Camera(PINHOLE, Rigid(np.eye(3), np.array([x_m, y_m, z_m])))


def noise() -> UInt8[np.ndarray, "40 50 3"]:
    return np.random.default_rng(0).integers(0, 256, (40, 50, 3), dtype=np.uint8)


def flat(depth_m: float) -> Float32[np.ndarray, "40 50"]:
    return np.full((40, 50), depth_m, dtype=np.float32)


@both
def test_from_the_same_place_the_picture_is_unchanged(draw: Baseline) -> None:
    rgb, alpha = draw(noise(), flat(2.0), HERE, HERE)
    np.testing.assert_allclose(rgb, noise() / 255, atol=EXACT)
    assert (alpha == 1).all()


@both
def test_a_wall_that_moves_by_three_pixels_is_the_picture_shifted(draw: Baseline) -> None:
    # 60 px · 0.1 m / 2 m = 3 px to the left.
    rgb, alpha = draw(noise(), flat(2.0), HERE, moved(0.1))
    np.testing.assert_allclose(rgb[:, :47], noise()[:, 3:] / 255, atol=EXACT)
    np.testing.assert_array_equal(alpha[:, :47], 1)
    np.testing.assert_array_equal(alpha[:, 47:], 0)
    np.testing.assert_array_equal(rgb[:, 47:], 0)


@both
def test_half_a_pixel_is_the_mean_of_two(draw: Baseline) -> None:
    rgb, _ = draw(noise(), flat(2.0), HERE, moved(0.5 * 2 / 60))
    expected = (noise()[:, :-1] / 255 + noise()[:, 1:] / 255) / 2
    np.testing.assert_allclose(rgb[:, 1:48], expected[:, 1:48], atol=EXACT)


@both
def test_an_edge_leaves_a_hole_as_wide_as_the_difference_of_the_parallax(draw: Baseline) -> None:
    # Left wall at 2 m (3 px), right wall at 1 m (6 px), both moving right.
    depth_m = flat(2.0)
    depth_m[:, 25:] = 1.0
    rgb, alpha = draw(noise(), depth_m, HERE, moved(-0.1))
    expected = np.ones(50)
    expected[[0, 1, 2, 28, 29, 30]] = 0
    np.testing.assert_array_equal(alpha, np.tile(expected, (40, 1)))
    np.testing.assert_allclose(rgb[:, 3:28], noise()[:, :25] / 255, atol=EXACT)
    np.testing.assert_allclose(rgb[:, 31:], noise()[:, 25:44] / 255, atol=EXACT)


@both
def test_the_near_surface_hides_the_far_one(draw: Baseline) -> None:
    depth_m = flat(2.0)
    depth_m[:, 25:] = 1.0
    rgb, alpha = draw(noise(), depth_m, HERE, moved(0.1))
    assert (alpha[:, :44] == 1).all()
    np.testing.assert_allclose(rgb[:, :19], noise()[:, 3:22] / 255, atol=EXACT)
    np.testing.assert_allclose(rgb[:, 19:44], noise()[:, 25:] / 255, atol=EXACT)


@both
def test_going_nearer_leaves_no_pinholes(draw: Baseline) -> None:
    # From 2 m to 1 m: every pixel becomes 2 × 2.
    _, alpha = draw(noise(), flat(2.0), HERE, moved(0.0, 0.0, 1.0))
    np.testing.assert_array_equal(alpha, 1)


@both
def test_unknown_depth_and_what_is_behind_the_camera_is_not_drawn(draw: Baseline) -> None:
    _, alpha = draw(noise(), flat(0.0), HERE, HERE)
    assert not alpha.any()
    _, alpha = draw(noise(), flat(2.0), HERE, moved(0.0, 0.0, 3.0))
    assert not alpha.any()


@both
@settings(max_examples=20, deadline=None)
@given(
    turn=st.tuples(*[st.floats(-0.15, 0.15)] * 3),
    shift_m=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    slant=st.floats(-0.3, 0.3),
)
def test_a_slanted_wall_is_seen_as_its_texture_from_everywhere(
    draw: Baseline,
    turn: tuple[float, float, float],
    shift_m: tuple[float, float, float],
    slant: float,
) -> None:
    target: Camera = Camera(PINHOLE, Rigid[World, Cam](_rotation(turn), np.array(shift_m)))
    source_rgb, source_depth_m = _wall(HERE, slant)
    expected, _ = _wall(target, slant)
    rgb, alpha = draw(np.round(255 * source_rgb).astype(np.uint8), source_depth_m, HERE, target)
    inside = cv2.erode((alpha == 1).astype(np.uint8), np.ones((5, 5))) > 0
    assert inside.mean() > 0.2
    np.testing.assert_allclose(rgb[inside], expected[inside], atol=SMOOTH[draw])


@both
def test_other_sizes_are_refused(draw: Baseline) -> None:
    with pytest.raises(ValueError, match="50x40"):
        draw(noise()[:-1], flat(2.0)[:-1], HERE, HERE)


def _rotation(turn: tuple[float, float, float]) -> np.ndarray:
    return cv2.Rodrigues(np.array(turn))[0]


def _wall(
    camera: Camera, slant: float
) -> tuple[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]:
    """The wall z = 2 + slant · x with waves on it, cast ray by ray."""
    start = camera.world_from_cam.translation_m
    step = camera.pinhole.rays() @ camera.world_from_cam.rotation.T
    depth_m = (2.0 + slant * start[0] - start[2]) / (step[..., 2] - slant * step[..., 0])
    points_m = start + step * depth_m[..., None]
    x, y = points_m[..., 0], points_m[..., 1]
    waves = np.stack([np.sin(9 * x), np.sin(6 * x + 6 * y), np.cos(9 * y)], axis=-1)
    return (0.5 + 0.3 * waves).astype(np.float32), depth_m.astype(np.float32)
