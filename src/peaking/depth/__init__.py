"""Depth completion: sensor depth, coarse, noisy and with holes, to depth at every pixel.

The distances come from the sensor, the edges from sensor and picture:

1. A sensor finer than half the picture is reduced to that, without mixing surfaces.
2. Holes are filled: each unknown sample belongs to the surface of the known one that is nearest
   when steps across edges of the picture are long (a geodesic distance, as in Criminisi, Sharp &
   Blake 2008), and lies on that surface's plane. Near edges the background is preferred, because
   what a sensor cannot see beside an object is behind it.
3. Samples are smoothed on surfaces and pulled to one side at edges: every sample takes the planes
   of the patches around it that are truly planar (a Kuwahara filter of planes instead of means).
4. At every pixel of the picture: where the samples around are of one surface, their planes are
   interpolated. Where they are of two, the pixel takes the side whose samples are close and have
   its colour, and never a distance in between.

All of it happens in disparity (1/depth), in which planes are planes and parallax is even.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

Backend = Literal["numpy", "numba"]

CLOSEST_M, FARTHEST_M = 1e-3, 1e4
"""Depth outside is not a measurement, and counts as unknown."""


@dataclass(frozen=True)
class Completion:
    """How depth is completed."""

    surface_range: float = 0.1
    """4×4 samples whose disparities differ by less than this part are of one surface."""
    noise_per_m: float = 0.003
    """Noise of the sensor in disparity, 1/m; the same at all distances for stereo, structured light
    and depth from motion, whose noise in depth grows with the square of the distance."""
    colour_sigma: float = 0.06
    """Difference of colours (0…1 per channel) that tells one surface from another."""
    hole_colour: float = 12.0
    """Length, in samples, of a step from black to (one channel's) white, when holes are filled."""

    def __post_init__(self) -> None:
        numbers = (self.surface_range, self.noise_per_m, self.colour_sigma, self.hole_colour)
        if not min(numbers) > 0:
            raise ValueError(f"need numbers > 0, got {self}")


def complete(
    sensor_m: Float32[np.ndarray, "dh dw"],
    rgb: UInt8[np.ndarray, "h w 3"],
    *,
    options: Completion | None = None,
    backend: Backend = "numba",
) -> Float32[np.ndarray, "h w"]:
    """Return depth in metres, > 0, at every pixel of the picture.

    The result is never closer than 2/3 of the closest known sample, nor farther than 3/2 of the
    farthest.

    Args:
        sensor_m: Metric depth of the same field of view, of any size; what is not a number between
            `CLOSEST_M` and `FARTHEST_M` is unknown.
        rgb: The picture.
        options: How.
        backend: Which implementation.

    Raises:
        ValueError: No depth is known, or it has another aspect than the picture (by more than a
            pixel of the coarser of the two).
    """
    how = options or Completion()
    height, width = rgb.shape[:2]
    rows, cols = sensor_m.shape
    if min(rows, cols) == 0 or not _same_aspect((cols, rows), (width, height)):
        raise ValueError(f"need depth of the aspect of {width}x{height}, got {cols}x{rows}")
    known = (sensor_m > CLOSEST_M) & (sensor_m < FARTHEST_M)
    if not known.any():
        raise ValueError("need at least one known depth, got none")
    disparity = np.zeros(sensor_m.shape, np.float32)
    np.divide(np.float32(1.0), sensor_m, out=disparity, where=known)

    if backend == "numpy":
        from peaking.depth import _numpy as module
    else:
        from peaking.depth import _numba as module
    most_rows, most_cols = -(-height // 2), -(-width // 2)
    if rows > most_rows and cols > most_cols:
        disparity = module.reduce(disparity, most_rows, most_cols)
    guide = _reduced(rgb, *disparity.shape)
    noise = how.noise_per_m
    filled = module.fill_holes(disparity, guide, how.hole_colour, noise)
    sharp = module.sharpen(filled, noise)
    chosen = module.choose_sides(sharp, guide, rgb, how.surface_range, how.colour_sigma, noise)
    return np.float32(1.0) / cv2.medianBlur(chosen, 3).astype(np.float32)


def _reduced(
    rgb: UInt8[np.ndarray, "h w 3"], rows: int, cols: int
) -> UInt8[np.ndarray, "rows cols 3"]:
    """Reduce a picture by means over areas, at half the time that OpenCV takes for odd ratios."""
    times = max(1, round(rgb.shape[0] / rows))
    whole = cv2.resize(rgb, (cols * times, rows * times), interpolation=cv2.INTER_LINEAR)
    return cv2.resize(whole, (cols, rows), interpolation=cv2.INTER_AREA).astype(np.uint8)


def _same_aspect(a_px: tuple[int, int], b_px: tuple[int, int]) -> bool:
    """Return whether two sizes differ in aspect by at most a pixel of the coarser one."""
    (small_w, small_h), (large_w, large_h) = sorted((a_px, b_px))
    return (
        abs(small_w * large_h / large_w - small_h) <= 1
        or abs(small_h * large_w / large_h - small_w) <= 1
    )
