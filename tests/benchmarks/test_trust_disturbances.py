"""What a camera does to a picture, in `peaking bench trust`."""

from __future__ import annotations

import numpy as np
import pytest

from peaking.benchmarks.trust.disturbances import (
    ALL,
    DISTURBANCES,
    NONE,
    POSE_DEG,
    POSE_M,
    Disturbance,
    Turn,
    disturbance,
    encoded,
    linear,
    moved,
    photographed,
    rolled,
)
from peaking.benchmarks.trust.stage import angle_rad, distance_m
from peaking.geometry import Camera
from recordings import Room, lateral_cameras

SMOOTH_WALL = Room(box_m=None)

MAX_ROLLED_LEVELS = 3.0
"""Between rows rendered in turn and rows moved: 1.1 levels of 255 measured (Linux, x86-64)."""


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def grey(level: int, size: tuple[int, int] = (24, 32)) -> np.ndarray:
    return np.full((*size, 3), level, np.uint8)


def camera(width_px: int = 96, height_px: int = 128) -> Camera:
    return lateral_cameras(3, width_px, height_px)[1]


def test_nothing_happens_to_the_bytes() -> None:
    picture = rng().integers(0, 256, (16, 16, 3), dtype=np.uint8)
    np.testing.assert_array_equal(photographed(picture, NONE, rng()), picture)


def test_one_stop_is_twice_the_light_and_clips() -> None:
    up = DISTURBANCES["exposure_up"]
    dark, light = photographed(grey(100), up, rng()), photographed(grey(220), up, rng())
    expected = 255 * encoded(2 * linear(np.array([100 / 255])))
    assert (dark == np.round(expected)).all()
    assert (light == 255).all()


def test_linear_and_encoded_undo_each_other() -> None:
    values = np.linspace(0, 1, 101)
    np.testing.assert_allclose(encoded(linear(values)), values, atol=1e-4)


def test_a_vignette_takes_nothing_in_the_middle_and_most_in_the_corners() -> None:
    seen = photographed(grey(200, (101, 101)), DISTURBANCES["vignette"], rng())
    light = linear(seen / 255.0)[..., 0] / linear(np.array([200 / 255]))
    assert light[50, 50] == pytest.approx(1.0, abs=0.01)
    assert light[0, 0] == pytest.approx(0.55, abs=0.02)


def test_blur_keeps_the_light_and_spreads_a_line() -> None:
    picture = grey(0, (41, 41))
    picture[:, 20] = 255
    for seed in range(6):
        seen = linear(photographed(picture, Disturbance(blur_px=4), rng(seed)) / 255.0)[20, :, 0]
        assert seen.sum() == pytest.approx(1.0, abs=0.02)
        assert np.count_nonzero(seen > 1e-3) <= 6


def test_noise_is_a_few_levels() -> None:
    seen = photographed(grey(120, (200, 200)), DISTURBANCES["noise"], rng()).astype(float)
    assert 1.5 < seen.std() < 5
    assert seen.mean() == pytest.approx(120, abs=1)


def test_a_pose_is_off_by_at_most_a_centimetre_and_half_a_degree() -> None:
    for seed in range(20):
        told = moved(camera(), rng(seed))
        assert 0.5 * POSE_M - 1e-9 <= distance_m(told, camera()) <= POSE_M + 1e-9
        assert angle_rad(told, camera()) <= np.deg2rad(POSE_DEG) + 1e-9


def test_rows_that_are_moved_are_rows_that_are_rendered_in_turn() -> None:
    here = camera()
    for seed in range(4):
        turn = Turn.drawn(rng(seed))
        still, _ = SMOOTH_WALL.photographed(here)
        strips = [SMOOTH_WALL.photographed(strip)[0] for strip in turn.strips(here)]
        in_turn = np.concatenate(strips).astype(float)
        by_rows = rolled(still, turn.sources_px(here.pinhole), smooth=True).astype(float)
        assert np.abs(in_turn - by_rows)[4:-4, 4:-4].max() <= MAX_ROLLED_LEVELS
        assert np.abs(in_turn - still)[4:-4, 4:-4].max() > MAX_ROLLED_LEVELS


def test_the_middle_row_is_at_the_reported_pose() -> None:
    here = camera()
    turn = Turn.drawn(rng())
    assert angle_rad(turn.at(here, 0.5), here) == pytest.approx(0.0, abs=1e-7)
    first_to_last = angle_rad(turn.at(here, 0.0), turn.at(here, 1.0))
    assert first_to_last == pytest.approx(np.deg2rad(0.6), rel=1e-6)


def test_all_together_stays_within_a_stop() -> None:
    for seed in range(20):
        what = disturbance(ALL, rng(seed))
        assert what.moved
        assert what.rolling
        assert 0.5 <= what.gains[1] <= 2.0


def test_the_same_seed_gives_the_same_picture() -> None:
    picture = rng().integers(0, 256, (32, 32, 3), dtype=np.uint8)
    what = disturbance(ALL, rng(3))
    np.testing.assert_array_equal(
        photographed(picture, what, rng(4)), photographed(picture, what, rng(4))
    )
