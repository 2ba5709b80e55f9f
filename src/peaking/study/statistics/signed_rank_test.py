"""Wilcoxon's signed ranks: the exact p-value with ties, and the interval of the rank-biserial.

Differences of 0 are dropped (Wilcoxon 1945), tied ones get their mean rank. The p-value is exact,
conditional on the ranks, with or without ties; R's `wilcox.test` is exact without ties only, and
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

MAX_EXACT = 50
"""Differences up to which the p-value is exact; above, it is the normal approximation of R."""

FARTHEST = 6.0
"""Standard deviations that a shift is searched in; the rank-biserial is 1 - 1e-16 there."""


def signed_ranks(differences: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "m"]:
    """Return the mean ranks of the absolute differences that are not 0, with their signs."""
    kept = differences[differences != 0]
    return stats.rankdata(np.abs(kept)) * np.sign(kept)


def two_sided_p(ranks: Float64[np.ndarray, "m"]) -> tuple[float, str]:
    """Return the p-value of V, the sum of the positive ranks, and how it was computed.

    Twice the smaller tail, at most 1. For more than `MAX_EXACT` ranks: normal approximation with
    the variance for ties and a continuity correction of 0.5, as R's `wilcox.test`.
    """
    v = float(ranks[ranks > 0].sum())
    sizes = np.abs(ranks)
    if len(ranks) <= MAX_EXACT:
        chance = _distribution(sizes)
        at = round(2 * v)
        tail = min(chance[: at + 1].sum(), chance[at:].sum())
        return min(1.0, 2 * float(tail)), "exact"
    away = v - sizes.sum() / 2
    z = (away - 0.5 * np.sign(away)) / np.sqrt(np.sum(sizes**2) / 4)
    return 2 * float(special.ndtr(-abs(z))), "normal approximation with continuity correction"


def _distribution(sizes: Float64[np.ndarray, "m"]) -> Float64[np.ndarray, "sums"]:
    """Return the chance of every value of 2 V when all signs are equally likely."""
    doubled = np.round(2 * sizes).astype(int)
    chance = np.zeros(int(doubled.sum()) + 1)
    chance[0] = 1.0
    for step in doubled:
        chance[step:] = (chance[step:] + chance[:-step]) / 2
        chance[:step] /= 2
    return chance


def lower_quantile(n: int, tail: float) -> int:
    """Return the smallest v with P(V ≤ v) ≥ `tail` for n differences without ties; at least 1.

    R's `qsignrank`. Up to `MAX_EXACT` exact, above it by the normal approximation.
    """
    if n > MAX_EXACT:
        most = n * (n + 1) / 2
        deviation = np.sqrt(most * (2 * n + 1) / 12)
        return max(1, int(np.ceil(most / 2 + special.ndtri(tail) * deviation)))
    below = np.cumsum(_distribution(np.arange(1.0, n + 1))[::2])
    return max(1, int(np.argmax(below >= tail)))


def rank_biserial(ranks: Float64[np.ndarray, "m"]) -> float:
    """Return (positive - negative) / all of the rank sums, -1…1.

    Kerby, *The simple difference formula*, 2014.
    """
    return float(ranks.sum() / np.abs(ranks).sum())


def null_error(m: int) -> float:
    """Return the standard deviation of the rank-biserial of `m` differences without an effect."""
    return math.sqrt(2 * (2 * m + 1) / (3 * m * (m + 1)))


def score_limits(r: float, m: int) -> tuple[float, float]:
    """Return the 95 % limits of a matched-pairs rank-biserial of `m` differences (score interval).

    The test of a shift is turned round: the limits are the population values for which r lies 1.96
    standard deviations from its expectation, where expectation and variance of V are those of
    normal differences with that shift (Hettmansperger, *Statistical inference based on ranks*,
    1984, section 2.5). As the variance shrinks towards ±1, the interval stays inside the
    range and keeps its coverage there, which Fisher's z with the variance of the null hypothesis
    (R's `effectsize`) does not; docs/study-statistics.md has both, measured.
    """

    def off(shift: float, sign: int) -> float:
        expected, deviation = _moments(shift, m)
        return r - expected - sign * NORMAL_QUANTILE * deviation

    def population(sign: int) -> float:
        shift = root_between(lambda value: off(value, sign), -FARTHEST, FARTHEST)
        return 2 * float(special.ndtr(np.sqrt(2) * shift)) - 1

    return (-1.0 if r <= -1 else population(1)), (1.0 if r >= 1 else population(-1))


def _moments(shift: float, m: int) -> tuple[float, float]:
    """Return expectation and standard deviation of r for m normal differences, mean `shift`, SD 1.

    Computed for the sum of the smaller side, whose chances are small and keep their digits.
    """
    below = -abs(shift)
    p1 = float(special.ndtr(below))  # D > 0
    p2 = float(special.ndtr(np.sqrt(2) * below))  # D1 + D2 > 0
    p3 = p2 - 2 * float(special.owens_t(np.sqrt(2) * below, 1 / np.sqrt(3)))  # and D1 + D3 > 0
    pairs, most = m * (m - 1) / 2, m * (m + 1) / 2
    expected = m * p1 + pairs * p2
    variance = (
        m * p1 * (1 - p1)
        + pairs * (p1**2 - 4 * p1 * p2 + 3 * p2 - 2 * p2**2)
        + 2 * pairs * (m - 2) * (p3 - p2**2)
    )
    r = 2 * expected / most - 1
    return (r if shift < 0 else -r), 2 * float(np.sqrt(max(variance, 0.0))) / most
