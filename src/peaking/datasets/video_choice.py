"""Which pictures of a video are worth having: sharp ones, each seen from a little farther on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

LEAST_SHIFT = 0.02
"""What is shown moves by so much of the longer side from one to the next."""
WINDOW = 1.5
"""Of the pictures up to so many times that shift, the sharpest is taken."""
LEAST_TRACKED = 0.4
"""Where fewer of the corners are found again, what is shown is new."""
_SIDE_PX, _CORNERS = 640, 300


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture of a video.

    Attributes:
        index: Its place in the video.
        time_s: When it is shown.
        rgb: Upright.
    """

    index: int
    time_s: float
    rgb: UInt8[np.ndarray, "h w 3"]


class Chooser:
    """Chooses as pictures come; what is asked for may grow on the way."""

    def __init__(self) -> None:
        """Begin with the least shift."""
        self.coarser = 1.0
        """Factor of the shift."""

    def chosen(self, pictures: Iterable[Shown]) -> Iterator[Shown]:
        """Yield the pictures that are worth having, the first always."""
        last: UInt8[np.ndarray, "h w"] | None = None
        corners = np.zeros((0, 1, 2), np.float32)
        best: tuple[float, Shown, UInt8[np.ndarray, "h w"]] | None = None
        for shown in pictures:
            gray = _small(shown.rgb)
            if last is None:
                yield shown
                last, corners = gray, _corners(gray)
                continue
            gate = LEAST_SHIFT * max(gray.shape) * self.coarser
            shift = _shift(last, gray, corners)
            if best is not None and shift > WINDOW * gate:
                yield best[1]
                last, corners, best = best[2], _corners(best[2]), None
                shift = _shift(last, gray, corners)
            if shift > WINDOW * gate:
                yield shown
                last, corners = gray, _corners(gray)
            elif shift >= gate:
                sharp = float(np.asarray(cv2.Laplacian(gray, cv2.CV_32F)).var())
                if best is None or sharp > best[0]:
                    best = sharp, shown, gray
        if best is not None:
            yield best[1]


def _small(rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w"]:
    gray = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)
    scale = _SIDE_PX / max(gray.shape)
    if scale >= 1:
        return gray
    size = max(1, round(gray.shape[1] * scale)), max(1, round(gray.shape[0] * scale))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), np.uint8)


def _corners(gray: UInt8[np.ndarray, "h w"]) -> np.ndarray:
    found = np.asarray(cv2.goodFeaturesToTrack(gray, _CORNERS, 0.01, 6), np.float32)
    return found if found.ndim == 3 else np.zeros((0, 1, 2), np.float32)  # it found none


def _shift(
    last: UInt8[np.ndarray, "h w"], gray: UInt8[np.ndarray, "h w"], corners: np.ndarray
) -> float:
    """Return the median shift of corners (Lucas-Kanade), inf where too few are found again."""
    if not len(corners) or last.shape != gray.shape:
        return 0.0 if last.shape == gray.shape else float("inf")
    none = np.zeros_like(corners)
    moved, status, _ = cv2.calcOpticalFlowPyrLK(last, gray, corners, none)
    found = np.asarray(status).ravel() == 1
    if found.mean() < LEAST_TRACKED:
        return float("inf")
    return float(np.median(np.linalg.norm((np.asarray(moved) - corners)[found, 0], axis=1)))
