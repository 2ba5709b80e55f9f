from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.error_map import ErrorMap, compare, exposure_gain
from peaking.overlay import ERROR_RGB, draw, mpi_over_black, peaks_on_mpi, peaks_on_video
from peaking.rendering import Backend, Rendering

AGREEMENT = 2e-6
"""float32 against float64, errors up to 3; worst measured 4.8e-7 over 800 random cases,
x86-64, November 2026."""

both = pytest.mark.parametrize("backend", ("numpy", "numba"))


def rendering(rgba: np.ndarray) -> Rendering:
    return Rendering(rgba.astype(np.float32), np.ones(rgba.shape[:2], np.float32))


def compare_as_paper(view: Rendering, live: np.ndarray, backend: Backend = "numba") -> ErrorMap:
    return compare(
        view, live, shift_px=0, compensate_exposure=False, marks="paper", backend=backend
    )


def one_pixel(r: float, g: float, b: float, alpha: float) -> Rendering:
    return rendering(np.array([[[r, g, b, alpha]]]))


@both
def test_l1_over_rgb_by_hand(backend: Backend) -> None:
    live = np.array([[[51, 102, 153]]], np.uint8)  # 0.2, 0.4, 0.6
    errors = compare_as_paper(one_pixel(0.3, 0.4, 0.9, 1.0), live, backend)
    assert errors.error[0, 0] == pytest.approx(0.1 + 0.0 + 0.3, abs=1e-6)
    assert not errors.unseen[0, 0]


@both
@pytest.mark.parametrize(("blue", "peaked"), [(0.39, False), (0.41, True)])
def test_the_papers_threshold(backend: Backend, blue: float, peaked: bool) -> None:
    live = np.zeros((1, 1, 3), np.uint8)
    errors = compare_as_paper(one_pixel(0, 0, blue, 1.0), live, backend)
    assert bool(errors.peaked[0, 0]) is peaked
    assert errors.peaked_share == float(peaked)


@both
def test_half_transparent_pixels_are_compared_in_their_own_colour(backend: Backend) -> None:
    live = np.array([[[255, 0, 0]]], np.uint8)
    errors = compare_as_paper(one_pixel(0.6, 0, 0, 0.6), live, backend)
    assert errors.error[0, 0] == pytest.approx(0.0, abs=1e-6)


@both
def test_what_was_never_seen_is_black_and_unseen(backend: Backend) -> None:
    live = np.full((1, 2, 3), 128, np.uint8)
    rgba = np.array([[[0, 0, 0, 0], [0.502, 0.502, 0.502, 1]]])
    errors = compare_as_paper(rendering(rgba), live, backend)
    np.testing.assert_array_equal(errors.peaked, [[True, False]])
    np.testing.assert_array_equal(errors.unseen, [[True, False]])
    assert errors.error[0, 0] == pytest.approx(3 * 128 / 255, abs=1e-6)
    assert (errors.peaked_share, errors.unseen_share) == (0.5, 0.5)


@both
def test_a_shift_of_one_pixel_is_forgiven_and_of_two_is_not(backend: Backend) -> None:
    rgba = np.zeros((5, 9, 4))
    rgba[..., 3] = 1
    rgba[:, 4, :3] = 1
    live = np.zeros((5, 9, 3), np.uint8)
    live[:, 3] = 255

    def tolerant() -> ErrorMap:
        return compare(
            rendering(rgba), live, shift_px=1, compensate_exposure=False, backend=backend
        )

    assert compare_as_paper(rendering(rgba), live, backend).peaked.sum() == 10
    # The white line is found one pixel aside, and black is found beside the rendered line.
    assert tolerant().peaked.sum() == 0
    live = np.roll(live, -1, axis=1)
    assert tolerant().peaked.sum() == 5


@both
def test_exposure_is_compensated(backend: Backend) -> None:
    rng = np.random.default_rng(0)
    rgb = rng.uniform(0.2, 0.6, (60, 60, 3))
    rgba = np.concatenate([rgb, np.ones((60, 60, 1))], -1)
    live = (rgb * [1.5, 1.4, 1.3] * 255).astype(np.uint8)
    plain = compare_as_paper(rendering(rgba), live, backend)
    evened = compare(rendering(rgba), live, shift_px=0, compensate_exposure=True, backend=backend)
    assert plain.peaked_share > 0.5
    assert evened.peaked_share == 0.0
    np.testing.assert_allclose(exposure_gain(rendering(rgba), live), [1.5, 1.4, 1.3], rtol=0.01)


def test_too_few_pixels_leave_the_exposure_alone() -> None:
    gain = exposure_gain(one_pixel(0.2, 0.2, 0.2, 1), np.full((1, 1, 3), 200, np.uint8))
    np.testing.assert_array_equal(gain, 1)


@given(
    seed=st.integers(0, 2**31),
    shift_px=st.sampled_from((0, 1)),
    compensate=st.booleans(),
    height=st.integers(1, 30),
    width=st.integers(1, 30),
)
def test_the_fast_path_agrees(
    seed: int, shift_px: int, compensate: bool, height: int, width: int
) -> None:
    rng = np.random.default_rng(seed)
    alpha = rng.choice([0, 0.4, 1.0], (height, width, 1))
    rgba = np.concatenate([rng.uniform(0, 1, (height, width, 3)) * alpha, alpha], -1)
    live = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    reference, fast = (
        compare(
            rendering(rgba),
            live,
            shift_px=shift_px,
            compensate_exposure=compensate,
            backend=backend,
        )
        for backend in ("numpy", "numba")
    )
    np.testing.assert_allclose(fast.error, reference.error, atol=AGREEMENT)
    np.testing.assert_array_equal(fast.unseen, reference.unseen)
    clear = (np.abs(reference.error - 0.4) > AGREEMENT) | reference.unseen
    np.testing.assert_array_equal(fast.peaked[clear], reference.peaked[clear])


@pytest.mark.parametrize("bad", [{"threshold": 0.0}, {"threshold": 3.0}, {"shift_px": 2}])
def test_impossible_comparisons_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="need"):
        compare(one_pixel(0, 0, 0, 1), np.zeros((1, 1, 3), np.uint8), **bad)  # type: ignore[arg-type]


def test_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="size"):
        compare(one_pixel(0, 0, 0, 1), np.zeros((1, 2, 3), np.uint8))


def test_the_three_pictures() -> None:
    live = np.array([[[10, 20, 30], [255, 255, 255], [40, 50, 60]]], np.uint8)
    rgba = np.array([[[10 / 255, 20 / 255, 30 / 255, 1], [0, 0, 0, 0], [0.1, 0.1, 0.1, 0.5]]])
    view = rendering(rgba)
    errors = compare_as_paper(view, live)
    np.testing.assert_array_equal(mpi_over_black(view), [[[10, 20, 30], [0, 0, 0], [26, 26, 26]]])
    on_video = peaks_on_video(errors, live, marks="paper")
    np.testing.assert_array_equal(on_video, [[[10, 20, 30], ERROR_RGB, [40, 50, 60]]])
    on_mpi = peaks_on_mpi(errors, view, live, marks="paper")
    np.testing.assert_array_equal(on_mpi, [[[10, 20, 30], ERROR_RGB, [26, 26, 26]]])
    for name, picture in {"mpi": mpi_over_black(view), "video": on_video, "peaks": on_mpi}.items():
        drawn = draw(name, rendering=view, errors=errors, live=live, marks="paper")  # type: ignore[arg-type]
        np.testing.assert_array_equal(drawn, picture)
    np.testing.assert_array_equal(live[0, 1], 255)
