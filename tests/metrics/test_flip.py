import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float32

from metric_pairs import metric_pairs
from peaking.metrics.flip import flip_mean

FLIP_EVALUATOR_TOLERANCE = 1e-5
"""Worst measured: 6.2e-6 (both are float32, and its matrix from linear RGB to XYZ differs in the
fifth digit)."""


def flat(red: float, green: float, blue: float) -> Float32[np.ndarray, "24 30 3"]:
    return np.full((24, 30, 3), (red, green, blue), dtype=np.float32)


def test_black_and_white_by_hand() -> None:
    # No edges, so the colour alone: HyAB is 100 (L* from 0 to 100). The largest is that of green,
    # L*a*b* (87.735, -86.183, 83.179), and blue, (32.297, 79.188, -107.860), with Hunt:
    # 55.438 + |(-101.188, 107.813)| = 203.299.
    largest, difference = 203.299**0.7, 100**0.7
    expected = 0.95 + 0.05 * (difference - 0.4 * largest) / (0.6 * largest)
    assert flip_mean(flat(0, 0, 0), flat(1, 1, 1)) == pytest.approx(expected, abs=1e-5)


def test_two_greys_by_hand() -> None:
    # Below the knee: 0.95 at 0.4 of the largest difference, and in proportion. sRGB 0.5 has
    # Y = 0.21404, L* = 53.389, and 0.4 has Y = 0.13287, L* = 43.192.
    expected = 0.95 * (53.389 - 43.192) ** 0.7 / (0.4 * 203.299**0.7)
    assert flip_mean(flat(0.4, 0.4, 0.4), flat(0.5, 0.5, 0.5)) == pytest.approx(expected, abs=1e-4)


def test_green_and_blue_differ_most() -> None:
    assert flip_mean(flat(0, 1, 0), flat(0, 0, 1)) == pytest.approx(1.0, abs=1e-5)


def test_equal_pictures_do_not_differ() -> None:
    _, reference = metric_pairs()["rippled"]
    assert flip_mean(reference, reference.copy()) == 0.0


@pytest.mark.parametrize(
    ("name", "pixels_per_degree", "expected"),
    [
        # flip-evaluator 1.7: tests/oracles/flip_values.py.
        ("rippled", 67.0, 0.2729642391204834),
        ("rippled", 30.0, 0.3227372467517853),
        ("shifted", 67.0, 0.4627552330493927),
        ("shifted", 30.0, 0.6550300121307373),
        ("hole", 67.0, 0.09052537381649017),
        ("hole", 30.0, 0.07880627363920212),
        ("grey", 67.0, 0.7247195839881897),
        ("grey", 30.0, 0.7642369270324707),
    ],
)
def test_agreement_with_flip_evaluator(
    name: str, pixels_per_degree: float, expected: float
) -> None:
    image, reference = metric_pairs()[name]
    value = flip_mean(image, reference, pixels_per_degree=pixels_per_degree)
    assert value == pytest.approx(expected, abs=FLIP_EVALUATOR_TOLERANCE)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), pixels_per_degree=st.floats(5.0, 100.0))
def test_flip_is_symmetric_and_within_0_and_1(seed: int, pixels_per_degree: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 12, 17, 3), dtype=np.float32) * np.float32(1.4) - np.float32(0.2)
    value = flip_mean(a, b, pixels_per_degree=pixels_per_degree)
    assert value == pytest.approx(flip_mean(b, a, pixels_per_degree=pixels_per_degree), abs=1e-6)
    assert 0 < value <= 1
    clipped = flip_mean(a.clip(0, 1), b.clip(0, 1), pixels_per_degree=pixels_per_degree)
    assert value == pytest.approx(clipped, abs=1e-6)


def test_bad_input_is_named() -> None:
    picture = flat(0, 0, 0)
    with pytest.raises(ValueError, match="one shape"):
        flip_mean(picture[:0], picture[:0])
    with pytest.raises(ValueError, match="pixels_per_degree > 0, got 0"):
        flip_mean(picture, picture, pixels_per_degree=0.0)
    with pytest.raises(ValueError, match="pixels_per_degree > 0, got nan"):
        flip_mean(picture, picture, pixels_per_degree=float("nan"))
