"""Rendering Gaussians: by hand, laws, agreement with the definition, and gradients."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.splat import _numpy
from peaking.splat.columns import LOG_SCALES, MEANS, OPACITY_LOGIT, QUATS, SH0
from peaking.splat.gaussians import Gaussians
from peaking.splat.rasterise import render
from peaking.splat.rendering import CutOffs
from peaking.splat.tape import Tape
from splat.scenes_of_gaussians import HERE, PINHOLE, cloud, one

Backend = Literal["numba", "numpy"]
BACKENDS: tuple[Backend, ...] = ("numba", "numpy")
SMOOTH = CutOffs(alpha_min=1e-12, alpha_max=0.999, min_transmittance=0.0)
"""Cut-offs that no pixel reaches, so that finite differences are smooth."""
AGREES = 1e-5
"""Of gradients, relative to the largest of their kind. Measured: 1.5e-6 (exp is a polynomial)."""
COLOURS_AGREE = 2e-4
"""float32 against float64, for colours in 0…1, without the pixels on a cut-off."""


def gaussians(parameters: np.ndarray) -> Gaussians:
    return Gaussians.from_parameters(parameters.astype(np.float32))


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_gaussian_by_hand(backend: Backend) -> None:
    """σ = 100 px · 0.1 m / 2 m = 5 px, and its variance grows by 0.3 px²."""
    camera = Camera(Pinhole(41, 41, 100.0, 100.0, 20.5, 20.5), Rigid.identity())
    seen = render(gaussians(one()), camera, backend=backend)
    np.testing.assert_allclose(seen.rgb[20, 20], [0.8, 0, 0], atol=1e-5)
    assert seen.alpha[20, 20] == pytest.approx(0.8, abs=1e-5)
    assert seen.depth_m[20, 20] == pytest.approx(2.0, abs=1e-5)
    expected = 0.8 * np.exp(-0.5 * 6**2 / 25.3)
    assert seen.rgb[20, 26, 0] == pytest.approx(expected, abs=1e-5)
    assert seen.rgb[14, 20, 0] == pytest.approx(expected, abs=1e-5)
    # 0.8 exp(-d² / 50.6) falls below 1/255 at d = 16.4 px.
    assert seen.alpha[20, 36] > 0
    assert seen.alpha[20, 37] == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_nearer_one_covers_the_farther(backend: Backend) -> None:
    near, far = one(depth_m=1.0, opacity=0.5), one(depth_m=2.0, opacity=0.5)
    far[0, SH0] = far[0, SH0][[1, 0, 2]]  # green
    camera = Camera(Pinhole(41, 41, 100.0, 100.0, 20.5, 20.5), Rigid.identity())
    seen = render(gaussians(np.concatenate([far, near])), camera, backend=backend)
    np.testing.assert_allclose(seen.rgb[20, 20], [0.5, 0.25, 0], atol=1e-5)
    assert seen.depth_m[20, 20] == pytest.approx((0.5 * 1 + 0.25 * 2) / 0.75, abs=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_would_make_a_pixel_opaque_is_left_out_with_all_behind_it(backend: Backend) -> None:
    """Of 1, 0.01 is left; the second would leave 5e-5, less than 1e-4. The third is too late."""
    rows = [one(depth_m=1.0, opacity=0.99), one(depth_m=2.0, opacity=0.995)]
    rows += [one(depth_m=3.0, opacity=0.5)]
    camera = Camera(Pinhole(41, 41, 100.0, 100.0, 20.5, 20.5), Rigid.identity())
    seen = render(gaussians(np.concatenate(rows)), camera, backend=backend)
    assert seen.alpha[20, 20] == pytest.approx(0.99, abs=1e-6)
    assert seen.depth_m[20, 20] == pytest.approx(1.0, abs=1e-5)
    # Farther from the middle nothing is too much, and all three are seen.
    alphas = [o * np.exp(-0.5 * 8**2 / (100 / z**2 + 0.3)) for o, z in ((0.99, 1), (0.995, 2))]
    alphas.append(0.5 * np.exp(-0.5 * 8**2 / (100 / 9 + 0.3)))
    left = np.prod([1 - alpha for alpha in alphas])
    assert seen.alpha[20, 28] == pytest.approx(1 - left, abs=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_to_see(backend: Backend) -> None:
    behind = one(depth_m=-2.0)
    seen = render(gaussians(behind), HERE, backend=backend)
    assert not seen.rgb.any()
    assert not seen.alpha.any()
    assert not seen.depth_m.any()
    empty = render(gaussians(behind[:0]), HERE, backend=backend)
    assert not empty.alpha.any()


def test_the_order_of_gaussians_changes_nothing() -> None:
    rows = cloud(200)
    turned = rows[np.random.default_rng(1).permutation(200)]
    first, second = render(gaussians(rows), HERE), render(gaussians(turned), HERE)
    np.testing.assert_array_equal(first.rgb, second.rgb)


def test_moving_world_and_camera_together_changes_nothing() -> None:
    """Degree 0, as the harmonics of degree 1 stay with the axes of the world."""
    rows = cloud(60, sh_degree=0)
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    moved_from_world = Rigid(
        np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([0.3, -1.0, 0.2])
    )
    moved = rows.copy()
    moved[:, MEANS] = moved_from_world.apply(rows[:, MEANS])
    w, x, y, z = rows[:, QUATS].T
    cw, cy = np.cos(angle / 2), np.sin(angle / 2)
    moved[:, QUATS] = np.stack(
        [cw * w - cy * y, cw * x + cy * z, cw * y + cy * w, cw * z - cy * x], axis=1
    )
    there = Camera(PINHOLE, moved_from_world @ HERE.world_from_cam)
    first = Tape(rows, HERE, CutOffs()).rendering()
    second = Tape(moved, there, CutOffs()).rendering()
    np.testing.assert_allclose(first.rgb, second.rgb, atol=1e-9)
    np.testing.assert_allclose(first.depth_m, second.depth_m, atol=1e-9)


def test_turned_camera_agrees_with_the_definition() -> None:
    tilt = Rigid(np.array([[0.6, 0.0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]]), np.array([-2.0, 0.1, 0.7]))
    camera = Camera(Pinhole(53, 37, 40.0, 44.0, 20.0, 19.0), tilt)
    rows = cloud(150, seed=3).astype(np.float32)
    mine = render(gaussians(rows), camera)
    reference = render(gaussians(rows), camera, backend="numpy")
    away = np.abs(mine.rgb - reference.rgb)
    assert reference.alpha.max() > 0.9
    assert np.quantile(away, 0.99) < COLOURS_AGREE
    assert away.max() < 1 / 255 + COLOURS_AGREE  # one Gaussian on the other side of a cut-off


@pytest.mark.parametrize("sh_degree", (0, 1))
def test_gradients_are_those_of_the_definition(sh_degree: int) -> None:
    rows = cloud(12, sh_degree=sh_degree)
    by_rgb = np.random.default_rng(5).normal(size=(28, 36, 3))
    tape = Tape(rows, HERE, SMOOTH)
    np.testing.assert_allclose(tape.rgb, _numpy.render(rows, HERE, SMOOTH).rgb, atol=1e-6)
    grad2d, count = np.zeros(12), np.zeros(12)
    gradients = tape.gradients(by_rgb, grad2d, count)
    assert (grad2d > 0).all()
    assert (count == 1).all()

    def loss(parameters: np.ndarray) -> float:
        return float((_numpy.render(parameters, HERE, SMOOTH).rgb * by_rgb).sum())

    step = 1e-5
    for column in range(rows.shape[1]):
        numeric = np.zeros(4)
        for i in range(4):
            up, down = rows.copy(), rows.copy()
            up[i, column] += step
            down[i, column] -= step
            numeric[i] = (loss(up) - loss(down)) / (2 * step)
        scale = np.abs(numeric).max()
        np.testing.assert_allclose(gradients[:4, column], numeric, atol=AGREES * scale, rtol=0)


def test_what_was_left_out_has_no_gradient() -> None:
    """In the middle pixel, the second of three Gaussians would make it opaque."""
    rows = np.concatenate(
        [one(depth_m=1.0, opacity=0.99), one(depth_m=2.0, opacity=0.995), one(depth_m=3.0)]
    )
    camera = Camera(Pinhole(41, 41, 100.0, 100.0, 20.5, 20.5), Rigid.identity())
    by_rgb = np.zeros((41, 41, 3))
    by_rgb[20, 20, 0] = 1.0
    tape = Tape(rows, camera, CutOffs())
    gradients = tape.gradients(by_rgb, np.zeros(3), np.zeros(3))
    assert not gradients[1:].any()
    step = 1e-5
    for column in range(rows.shape[1]):
        ends: list[float] = []
        for sign in (1, -1):
            moved = rows.copy()
            moved[0, column] += sign * step
            ends.append(float((_numpy.render(moved, camera, CutOffs()).rgb * by_rgb).sum()))
        numeric = (ends[0] - ends[1]) / (2 * step)
        assert gradients[0, column] == pytest.approx(numeric, abs=AGREES)


def test_degenerate_gaussians_do_no_harm() -> None:
    rows = cloud(6).astype(np.float32)
    rows[0, QUATS] = 0
    rows[1, LOG_SCALES] = -60
    rows[2, LOG_SCALES] = 40
    rows[3, OPACITY_LOGIT] = -200
    rows[4, MEANS] = 0
    tape = Tape(rows, HERE, CutOffs())
    assert np.isfinite(tape.rgb).all()
    grad2d, count = np.zeros(6, np.float32), np.zeros(6, np.float32)
    gradients = tape.gradients(np.ones((28, 36, 3), np.float32), grad2d, count)
    assert np.isfinite(gradients).all()


def test_wrong_cut_offs_are_refused() -> None:
    with pytest.raises(ValueError, match="alpha_min"):
        CutOffs(alpha_min=0.0)
    with pytest.raises(ValueError, match="min_transmittance"):
        CutOffs(min_transmittance=-1.0)
