"""How near a synthesised picture is to a photograph: PSNR, SSIM and relative sharpness, with masks.

Colours are encoded (sRGB) values in 0…1; a mask says which pixels count.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64

SSIM_SIGMA_PX = 1.5
SSIM_WINDOW_PX = 11
SSIM_K1 = 0.01
SSIM_K2 = 0.03
"""Wang et al. 2004, section III-C: window, K1 and K2 (range of values L = 1)."""


def psnr(
    image: Float[np.ndarray, "h w c"],
    reference: Float[np.ndarray, "h w c"],
    mask: Bool[np.ndarray, "h w"] | None = None,
) -> float:
    """Return the peak signal-to-noise ratio in dB: -10 log10 of the mean squared difference.

    The mean goes over all channels of the pixels in the mask; the peak is 1. Equal pictures give
    infinity.

    Raises:
        ValueError: The sizes differ or the mask is empty.
    """
    counted = _checked_mask(image, reference, mask)
    whole = mask is None  # needs no copies of what counts
    shown, photographed = (p if whole else p[counted] for p in (image, reference))
    difference = np.subtract(shown, photographed, dtype=np.float64).ravel()
    mean_square = float(difference @ difference) / difference.size
    return -10.0 * float(np.log10(mean_square)) if mean_square > 0 else float("inf")


def ssim(
    image: Float[np.ndarray, "h w c"],
    reference: Float[np.ndarray, "h w c"],
    mask: Bool[np.ndarray, "h w"] | None = None,
) -> float:
    """Return the structural similarity, 1 for equal pictures (Wang et al. 2004, equation 13).

    Every channel has its own map (Gaussian window 11×11, σ = 1.5 px, K1 = 0.01, K2 = 0.03,
    population variances); the result is the mean over channels and over the windows' centres that
    are in the mask and at least 5 px from the picture's border, so every window lies wholly in the
    picture. A window that sees pixels outside the mask leaves them out: its weights are
    renormalised over the pixels it keeps, and what stands outside the mask has no influence.

    Raises:
        ValueError: The sizes differ, the picture is smaller than the window, or no pixel of the
            mask is 5 px away from the border.
    """
    counted = _checked_mask(image, reference, mask)
    rim = SSIM_WINDOW_PX // 2
    if min(counted.shape) < SSIM_WINDOW_PX:
        raise ValueError(f"need at least {SSIM_WINDOW_PX}x{SSIM_WINDOW_PX} px, got {counted.shape}")
    centers = np.zeros_like(counted)
    centers[rim:-rim, rim:-rim] = counted[rim:-rim, rim:-rim]
    if not centers.any():
        raise ValueError(f"need a pixel of the mask at least {rim} px from the border, got none")

    weight = counted.astype(np.float64)
    share = np.maximum(_windowed(weight), 1e-12)
    maps = [
        _ssim_map(image[..., c] * weight, reference[..., c] * weight, share)[centers].mean()
        for c in range(image.shape[-1])
    ]
    return float(np.mean(maps))


def relative_sharpness(
    image: Float[np.ndarray, "h w c"],
    reference: Float[np.ndarray, "h w c"],
    mask: Bool[np.ndarray, "h w"] | None = None,
) -> float:
    """Return the mean absolute difference of neighbouring pixels, over that of the reference.

    Below 1 the picture is blurred: to be read beside PSNR and SSIM, which go up with blur where the
    two pictures are not aligned to the pixel. Neighbours count when both are in the mask; channels
    are averaged first. 1 when there is nothing to see in the reference.

    Raises:
        ValueError: The sizes differ or the mask is empty.
    """
    counted = _checked_mask(image, reference, mask)
    steps = [_steps(picture.mean(axis=-1), counted) for picture in (image, reference)]
    return steps[0] / steps[1] if steps[1] > 0 else 1.0


def _steps(grey: Float[np.ndarray, "h w"], counted: Bool[np.ndarray, "h w"]) -> float:
    """Return the sum of absolute differences between neighbours that both count."""
    across = np.abs(np.diff(grey, axis=1))[counted[:, 1:] & counted[:, :-1]].sum()
    down = np.abs(np.diff(grey, axis=0))[counted[1:] & counted[:-1]].sum()
    return float(across + down)


def _ssim_map(
    x: Float64[np.ndarray, "h w"], y: Float64[np.ndarray, "h w"], share: Float64[np.ndarray, "h w"]
) -> Float64[np.ndarray, "h w"]:
    """Return the map of one channel; x and y are 0 outside the mask, `share` is its weight."""
    mean_x, mean_y = _windowed(x) / share, _windowed(y) / share
    variance_x = _windowed(x * x) / share - mean_x**2
    variance_y = _windowed(y * y) / share - mean_y**2
    covariance = _windowed(x * y) / share - mean_x * mean_y
    c1, c2 = SSIM_K1**2, SSIM_K2**2
    brightness = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
    structure = (2 * covariance + c2) / (variance_x + variance_y + c2)
    return brightness * structure


def _windowed(values: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "h w"]:
    """Return the Gaussian-weighted mean around every pixel, with zeros outside the picture."""
    window = cv2.getGaussianKernel(SSIM_WINDOW_PX, SSIM_SIGMA_PX, cv2.CV_64F)
    return cv2.sepFilter2D(values, cv2.CV_64F, window, window, borderType=cv2.BORDER_CONSTANT)


def _checked_mask(
    image: Float[np.ndarray, "..."],
    reference: Float[np.ndarray, "..."],
    mask: Bool[np.ndarray, "..."] | None,
) -> Bool[np.ndarray, "h w"]:
    """Return the mask (everything when None) after comparing the sizes."""
    if image.ndim != 3 or image.shape != reference.shape:
        raise ValueError(
            f"need two pictures of one shape (h, w, c), got {image.shape} and {reference.shape}"
        )
    if mask is None:
        return np.ones(image.shape[:2], dtype=bool)
    if mask.shape != image.shape[:2]:
        raise ValueError(f"need a mask of {image.shape[:2]}, got {mask.shape}")
    if not mask.any():
        raise ValueError("need a mask with at least one pixel, got an empty one")
    return mask.astype(bool)
