"""The loss, the points to start from, and short trainings."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from peaking.frame import Frame
from peaking.geometry import Pinhole
from peaking.metrics.psnr_ssim import psnr
from peaking.splat.columns import MEANS
from peaking.splat.gaussians import Gaussians
from peaking.splat.initialisation import initial_points
from peaking.splat.loss import loss_and_gradient, ssim_and_gradient
from peaking.splat.options import SplatOptions
from peaking.splat.rasterise import render
from peaking.splat.training import Trainer, TrainingStep, train
from recordings import Room, lateral_cameras

SHORT = SplatOptions(iterations=120, max_init_points=1500, refine_every=30, max_gaussians=4000)


def frames(count: int = 7, *, with_depth: bool = True) -> list[Frame]:
    room = Room()
    made: list[Frame] = []
    for i, camera in enumerate(lateral_cameras(count, 64, 48)):
        rgb, depth_m = room.photographed(camera)
        made.append(Frame(f"{i}", rgb, camera, depth_m if with_depth else None))
    return made


def quality(gaussians: Gaussians, frame: Frame) -> float:
    rgb = np.clip(render(gaussians, frame.camera).rgb, 0, 1).astype(np.float64)
    return psnr(rgb, frame.rgb / 255.0)


def test_equal_pictures_have_no_loss() -> None:
    photo = np.random.default_rng(0).uniform(size=(20, 24, 3))
    loss, _ = loss_and_gradient(photo, photo)
    assert loss == pytest.approx(0.0, abs=1e-12)


def test_ssim_gradient_against_finite_differences() -> None:
    rng = np.random.default_rng(1)
    rgb, photo = rng.uniform(size=(2, 17, 19, 3))
    _, gradient = ssim_and_gradient(rgb, photo)
    step = 1e-6
    for y, x, c in [(0, 0, 0), (8, 9, 1), (16, 3, 2), (5, 18, 0)]:
        up, down = rgb.copy(), rgb.copy()
        up[y, x, c] += step
        down[y, x, c] -= step
        numeric = (ssim_and_gradient(up, photo)[0] - ssim_and_gradient(down, photo)[0]) / (2 * step)
        assert gradient[y, x, c] == pytest.approx(numeric, rel=1e-5, abs=1e-10)


@pytest.mark.parametrize("with_depth", (True, False))
def test_initial_points_lie_on_surfaces(with_depth: bool) -> None:
    """The wall is at z = 2, the box's front at z = 1; without depth some are wrong."""
    points = initial_points(frames(with_depth=with_depth), 800, np.random.default_rng(0))
    assert 300 <= len(points) <= 800
    z_m = points.xyz_m[:, 2]
    off_m = np.minimum(np.abs(z_m - 2.0), np.abs(z_m - 1.0))
    assert np.quantile(off_m, 0.9 if with_depth else 0.5) < (0.02 if with_depth else 0.25)


def test_one_view_without_depth_still_has_points() -> None:
    points = initial_points(frames(1, with_depth=False), 300, np.random.default_rng(0))
    assert 0 < len(points) <= 300
    assert np.isfinite(points.xyz_m).all()


def test_a_short_training_learns_and_repeats_with_any_number_of_threads() -> None:
    all_frames = frames()
    held_out = all_frames.pop(3)
    steps: list[TrainingStep] = []
    first = train(all_frames, SHORT, progress=steps.append)
    assert [step.iteration for step in steps] == list(range(1, 121))
    early = np.mean([step.loss for step in steps[50:70]])
    late = np.mean([step.loss for step in steps[-20:]])
    assert late < 0.6 * early
    assert quality(first, held_out) > 25.0
    usual = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        second = train(all_frames, SHORT)
    finally:
        numba.set_num_threads(usual)
    np.testing.assert_array_equal(first.parameters(), second.parameters())


def test_training_without_depth_and_with_views_of_different_sizes() -> None:
    mixed = frames(with_depth=False)
    mixed[0] = mixed[0].resized(50, 38)
    k = mixed[1].camera.pinhole
    camera = replace(mixed[1].camera, pinhole=Pinhole(40, 48, k.fx_px, k.fy_px, k.cx_px, k.cy_px))
    mixed[1] = replace(mixed[1], rgb=np.ascontiguousarray(mixed[1].rgb[:, :40]), camera=camera)
    before = Trainer(mixed, SHORT).gaussians()
    after = train(mixed, SHORT)
    assert quality(after, mixed[2]) > quality(before, mixed[2]) + 5.0
    assert len(after) <= SHORT.max_gaussians


def test_a_broken_gaussian_is_left_out() -> None:
    trainer = Trainer(frames(3), SHORT)
    trainer._optimiser.state().parameters[0, MEANS] = np.nan
    assert len(trainer.gaussians()) == trainer.step().num_gaussians - 1


def test_wrong_options_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one frame"):
        train([], SHORT)
    with pytest.raises(ValueError, match="sh_degree"):
        SplatOptions(sh_degree=2)
