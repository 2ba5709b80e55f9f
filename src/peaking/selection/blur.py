"""How sharp a picture is, and which are less sharp than others of the same place."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from peaking.geometry import Camera

FINE_PX = 1.5
"""Standard deviation of the Gaussian that parts fine structure from coarse."""

DIRECTIONS = 4

LIKE = 8
"""Pictures from the nearest places, with whose median sharpness one is compared."""

BLURRED, SHARP = 0.6, 1.0
"""Sharpness relative to the others' at which a picture is worth nothing, and all that it shows.
Blurred by 7 px in 640, pictures have 0.4 to 0.65, by 4 px 0.6 to 0.9; 9 of 10 that are not blurred
have more than 0.8 (kitchen, office)."""

CHUNK = 256
"""Pictures whose distances to all others are in memory at once."""

METRES_PER_RAD = 1.0
"""What a rotation counts as when the nearest places are looked for."""


def sharpness(rgb: UInt8[np.ndarray, "h w 3"]) -> float:
    """Return how strong fine gradients are beside coarse ones, in the direction where least.

    Motion blurs along one direction only. It depends on what is shown, so compare pictures of the
    same place.

    Args:
        rgb: The picture; compare pictures of about the same size.

    Returns:
        0 for a smooth picture; 0.3 … 1.5 for most photographs.
    """
    gray = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    coarse = cv2.GaussianBlur(gray, (0, 0), FINE_PX)
    of_fine, of_coarse = _energies(gray - coarse), _energies(coarse)
    return float((np.sqrt(of_fine) / (np.sqrt(of_coarse) + 1.0)).min())


def _energies(picture: np.ndarray) -> Float64[np.ndarray, "directions"]:
    """Return the mean squared derivatives along some directions."""
    dx = cv2.Sobel(picture, cv2.CV_32F, 1, 0, ksize=3)
    dy = cv2.Sobel(picture, cv2.CV_32F, 0, 1, ksize=3)
    xx, xy, yy = (float(np.mean(a * b)) for a, b in ((dx, dx), (dx, dy), (dy, dy)))
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    c, s = np.cos(angles), np.sin(angles)
    return np.maximum(c * c * xx + 2 * c * s * xy + s * s * yy, 0.0)


class Sharpnesses:
    """The sharpness of pictures, relative to those from the nearest places."""

    def __init__(self) -> None:
        """Begin without pictures."""
        self._numbers: list[int] = []
        self._sharpness: list[float] = []
        self._cameras: list[Camera] = []

    def add(self, number: int, camera: Camera, sharp: float) -> None:
        """Add a picture."""
        self._numbers.append(number)
        self._sharpness.append(sharp)
        self._cameras.append(camera)

    def remove(self, number: int) -> None:
        """Forget a picture."""
        k = self._numbers.index(number)
        del self._numbers[k], self._sharpness[k], self._cameras[k]

    def of(self, number: int) -> float:
        """Return the sharpness of a picture itself."""
        return self._sharpness[self._numbers.index(number)]

    def worth(self, numbers: Sequence[int]) -> Float64[np.ndarray, "n"]:
        """Return what part of what pictures show counts, 0…1, for their sharpness."""
        row = {number: k for k, number in enumerate(self._numbers)}
        relative = relative_to_nearest(
            self._cameras, np.array(self._sharpness), [row[number] for number in numbers]
        )
        return worth_of_sharpness(relative)


def worth_of_sharpness(relative: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Return what part of what pictures show counts, 0…1, by their relative sharpness."""
    return np.clip((relative - BLURRED) / (SHARP - BLURRED), 0.0, 1.0)


def relative_to_nearest(
    cameras: Sequence[Camera],
    values: Float64[np.ndarray, "n"],
    rows: Sequence[int] | None = None,
) -> Float64[np.ndarray, "rows"]:
    """Return values of pictures over the medians of those of the nearest ones, themselves included.

    Args:
        cameras: Of all pictures.
        values: Of all pictures, > 0.
        rows: Which pictures are asked about; all without it.
    """
    places = np.array(
        [np.concatenate([c.position_m, METRES_PER_RAD * c.forward]) for c in cameras]
    ).reshape(-1, 6)
    asked = np.arange(len(cameras)) if rows is None else np.asarray(rows, dtype=np.int64)
    medians = np.ones(len(asked))
    for start in range(0, len(asked), CHUNK):
        some = places[asked[start : start + CHUNK]]
        away = np.linalg.norm(some[:, None] - places[None], axis=-1)
        nearest = np.argsort(away, axis=1, kind="stable")[:, : LIKE + 1]
        medians[start : start + CHUNK] = np.median(values[nearest], axis=1)
    return values[asked] / np.maximum(medians, 1e-6)
