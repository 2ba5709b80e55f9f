"""Counts of pixels, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

BINS = 2048
"""Of the score, evenly spaced in its root: small errors are many."""

MAX_SCORE = 3.0


class Marks:
    """How a mark agrees with the truth, over pixels of many pictures."""

    def __init__(self) -> None:
        """Begin without a pixel."""
        self.both = self.marked = self.true = self.counted = 0

    def add(
        self,
        marked: Bool[np.ndarray, "h w"],
        true: Bool[np.ndarray, "h w"],
        counted: Bool[np.ndarray, "h w"],
    ) -> None:
        """Count the pixels of a picture that are in `counted`."""
        self.both += int(np.count_nonzero(marked & true & counted))
        self.marked += int(np.count_nonzero(marked & counted))
        self.true += int(np.count_nonzero(true & counted))
        self.counted += int(np.count_nonzero(counted))

    def as_dict(self) -> dict[str, float | None]:
        """Return precision, recall, and the share of pixels that are marked and should be."""
        return {
            "precision": ratio(self.both, self.marked),
            "recall": ratio(self.both, self.true),
            "marked_share": ratio(self.marked, self.counted),
            "true_share": ratio(self.true, self.counted),
        }


class Detection:
    """How a score, and the red that follows from it, tell wrong pixels from right ones."""

    def __init__(self) -> None:
        """Begin without a pixel."""
        self.wrong = np.zeros(BINS, np.int64)
        self.right = np.zeros(BINS, np.int64)
        self.red_wrong = self.red_right = 0

    def add(
        self,
        score: Float32[np.ndarray, "h w"],
        red: Bool[np.ndarray, "h w"],
        wrong: Bool[np.ndarray, "h w"],
        right: Bool[np.ndarray, "h w"],
    ) -> None:
        """Count a picture's pixels; what is neither wrong nor right does not count."""
        self.wrong += _histogram(score[wrong])
        self.right += _histogram(score[right])
        self.red_wrong += int(np.count_nonzero(red & wrong))
        self.red_right += int(np.count_nonzero(red & right))

    def merge(self, other: Detection) -> None:
        """Count what another one counted."""
        self.wrong += other.wrong
        self.right += other.right
        self.red_wrong += other.red_wrong
        self.red_right += other.red_right

    @property
    def auc(self) -> float | None:
        """The chance that a wrong pixel scores higher than a right one; equal ones are a half."""
        wrongs, rights = int(self.wrong.sum()), int(self.right.sum())
        if wrongs == 0 or rights == 0:
            return None
        below = np.cumsum(self.right) - self.right
        return float((self.wrong * (below + 0.5 * self.right)).sum() / wrongs / rights)

    @property
    def recall(self) -> float | None:
        """Red wrong pixels divided by wrong ones."""
        return ratio(self.red_wrong, int(self.wrong.sum()))

    @property
    def precision(self) -> float | None:
        """Red wrong pixels divided by red ones."""
        return ratio(self.red_wrong, self.red_wrong + self.red_right)

    def recall_at(self, precision: float | None) -> float | None:
        """Return the largest recall that any threshold on the score reaches at a precision.

        None where there is nothing wrong, or no precision to reach; 0 where none reaches it.
        """
        wrongs = int(self.wrong.sum())
        if wrongs == 0 or precision is None:
            return None
        hits, falls = np.cumsum(self.wrong[:0:-1]), np.cumsum(self.right[:0:-1])
        good = hits >= precision * (hits + falls)
        return float(hits[good].max(initial=0) / wrongs)


def pearson(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Return the correlation of two samples; None where one is constant or has under 3 values."""
    a, b = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if len(a) < 3 or a.std() == 0 or b.std() == 0:
        return None
    return float(np.corrcoef(a, b)[0, 1])


def ratio(part: int, whole: int) -> float | None:
    """Return a share, or None of nothing."""
    return part / whole if whole > 0 else None


def mean(values: Sequence[float]) -> float | None:
    """Return the mean, or None of nothing."""
    return float(np.mean(values)) if len(values) > 0 else None


def region_means(
    values: Float[np.ndarray, "h w"], counted: Bool[np.ndarray, "h w"], rows: int, columns: int
) -> tuple[Float[np.ndarray, "rows columns"], Float[np.ndarray, "rows columns"]]:
    """Return the mean of each cell of a grid over what counts (0 where nothing does), and shares.

    Returns:
        The means, and which share of each cell counts, 0…1.
    """
    height, width = values.shape
    y, x = (axis.ravel() for axis in np.indices((height, width)))
    cell = y * rows // height * columns + x * columns // width
    flat = counted.ravel()
    sizes = np.bincount(cell, minlength=rows * columns)
    counts = np.bincount(cell[flat], minlength=rows * columns)
    sums = np.bincount(cell[flat], weights=values.ravel()[flat], minlength=rows * columns)
    means = sums / np.maximum(counts, 1)
    return means.reshape(rows, columns), (counts / np.maximum(sizes, 1)).reshape(rows, columns)


def _histogram(scores: Float32[np.ndarray, "n"]) -> Int[np.ndarray, "bins"]:
    """Return how many scores are in each bin; bin 0 holds those that are 0 alone."""
    place = np.sqrt(np.clip(scores, 0, MAX_SCORE) / np.float32(MAX_SCORE)) * (BINS - 2)
    bins = np.where(scores > 0, 1 + place.astype(np.int64), 0)
    return np.bincount(bins, minlength=BINS)
