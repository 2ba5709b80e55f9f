from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.depth import Backend, Completion, complete
from peaking.depth import _numpy as defined

AGREEMENT = 1e-4
"""Relative difference of depths between the backends, where they chose the same side; worst
measured 3.4e-5 over 150 random scenes, November 2026."""

OTHER_SIDE = 0.03
"""Share of pixels where float32 and float64 may settle a vote differently; worst measured 0.011
over the same scenes, 0.002 on the sample scene."""

both = pytest.mark.parametrize("backend", ("numpy", "numba"))


def two_surfaces(
    width: int, height: int, edge_px: int, *, shrink: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return picture, exact depth and sensor depth: dark at 1 m left of the edge, light at 3 m."""
    rgb = np.full((height, width, 3), 40, np.uint8)
    rgb[:, edge_px:] = 200
    depth_m = np.full((height, width), 1.0, np.float32)
    depth_m[:, edge_px:] = 3.0
    cells = (1.0 / depth_m).reshape(height // shrink, shrink, width // shrink, shrink)
    sensor_m = (1.0 / cells.mean(axis=(1, 3))).astype(np.float32)
    return rgb, depth_m, sensor_m


@both
def test_edges_are_where_the_picture_has_them(backend: Backend) -> None:
    """The edge lies in the middle of a sample of 4 pixels, which is a mixture of both depths."""
    rgb, depth_m, sensor_m = two_surfaces(80, 40, 42, shrink=4)
    assert 1.1 < sensor_m[0, 10] < 2.9
    done = complete(sensor_m, rgb, backend=backend)
    np.testing.assert_allclose(done, depth_m, rtol=0.02)


@both
@pytest.mark.parametrize("bad", (0.0, np.nan, np.inf, -1.0, 1e-9))
def test_holes_on_both_sides_of_an_edge(backend: Backend, bad: float) -> None:
    rgb, depth_m, sensor_m = two_surfaces(80, 40, 40, shrink=4)
    sensor_m[3:7, 4:13] = bad
    done = complete(sensor_m, rgb, backend=backend)
    np.testing.assert_allclose(done, depth_m, rtol=0.02)


def test_a_shadow_of_the_sensor_is_background() -> None:
    """Where the picture does not say, what is hidden beside an object is behind it."""
    disparity = np.full((20, 40), 1 / 3, np.float32)
    disparity[:, :15] = 1.0
    disparity[5:15, 15:17] = 0.0
    filled = defined.fill_holes(disparity, np.zeros((20, 40, 3), np.uint8), 20.0, 0.003)
    np.testing.assert_allclose(filled[5:15, 16], 1 / 3, rtol=1e-6)


@both
def test_noise_is_smoothed_on_a_surface(backend: Backend) -> None:
    rng = np.random.default_rng(0)
    sensor_m = (2.0 * (1 + 0.01 * rng.normal(size=(60, 80)))).astype(np.float32)
    done = complete(sensor_m, np.full((240, 320, 3), 90, np.uint8), backend=backend)
    assert done.std() < 0.5 * sensor_m.std()
    assert abs(done.mean() - 2.0) < 0.01


@both
@settings(max_examples=10, deadline=None)
@given(
    slope_x=st.floats(-0.1, 0.1),
    slope_y=st.floats(-0.1, 0.1),
    shrink=st.sampled_from((1, 2, 4)),
)
def test_planes_stay_planes_up_to_the_rim(
    backend: Backend, slope_x: float, slope_y: float, shrink: int
) -> None:
    """Disparity 1 in the middle of 96×72 pixels, changing by the slopes over the picture."""
    disparity = plane(96, 72, slope_x, slope_y)
    rows, cols = 72 // shrink, 96 // shrink
    sensor_m = (1.0 / plane(cols, rows, slope_x, slope_y)).astype(np.float32)
    done = complete(sensor_m, np.full((72, 96, 3), 90, np.uint8), backend=backend)
    # At the rim the median of 3×3 pixels and the range of the samples cut a little off.
    np.testing.assert_allclose(1.0 / done, disparity, rtol=0.006)
    np.testing.assert_allclose((1.0 / done)[6:-6, 6:-6], disparity[6:-6, 6:-6], rtol=5e-5)


def plane(width: int, height: int, slope_x: float, slope_y: float) -> np.ndarray:
    x = (np.arange(width) + 0.5) / width - 0.5
    y = (np.arange(height) + 0.5) / height - 0.5
    return 1.0 + slope_x * x[None, :] + slope_y * y[:, None]


def test_surfaces_are_continued_into_holes() -> None:
    """A table that goes on below the part that the sensor sees."""
    disparity = np.repeat(np.linspace(0.6, 1.2, 60, dtype=np.float32)[:, None], 40, axis=1)
    seen = disparity.copy()
    seen[52:] = 0.0
    done = defined.fill_holes(seen, np.zeros((60, 40, 3), np.uint8), 20.0, 0.003)
    flat = seen[51, 0]
    left_over = np.abs(done[52:] - disparity[52:]).mean()
    assert left_over < 0.5 * np.abs(flat - disparity[52:]).mean()


def test_the_nearest_known_sample_by_hand() -> None:
    """One row: the step into the light region is long, so the hole in it takes the far sample."""
    disparity = np.array([[0.5, 0.0, 0.0, 0.0, 0.5]], np.float32)
    guide = np.zeros((1, 5, 3), np.uint8)
    guide[:, 1:] = 200
    source = defined.nearest_known(disparity, guide, 20.0)
    np.testing.assert_array_equal(source, [[0, 4, 4, 4, 4]])
    source = defined.nearest_known(disparity, np.zeros_like(guide), 20.0)
    assert source[0].tolist()[:2] == [0, 0]


def test_near_samples_start_late_by_hand() -> None:
    """Twice the disparity of the neighbourhood: later by `NEAR_IS_LATE` steps."""
    costs = defined.first_costs(np.array([[1.0, 0.5, 0.0]], np.float32))
    late = int(defined.NEAR_IS_LATE * defined.ALONG)
    np.testing.assert_array_equal(costs, [[late, 0, 2**30]])


def test_reducing_does_not_mix_surfaces() -> None:
    """The sample that is nearest to the middle and known decides; those like it are averaged."""
    fine = np.array([[1.0, 1.01, 0.3, 0.0, 0.0, 0.5]], np.float32)
    reduced = defined.reduce(fine, 1, 2)
    np.testing.assert_allclose(reduced, [[1.005, 0.5]])


def test_a_ramp_between_two_surfaces_is_split() -> None:
    row = np.concatenate([np.full(10, 1.0), [0.85, 0.4], np.full(10, 0.3)]).astype(np.float32)
    sharp = defined.sharpen(np.repeat(row[None], 12, axis=0), 0.0055)[6]
    np.testing.assert_allclose(sharp[:10], 1.0, rtol=0.01)
    np.testing.assert_allclose(sharp[12:], 0.3, rtol=0.01)
    assert sharp[10] > 0.93
    assert sharp[11] < 0.35


def test_the_rim_of_lines_and_single_samples() -> None:
    np.testing.assert_allclose(
        defined.odd_rim(np.array([[1.0, 2.0, 4.0]]), 2)[2], [-2, 0, 1, 2, 4, 6, 7]
    )
    assert defined.odd_rim(np.ones((1, 1)), 2).shape == (5, 5)


@both
@pytest.mark.parametrize("shape", ((1, 1), (1, 2), (2, 1), (2, 2), (3, 5)))
def test_tiny_sensors(backend: Backend, shape: tuple[int, int]) -> None:
    rgb = np.zeros((shape[0] * 7, shape[1] * 7, 3), np.uint8)
    done = complete(np.full(shape, 2.0, np.float32), rgb, backend=backend)
    np.testing.assert_allclose(done, 2.0, rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    width=st.integers(8, 60),
    height=st.integers(8, 60),
    shrink=st.sampled_from((1, 2, 4)),
    holes=st.floats(0, 0.9),
)
def test_the_fast_path_agrees_and_all_depths_are_possible(
    seed: int, width: int, height: int, shrink: int, holes: float
) -> None:
    rgb, sensor_m = random_scene(np.random.default_rng(seed), (height, width), shrink, holes)
    reference = complete(sensor_m, rgb, backend="numpy")
    fast = complete(sensor_m, rgb)
    apart = np.abs(reference / fast - 1)
    assert (apart > AGREEMENT).mean() <= OTHER_SIDE
    known = sensor_m[sensor_m > 0]
    assert fast.dtype == np.float32
    assert fast.min() >= known.min() / 1.501
    assert fast.max() <= known.max() * 1.501


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31), scale=st.sampled_from((0.25, 0.5, 4.0)))
def test_another_unit_of_length_changes_nothing_else(seed: int, scale: float) -> None:
    rgb, sensor_m = random_scene(np.random.default_rng(seed), (40, 30), 2, 0.3)
    done = complete(sensor_m, rgb)
    noise = Completion(noise_per_m=Completion().noise_per_m / scale)
    scaled = complete(sensor_m * np.float32(scale), rgb, options=noise)
    np.testing.assert_allclose(scaled, done * np.float32(scale), rtol=1e-6)


def random_scene(
    rng: np.random.Generator, size: tuple[int, int], shrink: int, holes: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture of patches and what a sensor with noise and holes sees of two surfaces."""
    height, width = size
    rgb = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    shape = (-(-height // shrink), -(-width // shrink))
    y, x = np.mgrid[: shape[0], : shape[1]]
    near = (x - rng.uniform(0, shape[1])) * rng.normal() + (y - shape[0] / 2) * rng.normal() > 0
    sensor_m = np.where(near, 1.0, 2.5) * rng.uniform(0.98, 1.02, shape)
    sensor_m[rng.uniform(size=shape) < holes] = 0.0
    sensor_m[0, 0] = 1.0
    return rgb, sensor_m.astype(np.float32)


def test_impossible_input_is_refused() -> None:
    rgb = np.zeros((40, 80, 3), np.uint8)
    with pytest.raises(ValueError, match="at least one known"):
        complete(np.zeros((10, 20), np.float32), rgb)
    with pytest.raises(ValueError, match="aspect"):
        complete(np.ones((20, 20), np.float32), rgb)
    with pytest.raises(ValueError, match="aspect"):
        complete(np.ones((0, 0), np.float32), rgb)
    with pytest.raises(ValueError, match="> 0"):
        Completion(noise_per_m=0.0)
    with pytest.raises(ValueError, match="> 0"):
        Completion(surface_range=float("nan"))


def test_a_rounded_size_has_the_aspect_still() -> None:
    """640×480 at about 47,000 pixels is 250×188: half a pixel of these off, 1.3 of the sensor's."""
    completed = complete(np.full((480, 640), 2.0, np.float32), np.zeros((188, 250, 3), np.uint8))
    np.testing.assert_allclose(completed, 2.0, rtol=1e-5)
