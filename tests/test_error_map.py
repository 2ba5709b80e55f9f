from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.error_map import ErrorMap, compare
from peaking.error_map.exposure import SAME, measure_exposure
from peaking.options import DEFAULT, PAPER
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
        view,
        live,
        threshold=PAPER.error_threshold,
        shift_px=0.0,
        compensate_exposure=False,
        marks="paper",
        backend=backend,
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


def edge(at_px: float) -> np.ndarray:
    """Return a picture that goes from black to white within four pixels."""
    white = np.clip((np.arange(9) + 2.5 - at_px) / 4, 0, 1)
    return np.broadcast_to(white[None, :, None], (5, 9, 3)).astype(np.float64)


def tolerant(view: np.ndarray, live: np.ndarray, backend: Backend, shift_px: float) -> ErrorMap:
    rgba = np.concatenate([view, np.ones((*view.shape[:2], 1))], -1)
    return compare(
        rendering(rgba),
        np.round(255 * live).astype(np.uint8),
        shift_px=shift_px,
        compensate_exposure=False,
        backend=backend,
    )


@both
@pytest.mark.parametrize("shift_px", [0.5, 1.0])
def test_a_small_shift_is_forgiven_and_a_larger_one_is_not(
    backend: Backend, shift_px: float
) -> None:
    assert tolerant(edge(4.0), edge(4.0 + shift_px), backend, 0.0).peaked.any()
    assert not tolerant(edge(4.0), edge(4.0 + shift_px), backend, shift_px).peaked.any()
    assert tolerant(edge(4.0), edge(4.0 + shift_px + 1.0), backend, shift_px).peaked.any()
    assert tolerant(edge(4.0 + shift_px + 1.0), edge(4.0), backend, shift_px).peaked.any()


@both
@pytest.mark.parametrize("width_px", [1, 2])
@pytest.mark.parametrize("rendered", [True, False])
def test_a_line_that_only_one_of_the_pictures_has_is_wrong(
    backend: Backend, width_px: int, rendered: bool
) -> None:
    grey = np.full((5, 9, 3), 0.5)
    line = grey.copy()
    line[:, 4 : 4 + width_px] = 0.75
    view, live = (line, grey) if rendered else (grey, line)
    wrong = tolerant(view, live, backend, 0.5).wrong
    assert wrong[:, 4 : 4 + width_px].all()


@both
def test_exposure_is_compensated(backend: Backend) -> None:
    rng = np.random.default_rng(0)
    rgb = rng.uniform(0.2, 0.6, (60, 60, 3))
    rgba = np.concatenate([rgb, np.ones((60, 60, 1))], -1)
    live = (rgb * [1.5, 1.4, 1.3] * 255).astype(np.uint8)
    plain = compare_as_paper(rendering(rgba), live, backend)
    evened = compare(rendering(rgba), live, shift_px=0.0, compensate_exposure=True, backend=backend)
    assert plain.peaked_share > 0.5
    assert evened.peaked_share == 0.0
    gain = measure_exposure(rendering(rgba), live).gain
    np.testing.assert_allclose(gain, [1.5, 1.4, 1.3], rtol=0.015)


def test_too_few_pixels_leave_the_exposure_alone() -> None:
    exposure = measure_exposure(one_pixel(0.2, 0.2, 0.2, 1), np.full((1, 1, 3), 200, np.uint8))
    assert exposure is SAME


def textured(seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.15, 0.55, (120, 90, 3))


def as_live(rgb: np.ndarray) -> np.ndarray:
    return np.round(255 * np.clip(rgb, 0, 1)).astype(np.uint8)


def opaque(rgb: np.ndarray) -> Rendering:
    return rendering(np.concatenate([rgb, np.ones((*rgb.shape[:2], 1))], -1))


def falling_off(falloff: float) -> np.ndarray:
    y, x = np.mgrid[0:120, 0:90] + 0.5
    return np.exp(falloff * ((x - 45) ** 2 + (y - 60) ** 2) / (45**2 + 60**2))[..., None]


@pytest.mark.parametrize("falloff", [-0.35, -0.1, 0.1])
@pytest.mark.parametrize("gain", [0.65, 1.0, 1.6])
def test_gain_and_vignette_are_found_together(gain: float, falloff: float) -> None:
    rgb = textured()
    found = measure_exposure(opaque(rgb), as_live(gain * falling_off(falloff) * rgb))
    np.testing.assert_allclose(found.gain, gain, rtol=0.03)
    assert found.falloff == pytest.approx(falloff, abs=0.03)
    error = compare(opaque(rgb), as_live(gain * falling_off(falloff) * rgb), shift_px=0.0)
    assert error.peaked_share == 0.0


