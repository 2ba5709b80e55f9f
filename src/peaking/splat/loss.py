"""What training minimises: 0.8 L1 + 0.2 (1 - SSIM), with its gradient (Kerbl et al. 2023)."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float

SSIM_LAMBDA = 0.2
SSIM_WINDOW_PX = 11
SSIM_SIGMA_PX = 1.5
SSIM_C1 = 0.01**2
SSIM_C2 = 0.03**2

Image = Float[np.ndarray, "h w 3"]


def loss_and_gradient(rgb: Image, photo: Image) -> tuple[float, Image]:
    """Return the loss and its gradient by every value of `rgb`."""
    similarity, by_rgb = ssim_and_gradient(rgb, photo)
    difference = rgb - photo
    l1 = float(np.abs(difference).mean())
    loss = (1 - SSIM_LAMBDA) * l1 + SSIM_LAMBDA * (1 - similarity)
    by_rgb *= -SSIM_LAMBDA
    by_rgb += np.sign(difference) * ((1 - SSIM_LAMBDA) / rgb.size)
    return loss, by_rgb


def ssim_and_gradient(rgb: Image, photo: Image) -> tuple[float, Image]:
    """Return the mean SSIM (windows are padded with zeros at the border) and its gradient."""
    mean_x, mean_y = _blur(rgb), _blur(photo)
    mean_xy = mean_x * mean_y
    square_x, square_y = mean_x * mean_x, mean_y * mean_y
    variances = _blur(rgb * rgb + photo * photo) - square_x - square_y
    covariance = _blur(rgb * photo) - mean_xy
    a1, a2 = 2 * mean_xy + SSIM_C1, 2 * covariance + SSIM_C2
    b1, b2 = square_x + square_y + SSIM_C1, variances + SSIM_C2
    inverse = 1 / (b1 * b2)
    similarity = a1 * a2 * inverse
    by_product = 2 * a1 * inverse
    by_square = -similarity / b2
    by_mean = 2 * mean_y * (a2 - a1) * inverse - 2 * mean_x * similarity * (1 / b1 - 1 / b2)
    # The window is symmetric and padded with zeros: the blur is its own transpose.
    gradient = _blur(by_mean) + 2 * rgb * _blur(by_square) + photo * _blur(by_product)
    gradient /= rgb.size
    return float(similarity.mean()), gradient


def _blur(values: Image) -> Image:
    size = (SSIM_WINDOW_PX, SSIM_WINDOW_PX)
    return cv2.GaussianBlur(values, size, SSIM_SIGMA_PX, borderType=cv2.BORDER_CONSTANT)
