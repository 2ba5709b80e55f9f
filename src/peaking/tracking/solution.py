"""What an implementation of the alignment answers, and the numbers that all of them share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Pinhole

LUMA = (0.299, 0.587, 0.114)
"""Shares of red, green and blue in the brightness that is compared (Rec. ITU-R BT.601)."""

MIN_ALPHA = 0.95
"""What is less opaque is not compared."""

DEPTH_EDGE = 1.08
"""Where depths of neighbouring pixels differ by more than this factor, nothing is compared."""

MIN_GRADIENT = 0.01
"""Change of brightness, 0…1, per pixel, x and y together: below it a pixel tells nothing."""

MIN_PIXELS = 150
"""With fewer pixels that count, nothing is aligned."""

MAX_CHOSEN = 8000
"""Of more pixels that could be compared, about so many are, evenly spread (`kept_of_256`)."""

FINEST_PIXELS = 48_000
"""Larger pictures are halved until they have no more: the last quarter of a pixel is not needed."""

MAX_LEVELS = 4
SHORTEST_SIDE_PX = 20
"""The coarsest of the pictures that are aligned one after another is no smaller."""

ITERATIONS = 10
"""At every level, at most."""

SMALL_MOVE_M = 5e-5
SMALL_TURN_RAD = 3e-5
"""After a step smaller than this a level is done."""

CAUCHY = 2.0
"""A residual of this many standard deviations has half the weight."""

MIN_SIGMA = 0.01
"""Standard deviation of brightness that is always allowed for: noise and rounding."""

AGREES = 3.0
"""Within this many standard deviations, pixels agree …"""

MAX_AGREEING_SIGMA = 0.04
"""… of which no more is allowed for than this."""

CORRELATED = 16.0
"""So many pixels err together: a rendering is wrong in patches, and not in pixels."""

GAIN_SD = 0.5
OFFSET_SD = 0.1
"""What is known of the brightness beforehand: it is the rendering's, give or take this."""

GAIN_RANGE = (0.25, 4.0)


class Solution(NamedTuple):
    """Where the search ended, whether it can be believed or not.

    Attributes:
        rotation: From the frame of the rendering's camera into the live camera's …
        translation_m: … `p_live = rotation @ p + translation_m`.
        information: Inverse of the covariance of the motion, 1/m² and 1/rad², with the prior's.
        gain: Brightness of the live picture over the rendering's.
        offset: Brightness that is added to it.
        num_pixels: Pixels that were compared at the finest level.
        agreeing: Share of them that agree.
        correlation: Of the brightness of both, weighted as in the search.
        error_before: Mean robust error at the given pose, over pixels seen from both.
        error_after: The same at the pose that was found.
        last_step: Along x, y, z in metres, about x, y, z in radians.
    """

    rotation: Float64[np.ndarray, "3 3"]
    translation_m: Float64[np.ndarray, "3"]
    information: Float64[np.ndarray, "6 6"]
    gain: float
    offset: float
    num_pixels: int
    agreeing: float
    correlation: float
    error_before: float
    error_after: float
    last_step: Float64[np.ndarray, "6"]


def nothing_found(information: Float64[np.ndarray, "6 6"], num_pixels: int = 0) -> Solution:
    """Return the given pose, of which nothing was learned."""
    return Solution(
        np.eye(3), np.zeros(3), information, 1.0, 0.0, num_pixels, 0.0, 0.0, 0.0, 0.0, np.zeros(6)
    )


def first_and_last_level(height: int, width: int) -> tuple[int, int]:
    """Return by how many halvings the finest and the coarsest picture come about."""
    finest = 0
    while (height >> finest) * (width >> finest) > FINEST_PIXELS:
        finest += 1
    coarsest = finest
    while (
        coarsest - finest + 1 < MAX_LEVELS
        and min(height, width) >> (coarsest + 1) >= SHORTEST_SIDE_PX
    ):
        coarsest += 1
    return finest, coarsest


def halved(pinhole: Pinhole, times: int) -> Pinhole:
    """Return the camera of a picture after halvings; an odd last row or column is cut off."""
    s = 0.5**times
    return Pinhole(
        pinhole.width_px >> times,
        pinhole.height_px >> times,
        pinhole.fx_px * s,
        pinhole.fy_px * s,
        pinhole.cx_px * s,
        pinhole.cy_px * s,
    )


def kept_of_256(count: int) -> int:
    """Return how many of 256 pixels are kept: those with (151 row + 97 column) mod 256 below."""
    return 256 if count <= MAX_CHOSEN else 256 * MAX_CHOSEN // count


def rotation_of(turn: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation about an axis by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine = math.sin(angle) / angle if angle > 1e-9 else 1.0
    cosine = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-9 else 0.5
    return np.eye(3) + sine * cross + cosine * cross @ cross
