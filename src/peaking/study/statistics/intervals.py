"""Confidence limits of correlations, and of non-centrality parameters by turning a test round.

The limits of the latter are the parameters for which the observed statistic lies at the upper and
the lower 2.5 % of its distribution (Steiger and Fouladi, *Noncentrality interval estimation*,
1997).
"""

# SciPy is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from scipy import special
from scipy.optimize import brentq

from peaking.study.statistics.outcome import CONFIDENCE, FISHER, NORMAL_QUANTILE, SCORE, Effect

TAIL = (1 - CONFIDENCE) / 2
PRECISION = 1e-12
"""Of the limits."""


Limits = tuple[float, float]


def rank_biserials(name: str, r: float, *, error: float, score: Limits) -> tuple[Effect, Effect]:
    """Return a rank-biserial with the interval of Fisher's z, and with the score interval.

    Args:
        name: In words.
        r: The correlation, -1…1.
        error: Its standard deviation when there is no effect, taken for that of artanh r. At r = ±1
            the interval of Fisher's z is a point, as in R.
        score: The limits of the score interval.
    """
    z = math.atanh(r) if abs(r) < 1 else math.copysign(math.inf, r)
    low, high = (math.tanh(z + sign * NORMAL_QUANTILE * error) for sign in (-1, 1))
    return Effect(name, "r_rb", r, low, high, FISHER), Effect(name, "r_rb", r, *score, SCORE)


def noncentral_t_limits(t: float, df: float) -> Limits:
    """Return the limits of the non-centrality of a t statistic."""
    if t < 0:
        low, high = noncentral_t_limits(-t, df)
        return -high, -low

    def below(ncp: float) -> float:
        share = float(special.nctdtr(df, ncp, t))
        # SciPy gives NaN where a negative ncp leaves nothing above t.
        return 1.0 if math.isnan(share) else share

    return _solve(below, 1 - TAIL, -5.0), _solve(below, TAIL, -5.0)


def noncentral_f_limits(f: float, df1: float, df2: float) -> Limits:
    """Return the limits of the non-centrality of an F statistic; 0 where there is none above it."""

    def below(ncp: float) -> float:
        return float(special.ncfdtr(df1, df2, ncp, f)) if ncp else float(special.fdtr(df1, df2, f))

    return _solve(below, 1 - TAIL, 0.0), _solve(below, TAIL, 0.0)


def noncentral_chi2_limits(chi2: float, df: float) -> Limits:
    """Return the limits of the non-centrality of a χ² statistic; 0 where there is none above it."""

    def below(ncp: float) -> float:
        return float(special.chndtr(chi2, df, ncp)) if ncp else float(special.chdtr(df, chi2))

    return _solve(below, 1 - TAIL, 0.0), _solve(below, TAIL, 0.0)


def _solve(below: Callable[[float], float], share: float, lowest: float) -> float:
    """Return where the falling function is `share`; `lowest` if it is below from there on."""
    if below(lowest) <= share:
        return lowest
    highest = lowest + 1.0
    while below(highest) > share:
        highest = lowest + 2 * (highest - lowest)
    return root_between(lambda ncp: below(ncp) - share, lowest, highest)


def root_between(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a root of a function that has different signs at both ends (Brent's method)."""
    root: Any = brentq(function, low, high, xtol=PRECISION)
    return float(root)
