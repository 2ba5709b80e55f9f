# pyright: basic
# pyright: reportArgumentType=false, reportCallIssue=false
"""A phone: how a hand trembles, and what the depth sensor makes of a scene."""

import cv2
import numpy as np

DEPTH_SIZE_PX = (74, 160)
"""Width and height of the phone's depth picture; it covers the whole colour picture."""
FULL_WIDTH_PX = 294
"""Errors in pixels are given for a colour picture of this width, and scaled for others."""

DISPARITY_STEP_PER_M = 0.001


def tremor(frame: float, seed: int) -> np.ndarray:
    """Six smooth signals of deviation about 1: sums of sines of 1 to 4 Hz at 15 frames a second."""
    rng = np.random.default_rng((seed, 77))
    hertz, phase = rng.uniform(1.0, 4.0, (6, 5)), rng.uniform(0, 2 * np.pi, (6, 5))
    return np.sin(2 * np.pi * hertz * frame / 15.0 + phase).sum(axis=1) * np.sqrt(2 / 5)


def scale_errors(count: int, seed: int) -> np.ndarray:
    """The depth scale of each frame: wanders around 1 with deviation 0.005, half-life 7 frames."""
    rng = np.random.default_rng((seed, 78))
    keep, errors = 0.5 ** (1 / 7), np.zeros(count)
    errors[0] = rng.standard_normal()
    for k in range(1, count):
        errors[k] = keep * errors[k - 1] + np.sqrt(1 - keep**2) * rng.standard_normal()
    return 1.0 + 0.005 * errors


def phone_depth(
    seen_m: np.ndarray,
    image: np.ndarray,
    dropout: np.ndarray,
    *,
    scale: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """What an AR phone reports for a frame, `160 74`, uint16 millimetres, 0 = unknown.

    Args:
        seen_m: Depth along the optical axis as a sensor would see it, at full resolution: on the
            mirror the depth of the mirrored scene, on glass that of what lies behind.
        image: The colour picture, sRGB uint8.
        dropout: Doubt about each pixel, 0 to 1 (mirror and glass); 0.35 loses about half of them.
        scale: This frame's depth scale (see `scale_errors`).
        rng: Draws the frame's errors.

    In this order: depth edges are shifted by a smooth field of 2.2 px deviation and mixed by a
    blur of 2.5 px in disparity (depth from motion fattens and rounds edges); noise of deviation
    0.004 z^2 m, in blobs of 2.5 depth pixels; the frame's scale error; rounding to steps of
    0.001 per metre in disparity (1.7 mm at 1.3 m). Holes, 13 % of the pixels: dark or very bright
    places, blobs, ragged borders, `dropout`.
    """
    wide, high = DEPTH_SIZE_PX
    px = seen_m.shape[1] / FULL_WIDTH_PX
    shift = [2.2 * px * _blobs(rng, seen_m.shape, 12.0 * px) for _ in range(2)]
    v, u = np.mgrid[0 : seen_m.shape[0], 0 : seen_m.shape[1]].astype(np.float32)
    moved = cv2.remap(
        (1.0 / seen_m).astype(np.float32),
        u + shift[0],
        v + shift[1],
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_REPLICATE,
    )
    mixed = cv2.GaussianBlur(moved, (0, 0), 2.5 * px)
    depth_m = 1.0 / _at_centres(mixed, DEPTH_SIZE_PX)

    noise = _blobs(rng, (high, wide), 2.5)
    depth_m = (depth_m + 0.004 * depth_m**2 * noise) * scale

    full_grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    grey = cv2.resize(full_grey, DEPTH_SIZE_PX, interpolation=cv2.INTER_AREA) / 255.0
    doubt = np.clip((0.09 - grey) / 0.08, 0, 1) + np.clip((grey - 0.90) / 0.06, 0, 1)
    doubt += 1.6 * cv2.resize(
        dropout.astype(np.float32), DEPTH_SIZE_PX, interpolation=cv2.INTER_AREA
    )
    holes = _blobs(rng, (high, wide), 2.0) + 3.2 * doubt > 2.1
    holes |= _blobs(rng, (high, wide), 4.0) > 1.85
    holes |= _border_distance(high, wide) < 0.9 + 0.8 * _blobs(rng, (high, wide), 4.0)
    steps = np.maximum(np.round(1.0 / (depth_m * DISPARITY_STEP_PER_M)), 1)
    depth_m = 1.0 / (steps * DISPARITY_STEP_PER_M)
    return np.where(holes, 0, np.clip(depth_m * 1000.0 + 0.5, 1, 65535)).astype(np.uint16)


def _blobs(rng: np.random.Generator, size: tuple[int, ...], sigma_px: float) -> np.ndarray:
    """Gaussian noise of deviation 1, correlated over `sigma_px`."""
    noise = cv2.GaussianBlur(
        rng.standard_normal(size).astype(np.float32),
        (0, 0),
        sigma_px,
        borderType=cv2.BORDER_REFLECT,
    )
    return noise * np.float32(2 * np.sqrt(np.pi) * sigma_px)


def _border_distance(high: int, wide: int) -> np.ndarray:
    """Pixels from each pixel to the picture's rim."""
    v, u = np.mgrid[0:high, 0:wide]
    return np.minimum(np.minimum(u, wide - 1 - u), np.minimum(v, high - 1 - v))


def _at_centres(image: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """Read `image` at the pixel centres of a smaller picture of the same view."""
    wide, high = size_px
    u = ((np.arange(wide) + 0.5) * image.shape[1] / wide - 0.5).astype(np.float32)
    v = ((np.arange(high) + 0.5) * image.shape[0] / high - 0.5).astype(np.float32)
    return cv2.remap(image, *np.meshgrid(u, v), cv2.INTER_LINEAR)
