"""Three or more conditions: is there any difference? The pairs come after, corrected by Holm."""

# SciPy and statsmodels are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy import special, stats
from statsmodels.stats.oneway import anova_oneway

from peaking.study.statistics.assumptions import greenhouse_geisser
from peaking.study.statistics.intervals import noncentral_chi2_limits, noncentral_f_limits
from peaking.study.statistics.outcome import MIN_SAMPLE, Effect, Outcome, Result, Untestable
from peaking.study.statistics.samples import check_finite, rounded

Repeated = Float64[np.ndarray, "participants conditions"]


def repeated_anova(values: Repeated, *, spherical: bool) -> Outcome:
    """Test equal means of repeated measures. Effect: partial η².

    Unless they are spherical, the degrees of freedom are multiplied by Greenhouse and Geisser's ε̂.
    """
    name = "repeated-measures ANOVA"
    if (reason := _untestable(values)) is not None:
        return Untestable(name, reason)
    n, k = values.shape
    grand = values.mean()
    of_conditions = n * float(np.sum((values.mean(axis=0) - grand) ** 2))
    left = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + grand
    of_error = float(np.sum(left**2))
    if of_error <= 1e-20 * float(np.sum((values - grand) ** 2)):
        return Untestable(name, "all participants have the same differences: there is no variance")
    factor = 1.0 if spherical else greenhouse_geisser(values)
    df1, df2 = (k - 1) * factor, (k - 1) * (n - 1) * factor
    f = (of_conditions / (k - 1)) / (of_error / ((k - 1) * (n - 1)))
    remarks = () if spherical else (f"degrees of freedom by Greenhouse–Geisser, ε = {factor:.3f}",)
    effect = _eta2("partial η²", f, df1, df2)
    return Result(
        name, "F", f, (df1, df2), float(special.fdtrc(df1, df2, f)), n, (effect,), remarks
    )


def friedman(values: Repeated) -> Outcome:
    """Test equal ranks of repeated measures, ties corrected. Effect: Kendall's W."""
    name = "Friedman test"
    if (reason := _untestable(values)) is not None:
        return Untestable(name, reason)
    n, k = values.shape
    even = rounded(values, scale=float(np.abs(values).max()))
    if (np.ptp(even, axis=1) == 0).all():
        return Untestable(name, "no participant has different values in the conditions")
    chi2, p = stats.friedmanchisquare(*even.T)
    df, most = float(k - 1), float(n * (k - 1))
    w = float(chi2) / most
    low, high = (min(1.0, limit / most) for limit in noncentral_chi2_limits(float(chi2), df))
    effect = Effect("Kendall's W", "W", w, low, high, "noncentral χ²")
    return Result(name, "χ²", float(chi2), (df,), float(p), n, (effect,))


def welch_anova(groups: list[Float64[np.ndarray, "_"]]) -> Outcome:
    """Test equal means of independent groups without equal variances (Welch 1951). Effect: η²."""
    name = "Welch's ANOVA"
    if (reason := _untestable_groups(groups)) is not None:
        return Untestable(name, reason)
    if any(np.ptp(group) == 0 for group in groups):
        return Untestable(name, "all values of one group are equal: its mean has no standard error")
    found = anova_oneway(groups, use_var="unequal")
    f, p = float(found.statistic), float(found.pvalue)
    df1, df2 = (float(df) for df in found.df)
    n = sum(len(group) for group in groups)
    return Result(name, "F", f, (df1, df2), p, n, (_eta2("η²", f, df1, df2),))


def kruskal_wallis(groups: list[Float64[np.ndarray, "_"]]) -> Outcome:
    """Test equal ranks of independent groups, ties corrected. Effect: rank ε² (Kelley 1935)."""
    name = "Kruskal–Wallis test"
    if (reason := _untestable_groups(groups)) is not None:
        return Untestable(name, reason)
    both = np.concatenate(groups)
    scale = float(np.abs(both).max())
    even = [rounded(group, scale=scale) for group in groups]
    if np.ptp(np.concatenate(even)) == 0:
        return Untestable(name, "all values in all groups are equal")
    h, p = stats.kruskal(*even)
    df, most = float(len(groups) - 1), float(len(both) - 1)
    low, high = (min(1.0, limit / most) for limit in noncentral_chi2_limits(float(h), df))
    effect = Effect("rank ε²", "ε²", float(h) / most, low, high, "noncentral χ²")
    return Result(name, "H", float(h), (df,), float(p), len(both), (effect,))


def _eta2(name: str, f: float, df1: float, df2: float) -> Effect:
    """Return the share of variance with limits from the noncentral F (Steiger 2004)."""
    low, high = (ncp / (ncp + df2) for ncp in noncentral_f_limits(f, df1, df2))
    return Effect(name, name, f * df1 / (f * df1 + df2), low, high, "noncentral F, two-sided")


def _untestable(values: Repeated) -> str | None:
    check_finite(values)
    if values.shape[1] < 3:
        raise ValueError(f"need 3 or more conditions, got {values.shape[1]}")
    if len(values) < MIN_SAMPLE:
        return f"needs {MIN_SAMPLE} participants, there are {len(values)}"
    return None


def _untestable_groups(groups: list[Float64[np.ndarray, "_"]]) -> str | None:
    for group in groups:
        check_finite(group)
    if len(groups) < 3:
        raise ValueError(f"need 3 or more groups, got {len(groups)}")
    if min(len(group) for group in groups) < MIN_SAMPLE:
        counts = ", ".join(str(len(group)) for group in groups)
        return f"needs {MIN_SAMPLE} participants in each group, there are {counts}"
    return None