@pytest.mark.parametrize("part", [0.2, 0.5, 0.65])
@pytest.mark.parametrize("factor", [0.55, 1.6])
def test_a_part_that_changes_is_wrong_and_the_rest_is_not(part: float, factor: float) -> None:
    rgb = textured()
    changed = np.zeros((120, 90), np.bool_)
    changed[:, : round(part * 90)] = True
    errors = compare(opaque(rgb), as_live(np.where(changed[..., None], factor * rgb, rgb)))
    assert errors.wrong[changed].mean() > 0.8
    assert errors.wrong[~changed].mean() < 0.01


def test_a_recoloured_object_is_wrong_under_another_exposure() -> None:
    rgb = textured()
    inside = np.zeros((120, 90), np.bool_)
    inside[30:90, 20:60] = True
    live = np.where(inside[..., None], rgb * [1.5, 0.7, 0.6], rgb) * [1.3, 1.2, 1.1]
    errors = compare(opaque(rgb), as_live(live))
    assert errors.wrong[inside].mean() > 0.8
    assert errors.wrong[~inside].mean() < 0.01


@both
def test_what_no_view_has_seen_is_peaked_whatever_its_colour(backend: Backend) -> None:
    rgba = np.zeros((1, 8, 4))
    rgba[0, 1:6] = (0.01, 0.01, 0.01, 1.0)
    live = np.zeros((1, 8, 3), np.uint8)
    unseen = np.zeros((1, 8), np.bool_)
    unseen[0, 4:7] = True
    errors = compare(rendering(rgba), live, unseen=unseen, backend=backend)
    # Nothing can be shown of the first, though it was seen; of the last it is the rim.
    np.testing.assert_array_equal(errors.wrong[0], np.arange(8) == 0)
    np.testing.assert_array_equal(errors.unseen[0], np.arange(8) >= 4)
    np.testing.assert_array_equal(errors.peaked, errors.wrong | errors.unseen)


@pytest.mark.parametrize(
    ("shown", "live", "unfixable"),
    [
        ((0.89, 0.88, 0.87), (255, 252, 250), True),
        ((0.89, 0.88, 0.87), (255, 252, 249), False),  # the camera still tells
        ((0.2, 0.1, 0.0), (255, 255, 255), False),  # a dark ghost on a white wall
        ((0.7, 0.65, 0.6), (255, 255, 255), False),  # a thing that has become lighter
        ((0.95, 0.95, 0.95), (255, 255, 255), False),  # not wrong at all
    ],
)
def test_no_view_helps_where_the_camera_is_blinded(
    shown: tuple[float, float, float], live: tuple[int, int, int], unfixable: bool
) -> None:
    view, picture = one_pixel(*shown, 1.0), np.array([[live]], np.uint8)
    errors = compare(view, picture, compensate_exposure=False)
    assert bool(errors.unfixable[0, 0]) is unfixable
    assert errors.peaked_share == float(bool(errors.error[0, 0] > 0.3) and not unfixable)
    plain = compare(view, picture, compensate_exposure=False, marks="paper")
    assert plain.unfixable_share == 0.0
    assert plain.peaked_share == float(errors.error[0, 0] > 0.3)


def test_exposure_decides_what_is_bright() -> None:
    rgb = np.full((96, 96, 3), 0.3) + np.linspace(0, 0.1, 96)[:, None, None]
    view = rgb.copy()
    view[:24, :24] = (0.44, 0.435, 0.43)
    live = 2 * rgb
    live[:24, :24] = 1.0
    errors = compare(opaque(view), as_live(live))
    assert errors.unfixable[:24, :24].mean() > 0.9
    assert errors.unfixable[24:, 24:].mean() == 0.0


@given(
    seed=st.integers(0, 2**31),
    shift_px=st.sampled_from((0.0, 0.3, 0.5, 1.0)),
    compensate=st.booleans(),
    height=st.integers(1, 30),
    width=st.integers(1, 30),
)
def test_the_fast_path_agrees(
    seed: int, shift_px: float, compensate: bool, height: int, width: int
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
    clear = (np.abs(reference.error - DEFAULT.error_threshold) > AGREEMENT) | reference.unseen
    np.testing.assert_array_equal(fast.peaked[clear], reference.peaked[clear])


@pytest.mark.parametrize("bad", [{"threshold": 0.0}, {"threshold": 3.0}, {"shift_px": 2.0}])
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
