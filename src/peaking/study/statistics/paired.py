"""Two conditions done by the same people: paired t-test and Wilcoxon's signed-rank test.

Differences are the first condition minus the second, so a positive effect says that the first has
the larger numbers, as in R's `t.test(first, second, paired = TRUE)`.
"""

# SciPy and statsmodels are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from statsmodels.stats.weightstats import DescrStatsW

from peaking.study.statistics import signed_rank_test
from peaking.study.statistics.intervals import TAIL, noncentral_t_limits, rank_biserials
from peaking.study.statistics.outcome import (
    CONFIDENCE,
    MIN_SAMPLE,
    NORMAL_QUANTILE,
    Effect,
    Outcome,
    Result,
    Untestable,
)
from peaking.study.statistics.samples import differences, number

MIN_WALSH = 6
"""Pairs from which on order statistics of Walsh averages give a 95 % interval."""


def paired_t(first: Float64[np.ndarray, "n"], second: Float64[np.ndarray, "n"]) -> Outcome:
    """Test whether the mean difference is 0.

    Effects: Cohen's d_av (the paper's), d_z, and the mean difference.
    """
    name = "paired t-test"
    away = differences(first, second)
    if (reason := _untestable(away)) is not None:
        return Untestable(name, reason)
    if np.ptp(away) == 0:
        return Untestable(name, f"all differences are {number(away[0])}: there is no variance")
    n, described = len(away), DescrStatsW(away)
    t, p, df = (float(number) for number in described.ttest_mean())
    low, high = (float(limit) for limit in described.tconfint_mean(1 - CONFIDENCE))
    mean = Effect("mean difference", "M_diff", float(away.mean()), low, high, "Student's t")
    effects = (cohens_d_av(first, second), _cohens_d_z(t, n), mean)
    return Result(name, "t", t, (df,), p, n, effects)


def wilcoxon(first: Float64[np.ndarray, "n"], second: Float64[np.ndarray, "n"]) -> Outcome:
    """Test whether differences are symmetric about 0.

    Effects: the matched-pairs rank-biserial correlation, and the Hodges–Lehmann estimate.
    """
    name = "Wilcoxon signed-rank test"
    away = differences(first, second)
    if (reason := _untestable(away)) is not None:
        return Untestable(name, reason)
    ranks = signed_rank_test.signed_ranks(away)
    m = len(ranks)
    p, how = signed_rank_test.two_sided_p(ranks)
    remarks = [f"p-value: {how}"]
    if m < len(away):
        remarks.append(f"{len(away) - m} of {len(away)} differences are 0 and were dropped")
    if len(np.unique(np.abs(ranks))) < m:
        remarks.append("tied differences have their mean rank")
    if 2.0 ** (1 - m) > 1 - 0.95:
        remarks.append(f"with {m} nonzero differences, p cannot be below {2.0 ** (1 - m):g}")
    r = signed_rank_test.rank_biserial(ranks)
    both = rank_biserials(
        "matched-pairs rank-biserial correlation",
        r,
        error=signed_rank_test.null_error(m),
        score=signed_rank_test.score_limits(r, m),
    )
    v = float(ranks[ranks > 0].sum())
    effects = (*both, _hodges_lehmann(away))
    return Result(name, "V", v, (), p, len(away), effects, tuple(remarks))


def cohens_d_av(first: Float64[np.ndarray, "n"], second: Float64[np.ndarray, "n"]) -> Effect:
    """Return the mean difference over the root of the mean variance of the two conditions.

    The d of the paper: its means and standard deviations give its printed values. The interval is
    Bonett's for paired data with unequal variances.
    """
    n = len(first)
    v1, v2 = float(first.var(ddof=1)), float(second.var(ddof=1))
    covariance = float(np.cov(first, second)[0, 1])
    s2 = (v1 + v2) / 2
    d = float(first.mean() - second.mean()) / np.sqrt(s2)
    of_scale = d**2 * (v1**2 + v2**2 + 2 * covariance**2) / (8 * s2**2 * (n - 1))
    of_mean = (v1 + v2 - 2 * covariance) / (s2 * (n - 1))
    half = NORMAL_QUANTILE * float(np.sqrt(of_scale + of_mean))
    method = "Bonett 2008, paired, unequal variances"
    return Effect("Cohen's d_av", "d_av", float(d), float(d - half), float(d + half), method)


def _cohens_d_z(t: float, n: int) -> Effect:
    low, high = noncentral_t_limits(t, float(n - 1))
    root = float(np.sqrt(n))
    return Effect("Cohen's d_z", "d_z", t / root, low / root, high / root, "noncentral t, exact")


def _hodges_lehmann(away: Float64[np.ndarray, "n"]) -> Effect:
    """Return the median of all Walsh averages, with their order statistics as limits.

    Hollander and Wolfe, *Nonparametric statistical methods*, section 3.3. Differences of 0 stay in,
    for they say that the shift is small; with ties the interval is conservative.
    """
    name, n = "Hodges–Lehmann median difference", len(away)
    rows, columns = np.triu_indices(n)
    walsh = np.sort((away[rows] + away[columns]) / 2)
    middle = float(np.median(walsh))
    if n < MIN_WALSH:
        reason = f"no 95 % interval exists for fewer than {MIN_WALSH} pairs"
        return Effect(name, "HL", middle, None, None, reason)
    outside = signed_rank_test.lower_quantile(n, TAIL)
    low, high = float(walsh[outside - 1]), float(walsh[len(walsh) - outside])
    return Effect(name, "HL", middle, low, high, "order statistics of Walsh averages")


def _untestable(away: Float64[np.ndarray, "n"]) -> str | None:
    if len(away) < MIN_SAMPLE:
        return f"needs {MIN_SAMPLE} pairs, there are {len(away)}"
    if not away.any():
        return "all differences are 0"
    return None
