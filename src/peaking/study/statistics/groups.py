"""Two conditions done by different people: Welch's t-test and the Mann–Whitney test.

Differences are the first group minus the second.
"""

# SciPy and statsmodels are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from statsmodels.stats.weightstats import CompareMeans, DescrStatsW

from peaking.study.statistics import rank_sums
from peaking.study.statistics.intervals import rank_biserials
from peaking.study.statistics.outcome import (
    CONFIDENCE,
    MIN_SAMPLE,
    NORMAL_QUANTILE,
    Effect,
    Outcome,
    Result,
    Untestable,
)
from peaking.study.statistics.samples import check_finite, rounded


def welch_t(first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]) -> Outcome:
    """Test whether two groups have the same mean, without asking for equal variances.

    Effects: Cohen's d_av and the mean difference.
    """
    name = "Welch's t-test"
    first, second = _together(first, second)
    if (reason := _untestable(first, second)) is not None:
        return Untestable(name, reason)
    if np.ptp(first) == 0 and np.ptp(second) == 0:
        return Untestable(name, "all values in each group are equal: there is no variance")
    compared = CompareMeans(DescrStatsW(first), DescrStatsW(second))
    t, p, df = (float(number) for number in compared.ttest_ind(usevar="unequal"))
    limits = compared.tconfint_diff(1 - CONFIDENCE, usevar="unequal")
    low, high = (float(limit) for limit in limits)
    difference = float(first.mean() - second.mean())
    mean = Effect("mean difference", "M_diff", difference, low, high, "Welch's t")
    effects = (_cohens_d_av(first, second), mean)
    return Result(name, "t", t, (df,), p, len(first) + len(second), effects)


def mann_whitney(first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]) -> Outcome:
    """Test whether a number of the first group tends to be larger. Effect: rank-biserial."""
    name = "Mann–Whitney test"
    first, second = _together(first, second)
    if (reason := _untestable(first, second)) is not None:
        return Untestable(name, reason)
    both = np.concatenate((first, second))
    if np.ptp(both) == 0:
        return Untestable(name, "all values in both groups are equal")
    u = rank_sums.rank_sum(first, second)
    p, how = rank_sums.two_sided_p(first, second)
    n1, n2 = len(first), len(second)
    r = 2 * u / (n1 * n2) - 1
    effects = rank_biserials(
        "rank-biserial correlation",
        r,
        error=rank_sums.null_error(n1, n2),
        score=rank_sums.score_limits(r, n1, n2),
    )
    remarks = [f"p-value: {how}"]
    if len(np.unique(both)) < len(both):
        remarks.append("tied values have their mean rank")
    return Result(name, "U", u, (), p, len(both), effects, tuple(remarks))


def _cohens_d_av(first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]) -> Effect:
    """Return the mean difference over the root of the mean variance, with Bonett's interval."""
    v1, v2 = float(first.var(ddof=1)), float(second.var(ddof=1))
    df1, df2 = len(first) - 1, len(second) - 1
    s2 = (v1 + v2) / 2
    d = float((first.mean() - second.mean()) / np.sqrt(s2))
    variance = d**2 * (v1**2 / df1 + v2**2 / df2) / (8 * s2**2) + (v1 / df1 + v2 / df2) / s2
    half = NORMAL_QUANTILE * float(np.sqrt(variance))
    return Effect("Cohen's d_av", "d_av", d, d - half, d + half, "Bonett 2008, unequal variances")


def _together(
    first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]
) -> tuple[Float64[np.ndarray, "n1"], Float64[np.ndarray, "n2"]]:
    """Round both alike, so that equal numbers are ties."""
    both = np.concatenate((first, second))
    check_finite(both)
    scale = float(np.abs(both).max(initial=0.0))
    return rounded(first, scale=scale), rounded(second, scale=scale)


def _untestable(first: Float64[np.ndarray, "n1"], second: Float64[np.ndarray, "n2"]) -> str | None:
    if min(len(first), len(second)) < MIN_SAMPLE:
        return (
            f"needs {MIN_SAMPLE} participants in each group, there are {len(first)}, {len(second)}"
        )
    return None
