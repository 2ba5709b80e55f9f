import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float64

from peaking.metrics.psnr_ssim import _checked_mask, psnr, relative_sharpness, ssim

SCIKIT_IMAGE_TOLERANCE = 1e-9
"""Worst measured: 1.8e-15 (both are float64; only the order of the sums differs)."""


def waves() -> tuple[Float64[np.ndarray, "24 32 3"], Float64[np.ndarray, "24 32 3"]]:
    y, x = np.mgrid[0:24, 0:32].astype(np.float64)
    reference = np.stack(
        [0.5 + 0.4 * np.sin(0.5 * x + 0.2 * y), 0.5 + 0.4 * np.cos(0.3 * x * y / 10), x / 31],
        axis=-1,
    )
    ripple = 0.06 * np.sin(1.7 * x - 0.9 * y)[..., None]
    return reference, np.clip(0.9 * reference + ripple + 0.02, 0, 1)


def test_psnr_of_a_tenth_everywhere_is_20_db() -> None:
    image = np.full((2, 3, 3), 0.5)
    assert psnr(image, image + 0.1) == pytest.approx(20.0)


def test_psnr_counts_the_mask_alone() -> None:
    reference = np.zeros((1, 2, 3))
    image = np.array([[[0.1, 0.1, 0.1], [1.0, 1.0, 1.0]]])
    assert psnr(image, reference, np.array([[True, False]])) == pytest.approx(20.0)
    assert psnr(image, reference) == pytest.approx(-10 * np.log10((0.01 + 1.0) / 2))


def test_psnr_of_equal_pictures_is_infinite() -> None:
    assert psnr(np.ones((2, 2, 3)), np.ones((2, 2, 3))) == float("inf")


def test_ssim_of_two_flat_pictures_is_the_term_of_brightness() -> None:
    # No variance: the term of structure is 1, and 0.4 against 0.6 leaves (0.48 + c) / (0.52 + c).
    flat = np.full((11, 11, 1), 0.4)
    c1 = 0.01**2
    assert ssim(flat, flat + 0.2) == pytest.approx((0.48 + c1) / (0.52 + c1))


def test_ssim_of_a_picture_and_its_negative_at_one_window() -> None:
    # Equal means and variances v, covariance -v: (c2 - 2 v) / (c2 + 2 v).
    columns = np.where(np.arange(11) % 2 == 0, 1.0, -1.0)
    weight = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    mean = (weight / weight.sum() * columns).sum()
    pattern = np.tile(columns - mean, (11, 1))[..., None]
    v = 0.04 * (1 - mean**2)
    c2 = 0.03**2
    value = ssim(0.5 + 0.2 * pattern, 0.5 - 0.2 * pattern)
    assert value == pytest.approx((c2 - 2 * v) / (c2 + 2 * v))


def test_agreement_with_scikit_image() -> None:
    # scikit-image 0.26.0, numpy 2.4.6: peak_signal_noise_ratio(reference, image, data_range=1.0)
    # and structural_similarity(reference, image, data_range=1.0, channel_axis=-1,
    # gaussian_weights=True, sigma=1.5, use_sample_covariance=False).
    reference, image = waves()
    shifted = np.roll(reference, 1, axis=1)
    assert psnr(image, reference) == pytest.approx(24.44666625725489, abs=SCIKIT_IMAGE_TOLERANCE)
    assert ssim(image, reference) == pytest.approx(0.8880169266620114, abs=SCIKIT_IMAGE_TOLERANCE)
    assert psnr(shifted, reference) == pytest.approx(15.74022904541711, abs=SCIKIT_IMAGE_TOLERANCE)
    assert ssim(shifted, reference) == pytest.approx(0.9056493136480291, abs=SCIKIT_IMAGE_TOLERANCE)


def test_a_full_mask_is_no_mask() -> None:
    reference, image = waves()
    full = np.ones((24, 32), dtype=bool)
    assert ssim(image, reference, full) == ssim(image, reference)
    assert psnr(image, reference, full) == psnr(image, reference)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_what_is_outside_the_mask_has_no_influence(seed: int) -> None:
    rng = np.random.default_rng(seed)
    reference, image = waves()
    mask = rng.random((24, 32)) < 0.7
    mask[12, 16] = True
    spoiled = np.where(mask[..., None], image, rng.random(image.shape))
    assert ssim(spoiled, reference, mask) == ssim(image, reference, mask)
    assert psnr(spoiled, reference, mask) == psnr(image, reference, mask)
    assert relative_sharpness(spoiled, reference, mask) == relative_sharpness(
        image, reference, mask
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.05, 1.0))
def test_ssim_is_symmetric_at_most_one_and_one_for_equal_pictures(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 14, 15, 3))
    mask = rng.random((14, 15)) < share
    mask[7, 7] = True
    assert ssim(a, b, mask) == pytest.approx(ssim(b, a, mask))
    assert ssim(a, b, mask) <= 1.0
    assert ssim(a, a, mask) == pytest.approx(1.0)


def test_half_the_contrast_is_half_as_sharp() -> None:
    reference, _ = waves()
    assert relative_sharpness(0.5 * reference + 0.1, reference) == pytest.approx(0.5)
    assert relative_sharpness(reference, np.zeros_like(reference)) == 1.0


def test_bad_input_is_named() -> None:
    picture = np.zeros((12, 12, 3))
    with pytest.raises(ValueError, match="one shape"):
        _checked_mask(picture, picture[:-1], None)
    with pytest.raises(ValueError, match="need a mask of"):
        _checked_mask(picture, picture, np.ones((3, 3), dtype=bool))
    with pytest.raises(ValueError, match="empty"):
        psnr(picture, picture, np.zeros((12, 12), dtype=bool))
    with pytest.raises(ValueError, match="at least 11x11"):
        ssim(picture[:5], picture[:5])
    corner = np.zeros((12, 12), dtype=bool)
    corner[0, 0] = True
    with pytest.raises(ValueError, match="5 px from the border"):
        ssim(picture, picture, corner)
