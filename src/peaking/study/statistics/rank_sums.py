"""Ranks of two independent samples: the exact p-value with ties, the interval of the rank-biserial.

The p-value is exact, conditional on the ranks; R's `wilcox.test` is exact without ties only, and
`exactRankTests::wilcox.exact` agrees with ours in both cases.
"""

# SciPy is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64
from scipy import special, stats

from peaking.study.statistics.intervals import root_between
from peaking.study.statistics.outcome import NORMAL_QUANTILE
from peaking.study.statistics.signed_rank_test import FARTHEST

MIN_APPROXIMATE = 50
"""Numbers in one sample from which on the p-value is R's normal approximation."""


def rank_sum(first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]) -> float:
    """Return U (R's W): the pairs in which the first is larger, ties counted half."""
    ranks = stats.rankdata(np.concatenate((first, second)))
    n1 = len(first)
    return float(ranks[:n1].sum() - n1 * (n1 + 1) / 2)


def two_sided_p(
    first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]
) -> tuple[float, str]:
    """Return the p-value of U, and how it was computed.

    Exact: the chance of a U that is as far from its expectation, on either side.
    """
    n1, n2 = len(first), len(second)
    u = rank_sum(first, second)
    ranks = stats.rankdata(np.concatenate((first, second)))
    if n1 < MIN_APPROXIMATE and n2 < MIN_APPROXIMATE:
        chance = _distribution(ranks, n1)
        doubled_u = np.arange(len(chance)) - n1 * (n1 + 1)
        as_far = np.abs(doubled_u - n1 * n2) >= abs(round(2 * u) - n1 * n2)
        return min(1.0, float(chance[as_far].sum())), "exact"
    n = n1 + n2
    _, counts = np.unique(ranks, return_counts=True)
    ties = float(np.sum(counts**3 - counts)) / (n * (n - 1))
    away = u - n1 * n2 / 2
    z = (away - 0.5 * np.sign(away)) / np.sqrt(n1 * n2 / 12 * (n + 1 - ties))
    return 2 * float(special.ndtr(-abs(z))), "normal approximation with continuity correction"


def _distribution(ranks: Float64[np.ndarray, "n"], size: int) -> Float64[np.ndarray, "sums"]:
    """Return the chance of every value of twice the rank sum of `size` ranks drawn from all."""
    doubled = np.round(2 * ranks).astype(int)
    ways = np.zeros((size + 1, int(np.sort(doubled)[-size:].sum()) + 1))
    ways[0, 0] = 1.0
    for step in doubled:
        for drawn in range(size, 0, -1):
            ways[drawn, step:] += ways[drawn - 1, :-step]
    return ways[size] / special.comb(len(ranks), size)


def null_error(n1: int, n2: int) -> float:
    """Return the standard deviation of the rank-biserial of two samples without an effect."""
    return math.sqrt((n1 + n2 + 1) / (3 * n1 * n2))


def score_limits(r: float, n1: int, n2: int) -> tuple[float, float]:
    """Return the 95 % limits of the rank-biserial of two samples (score interval).

    It has the variance that U has when both are normal and one is shifted, the
    normal case of Newcombe's *Confidence intervals for an effect size measure based on the
    Mann–Whitney statistic*, part 2, 2006 (method 5).
    """

    def off(shift: float, sign: int) -> float:
        below = -abs(shift)
        p = float(special.ndtr(below))  # first > second
        both = p - 2 * float(special.owens_t(below, 1 / np.sqrt(3)))  # and another second too
        variance = p * (1 - p) + (n1 + n2 - 2) * (both - p**2)
        deviation = 2 * np.sqrt(max(variance, 0.0) / (n1 * n2))
        expected = 2 * p - 1 if shift < 0 else 1 - 2 * p
        return float(r - expected - sign * NORMAL_QUANTILE * deviation)

    def population(sign: int) -> float:
        farthest = np.sqrt(2) * FARTHEST
        shift = root_between(lambda value: off(value, sign), -farthest, farthest)
        return 2 * float(special.ndtr(shift)) - 1

    return (-1.0 if r <= -1 else population(1)), (1.0 if r >= 1 else population(-1))
