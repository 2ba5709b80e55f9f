"""By how much the live picture is brighter than the rendering, and how it falls off to its corners.

A camera's exposure, white balance and vignette are global or smooth: a factor per channel, and one
fall-off with the square of the distance from the middle, `gain_c exp(falloff r²)`. They are no
fault of the model. What is only a part of the picture is one, however large: so the factors that
change nothing are believed where a good part of the picture agrees with them, and what does not
agree with the factors has no say in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from peaking.rendering import Rendering

STRIDE_PX = 5
"""Every how many pixels the exposure is measured at, per axis."""

MAX_LOG_GAIN = float(np.log(2.0))
"""A channel is compensated by at most a factor of 2, up or down."""

OPAQUE = 0.95
"""Opacity from which a pixel tells something."""

DARK, CLIPPED = 0.04, 0.97
"""Channels of a pixel that tells something lie between these, in both pictures."""

FALLOFFS: Float64[np.ndarray, "falloffs"] = np.arange(-9, 4) * 0.05
"""The fall-offs that are tried: from corners at 64 % to corners at 116 %."""

BIN, HALF_WIDTH = 0.02, 4
"""Log factors are counted in bins of this size, this many to each side of one."""

FALLOFF_COST = 0.15
"""A fall-off of 1 must explain so much more of the picture than none."""

UNCHANGED = 0.3
"""If this part of the picture agrees that nothing changed, nothing did."""

AGREES = 0.09
"""Log factors within this of the exposure agree with it."""

STEPS = 3
"""The factors are fitted to what agrees with them so many times."""

STIFFNESS = 0.002
"""How much the fit prefers no fall-off."""

MIN_PIXELS = 30
"""Fewer tell nothing."""


@dataclass(frozen=True)
class Exposure:
    """How a live picture is brighter than the rendering.

    Attributes:
        gain: Factor per channel, in the middle of the picture.
        falloff: Log of the factor in the corners, on top of it.
    """

    gain: Float32[np.ndarray, "3"]
    falloff: float

    def factors(self, width_px: int, height_px: int) -> Float32[np.ndarray, "h w"]:
        """Return what the fall-off makes of every pixel; the gain is left out."""
        radius_squared = _radius_squared(width_px, height_px, step_px=1)
        return np.exp(self.falloff * radius_squared).astype(np.float32)


SAME = Exposure(np.ones(3, np.float32), 0.0)


def measure_exposure(rendering: Rendering, live: UInt8[np.ndarray, "h w 3"]) -> Exposure:
    """Return by how much the live picture is brighter than the rendering; `SAME` if nothing tells.

    The factor is the most frequent one under the fall-off that makes it most frequent, then the
    median of those that agree with it; but nothing changed where `UNCHANGED` of the picture says
    so. The factor of a channel is the median over the pixels that agree.
    """
    height, width = live.shape[:2]
    rgba = rendering.rgba[::STRIDE_PX, ::STRIDE_PX].reshape(-1, 4).astype(np.float64)
    theirs = live[::STRIDE_PX, ::STRIDE_PX].reshape(-1, 3) / 255.0
    ours = rgba[:, :3] / np.maximum(rgba[:, 3:], 1e-6)
    told = (rgba[:, 3] > OPAQUE) & _tells(ours) & _tells(theirs)
    if np.count_nonzero(told) < MIN_PIXELS:
        return SAME
    r2 = _radius_squared(width, height, step_px=STRIDE_PX).ravel()[told]
    ours, theirs = ours[told], theirs[told]
    log_ratio = np.log(theirs.sum(axis=1) / ours.sum(axis=1))
    log_gain, falloff = _most_frequent(log_ratio, r2)
    for _ in range(STEPS):
        agrees = np.abs(log_ratio - log_gain - falloff * r2) < AGREES
        if np.count_nonzero(agrees) < MIN_PIXELS:
            return SAME
        falloff = _slope(r2[agrees], log_ratio[agrees])
        log_gain = float(np.median(log_ratio[agrees] - falloff * r2[agrees]))
    agrees = np.abs(log_ratio - log_gain - falloff * r2) < AGREES
    if np.count_nonzero(agrees) < MIN_PIXELS:
        return SAME
    flat = np.log(theirs[agrees] / ours[agrees]) - falloff * r2[agrees, None]
    log_gains = np.clip(np.median(flat, axis=0), -MAX_LOG_GAIN, MAX_LOG_GAIN)
    return Exposure(np.exp(log_gains).astype(np.float32), falloff)


def _tells(rgb: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    return (rgb.min(axis=1) > DARK) & (rgb.max(axis=1) < CLIPPED)


def _most_frequent(
    log_ratio: Float64[np.ndarray, "n"], r2: Float64[np.ndarray, "n"]
) -> tuple[float, float]:
    """Return the log factor and fall-off that most of the picture agrees with."""
    if np.count_nonzero(np.abs(log_ratio) < AGREES) >= UNCHANGED * len(log_ratio):
        return 0.0, 0.0
    bins = int(np.ceil(2 * MAX_LOG_GAIN / BIN)) + 2 * HALF_WIDTH
    best, found = -np.inf, (0.0, 0.0)
    for falloff in FALLOFFS:
        place = np.floor((log_ratio - falloff * r2) / BIN).astype(np.int64) + bins // 2
        counts = np.bincount(place[(place >= 0) & (place < bins)], minlength=bins)
        around = np.convolve(counts, np.ones(2 * HALF_WIDTH + 1), "same")
        most = int(np.argmax(around))
        score = around[most] - FALLOFF_COST * len(log_ratio) * abs(falloff)
        if score > best:
            best, found = score, ((most - bins // 2 + 0.5) * BIN, float(falloff))
    return found


def _slope(r2: Float64[np.ndarray, "n"], log_ratio: Float64[np.ndarray, "n"]) -> float:
    centred = r2 - r2.mean()
    slope = (centred @ (log_ratio - log_ratio.mean())) / (centred @ centred + STIFFNESS * len(r2))
    return float(np.clip(slope, FALLOFFS[0], FALLOFFS[-1]))


def _radius_squared(
    width_px: int, height_px: int, *, step_px: int
) -> Float64[np.ndarray, "rows cols"]:
    """Return squared distances of every so many pixels from the middle; 1 in the corners."""
    x = np.arange(0, width_px, step_px, dtype=np.float64) + 0.5 - 0.5 * width_px
    y = np.arange(0, height_px, step_px, dtype=np.float64) + 0.5 - 0.5 * height_px
    return (x**2 + y[:, None] ** 2) / (0.25 * (width_px**2 + height_px**2))
