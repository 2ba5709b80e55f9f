"""What the blended views leave empty is filled by the views that have probably seen it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.hole_filling import BLOCKS, choose_filling_views, mean_opacity
from peaking.light_field import LightField
from peaking.mpi import Mpi
from peaking.options import DEFAULT, PAPER
from peaking.rendering import Backend, Rendering, draw_under, render

DEPTHS_M = np.array([3.0, 2.0, 1.0])
PINHOLE = Pinhole(84, 42, 60.0, 60.0, 42.0, 21.0)


def at(x_m: float) -> Camera:
    return Camera(PINHOLE, Rigid(np.eye(3), np.array([x_m, 0.0, 0.0])))


def wall(x_m: float, grey: int) -> Mpi:
    planes = np.full((1, 42, 84, 4), grey, np.uint8)
    planes[..., 3] = 255
    return Mpi.from_dense(planes, np.array([2.0]), at(x_m))


def half_empty() -> np.ndarray:
    alpha = np.ones((42, 84), np.float32)
    alpha[:, 42:] = 0.0
    return alpha


def test_the_view_that_saw_the_empty_half_fills_it() -> None:
    cameras = [at(0.0), at(-0.8), at(0.8)]
    chosen = choose_filling_views(cameras, at(0.0), half_empty(), DEPTHS_M, blended=[0], count=1)
    assert chosen == (2,)


def test_of_two_that_saw_it_the_nearer_one_fills() -> None:
    cameras = [at(0.0), at(1.2), at(0.6)]
    chosen = choose_filling_views(cameras, at(0.0), half_empty(), DEPTHS_M, blended=[0], count=3)
    assert chosen[0] == 2


@pytest.mark.parametrize("opacity", [1.0, 0.95])
def test_what_is_full_is_not_filled(opacity: float) -> None:
    alpha = np.full((42, 84), opacity, np.float32)
    cameras = [at(0.0), at(0.8)]
    assert choose_filling_views(cameras, at(0.0), alpha, DEPTHS_M, blended=[0], count=3) == ()


def test_no_view_fills_that_sees_nothing_of_it() -> None:
    cameras = [at(0.0), at(-5.0)]
    assert (
        choose_filling_views(cameras, at(0.0), half_empty(), DEPTHS_M, blended=[0], count=3) == ()
    )


@pytest.mark.parametrize("size", [(294, 639), (639, 294), (7, 500), (1, 1), (84, 42)])
def test_blocks_are_about_square_and_hold_every_pixel_once(size: tuple[int, int]) -> None:
    width, height = size
    alpha = np.random.default_rng(3).random((height, width)).astype(np.float32)
    opacity = mean_opacity(alpha)
    assert max(opacity.shape) == min(BLOCKS, max(size))
    rows, cols = opacity.shape
    weights = np.outer(
        np.diff(np.arange(rows + 1) * height // rows), np.diff(np.arange(cols + 1) * width // cols)
    )
    assert weights.sum() == alpha.size
    assert (opacity * weights).sum() == pytest.approx(alpha.sum(), rel=1e-5)


def random_mpi(seed: int) -> Mpi:
    rng = np.random.default_rng(seed)
    planes = rng.integers(0, 256, (3, 42, 84, 4)).astype(np.uint8)
    planes[..., :3] = np.minimum(planes[..., :3], planes[..., 3:])
    planes[:, :, rng.integers(20, 60) :] = 0
    return Mpi.from_dense(planes, DEPTHS_M, at(0.05 * seed))


@pytest.mark.parametrize("seed", range(4))
def test_both_backends_draw_the_same_under_a_rendering(seed: int) -> None:
    above, below, camera = random_mpi(seed), random_mpi(seed + 9), at(0.1)
    drawn: dict[Backend, Rendering] = {
        backend: draw_under(render(above, camera), below, camera, backend=backend)
        for backend in ("numpy", "numba")
    }
    np.testing.assert_allclose(drawn["numba"].rgba, drawn["numpy"].rgba, atol=0.010)
    visible = drawn["numpy"].alpha > 0.5
    np.testing.assert_allclose(
        drawn["numba"].depth_m[visible], drawn["numpy"].depth_m[visible], atol=0.02
    )


def test_what_is_opaque_stays_to_the_bit() -> None:
    before = render(wall(0.0, 200), at(0.0))
    rgba, depth_m = before.rgba.copy(), before.depth_m.copy()
    after = draw_under(before, wall(0.1, 50), at(0.0))
    np.testing.assert_array_equal(after.rgba, rgba)
    np.testing.assert_allclose(after.depth_m, depth_m, rtol=1e-6)


def test_the_light_field_fills_what_its_blended_views_leave_empty() -> None:
    """Two views blended, at the target; a third far aside has seen what lies at the border."""
    mpis = [wall(0.0, 100), wall(0.01, 100), wall(1.0, 30)]
    options = replace(DEFAULT, neighbours=2, opacity="seen")
    target = at(0.6)
    empty = LightField(mpis, replace(options, filling_views=0))
    assert {n.index for n in empty.choose_views(at(0.0))} == {0, 1}
    pair = empty.choose_views(at(0.0))
    unfilled = empty.render(target, neighbours=pair)
    filled = LightField(mpis, options).render(target, neighbours=pair)
    assert unfilled.alpha.mean() < 0.9
    assert filled.alpha.mean() > 0.99
    seen = unfilled.alpha > 0.99
    np.testing.assert_allclose(filled.rgba[seen], unfilled.rgba[seen], atol=1e-6)


def test_the_paper_fills_nothing() -> None:
    assert PAPER.filling_views == 0
