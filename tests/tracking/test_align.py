"""Where a picture was taken from: by hand, laws, the two implementations, and what fails."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drawn_room import LENS, bare, disturbed, photographed, upright_stripes
from peaking.geometry import Camera, Rigid
from peaking.rendering import Backend, Rendering
from peaking.tracking import (
    MAX_MOVE_M,
    PRIOR_MOVE_M,
    PRIOR_TURN_RAD,
    Alignment,
    align,
    apart,
    refine,
)
from peaking.tracking.solution import first_and_last_level, halved, rotation_of

BACKENDS: tuple[Backend, ...] = ("numpy", "numba")
backends = pytest.mark.parametrize("backend", BACKENDS)

FOUND_M = 3e-4
FOUND_RAD = 2e-4
"""Truth against what is found in a drawn room, with colours rounded to 8 bits. Measured over eight
disturbances, 2026-11-30: 0.13 mm and 0.00005 rad."""

FOUND_IN_NOISE_M = 1e-3
FOUND_IN_NOISE_RAD = 5e-4
"""The same where a third of the picture is noise. Measured, 2026-11-30: 0.52 mm, 0.00023 rad."""

AGREE_M = 2e-6
AGREE_RAD = 1e-6
"""float64 against float32. Measured over eight disturbances, 2026-11-30: 0.09 µm, 0.03 µrad."""

HERE = Camera(LENS, Rigid.identity())


def assert_found(alignment: Alignment, truth: Camera) -> None:
    assert alignment.failure is None
    move_m, turn_rad = apart(alignment.camera, truth)
    assert move_m < FOUND_M
    assert turn_rad < FOUND_RAD


@backends
def test_a_turn_by_hand(backend: Backend) -> None:
    """A picture in which all is one pixel further right was taken by a camera turned left.

    A step to the left would do the same for one depth; here there are two.
    """
    truth = Camera(LENS, Rigid(rotation_of(np.array([0.0, -1 / 120.0, 0.0])), np.zeros(3)))
    alignment = align(photographed(HERE)[1], HERE, photographed(truth)[0], backend=backend)
    assert_found(alignment, truth)
    assert alignment.camera.forward[0] == pytest.approx(-1 / 120, abs=FOUND_RAD)
    assert alignment.turned_rad == pytest.approx(1 / 120, abs=FOUND_RAD)
    assert alignment.agreeing > 0.9


@backends
@pytest.mark.parametrize("seed", range(4))
def test_a_centimetre_and_half_a_degree_are_found(backend: Backend, seed: int) -> None:
    truth = disturbed(seed)
    assert_found(align(photographed(HERE)[1], HERE, photographed(truth)[0], backend=backend), truth)


@backends
def test_who_stands_right_stays(backend: Backend) -> None:
    live, rendering = photographed(HERE)
    alignment = align(rendering, HERE, live, backend=backend)
    assert alignment.ok
    assert alignment.moved_m < 1e-6
    assert alignment.turned_rad < 1e-6


@backends
@pytest.mark.parametrize(("gain", "offset"), [(0.7, 0.0), (1.25, 0.0), (0.8, 0.1)])
def test_exposure_does_not_move_the_camera(backend: Backend, gain: float, offset: float) -> None:
    truth = disturbed(7)
    live = photographed(truth)[0].astype(float)
    exposed = np.clip(np.round(gain * live + 255 * offset), 0, 255).astype(np.uint8)
    assert_found(align(photographed(HERE)[1], HERE, exposed, backend=backend), truth)


@backends
def test_the_world_may_lie_anywhere(backend: Backend) -> None:
    moved_from_world = Rigid(rotation_of(np.array([0.4, -1.0, 0.3])), np.array([5.0, -2.0, 1.0]))
    truth = disturbed(3)
    live, rendering = photographed(truth)[0], photographed(HERE)[1]
    here = Camera(LENS, moved_from_world @ HERE.world_from_cam)
    there = Camera(LENS, moved_from_world @ truth.world_from_cam)
    assert_found(align(rendering, here, live, backend=backend), there)


@backends
def test_a_third_of_the_picture_may_be_wrong(backend: Backend) -> None:
    truth = disturbed(5)
    live = photographed(truth)[0].copy()
    live[:55] = np.random.default_rng(0).integers(0, 256, live[:55].shape, dtype=np.uint8)
    alignment = align(photographed(HERE)[1], HERE, live, backend=backend)
    assert alignment.ok
    move_m, turn_rad = apart(alignment.camera, truth)
    assert move_m < FOUND_IN_NOISE_M
    assert turn_rad < FOUND_IN_NOISE_RAD
    assert alignment.agreeing < 0.85


@backends
def test_holes_do_not_matter(backend: Backend) -> None:
    truth = disturbed(6)
    rendering = photographed(HERE)[1]
    rgba, depth_m = rendering.rgba.copy(), rendering.depth_m.copy()
    rgba[40:90, 30:70] = 0.0
    depth_m[40:90, 30:70] = 0.0
    alignment = align(Rendering(rgba, depth_m), HERE, photographed(truth)[0], backend=backend)
    assert_found(alignment, truth)


@pytest.mark.parametrize("seed", range(6))
def test_both_implementations_agree(seed: int) -> None:
    live, rendering = photographed(disturbed(seed))[0], photographed(HERE)[1]
    reference, fast = (align(rendering, HERE, live, backend=backend) for backend in BACKENDS)
    move_m, turn_rad = apart(reference.camera, fast.camera)
    assert move_m < AGREE_M
    assert turn_rad < AGREE_RAD
    assert abs(reference.num_pixels - fast.num_pixels) < 0.01 * reference.num_pixels
    assert fast.agreeing == pytest.approx(reference.agreeing, abs=0.01)
    np.testing.assert_allclose(fast.move_sd_m, reference.move_sd_m, rtol=1e-3)
    np.testing.assert_allclose(fast.turn_sd_rad, reference.turn_sd_rad, rtol=1e-3)


@backends
def test_what_the_picture_does_not_tell_stays_as_given(backend: Backend) -> None:
    """Upright stripes tell nothing of up and down."""
    truth = Camera(LENS, Rigid(np.eye(3), np.array([0.006, 0.006, 0.0])))
    live, rendering = (
        photographed(truth, upright_stripes)[0],
        photographed(HERE, upright_stripes)[1],
    )
    alignment = align(rendering, HERE, live, backend=backend)
    assert alignment.ok
    assert alignment.camera.position_m[0] == pytest.approx(0.006, abs=0.002)
    assert abs(alignment.camera.position_m[1]) < 1e-3
    assert alignment.move_sd_m[1] > 0.8 * PRIOR_MOVE_M
    assert alignment.move_sd_m[0] < 0.5 * PRIOR_MOVE_M
    assert (alignment.turn_sd_rad <= PRIOR_TURN_RAD * (1 + 1e-9)).all()


@backends
def test_a_bare_wall_says_nothing(backend: Backend) -> None:
    live, rendering = photographed(HERE, bare)
    alignment = align(rendering, disturbed(1), live, backend=backend)
    assert alignment.failure == "too-few-pixels"
    assert alignment.moved_m == 0
    np.testing.assert_array_equal(
        alignment.camera.world_from_cam.matrix(), disturbed(1).world_from_cam.matrix()
    )
    np.testing.assert_allclose(alignment.move_sd_m, PRIOR_MOVE_M)


@backends
def test_nothing_rendered_says_nothing(backend: Backend) -> None:
    live, rendering = photographed(HERE)
    nothing = Rendering(np.zeros_like(rendering.rgba), np.zeros_like(rendering.depth_m))
    assert align(nothing, HERE, live, backend=backend).failure == "too-few-pixels"


@backends
@pytest.mark.parametrize("seed", range(3))
def test_another_place_is_not_found(backend: Backend, seed: int) -> None:
    noise = np.random.default_rng(seed).integers(0, 256, (40, 30, 3), dtype=np.uint8)
    live = np.kron(noise, np.ones((4, 4, 1), np.uint8))
    alignment = align(photographed(HERE)[1], HERE, live, backend=backend)
    assert not alignment.ok
    assert alignment.camera is HERE


@backends
def test_far_away_is_not_believed(backend: Backend) -> None:
    far = Camera(LENS, Rigid(np.eye(3), np.array([0.0, 0.0, 3 * MAX_MOVE_M])))
    alignment = align(photographed(HERE)[1], HERE, photographed(far)[0], backend=backend)
    assert not alignment.ok


def test_what_was_found_is_no_worse_than_what_was_given() -> None:
    """Whatever is compared: a pose that is corrected leaves less error."""
    random = np.random.default_rng(2)
    for seed in range(20):
        truth = disturbed(seed, move_m=0.05 * seed / 20, turn_rad=0.05 * seed / 20)
        live, rendering = photographed(truth)[0].copy(), photographed(HERE)[1]
        rows = random.integers(1, 160)
        live[:rows] = random.integers(0, 256, live[:rows].shape, dtype=np.uint8)
        alignment = align(rendering, HERE, live)
        if alignment.ok and rows < 80:
            assert apart(alignment.camera, truth)[0] <= apart(HERE, truth)[0] + FOUND_M


@pytest.mark.parametrize("rounds", [1, 2])
def test_refine_renders_where_it_was_found(rounds: int) -> None:
    truth = disturbed(4)
    asked: list[Camera] = []

    def render(camera: Camera) -> Rendering:
        asked.append(camera)
        return photographed(camera)[1]

    alignment = refine(render, HERE, photographed(truth)[0], rounds=rounds)
    assert_found(alignment, truth)
    assert len(asked) == rounds
    assert alignment.moved_m == pytest.approx(apart(HERE, alignment.camera)[0])
    if rounds == 2:
        assert apart(asked[1], truth)[0] < FOUND_M


def test_refine_compares_large_pictures_at_half_their_size() -> None:
    large = LENS.resized(301, 401)
    truth = Camera(large, disturbed(4).world_from_cam)
    sizes: list[tuple[int, int]] = []

    def render(camera: Camera) -> Rendering:
        sizes.append(camera.pinhole.size_px)
        return photographed(camera)[1]

    alignment = refine(render, Camera(large, Rigid.identity()), photographed(truth)[0])
    assert_found(alignment, truth)
    assert alignment.camera.pinhole == large
    assert set(sizes) == {(150, 200)}
    assert halved(large, 1).cx_px == large.cx_px / 2


def test_levels_by_hand() -> None:
    assert first_and_last_level(229, 105) == (0, 2)
    assert first_and_last_level(639, 294) == (1, 3)
    assert first_and_last_level(48, 64) == (0, 1)
    assert first_and_last_level(16, 16) == (0, 0)


def test_sizes_must_fit() -> None:
    live, rendering = photographed(HERE)
    with pytest.raises(ValueError, match="need a picture and a rendering"):
        align(rendering, HERE, live[1:])
    with pytest.raises(ValueError, match="need a picture and a rendering"):
        align(rendering, HERE.resized(60, 80), live)
    with pytest.raises(ValueError, match="need a picture of the camera's size"):
        refine(lambda _: rendering, HERE, live[1:])
    with pytest.raises(ValueError, match="need rounds >= 1"):
        refine(lambda _: rendering, HERE, live, rounds=0)


def test_a_rotation_turns_by_its_length() -> None:
    quarter = rotation_of(np.array([0.0, 0.0, math.pi / 2]))
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(rotation_of(np.zeros(3)), np.eye(3))
