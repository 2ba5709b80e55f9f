"""What is asked of the data before a test is chosen: normality, equal variances, sphericity."""

# SciPy is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy import stats

from peaking.study.statistics.outcome import Outcome, Result, Untestable
from peaking.study.statistics.samples import number

MAX_SHAPIRO = 5000
"""Numbers for which the approximation of the p-value was made (Royston 1995)."""


def shapiro_wilk(numbers: Float64[np.ndarray, "n"], what: str = "values") -> Outcome:
    """Test whether numbers are from a normal distribution (Shapiro, Wilk 1965; Royston 1995)."""
    name = "Shapiro–Wilk test"
    if len(numbers) < 3:
        return Untestable(name, f"needs 3 {what}, there are {len(numbers)}")
    if np.ptp(numbers) == 0:
        return Untestable(name, f"all {what} are {number(numbers[0])}: there is no variance")
    if len(numbers) > MAX_SHAPIRO:
        return Untestable(name, f"its p-value is defined for at most {MAX_SHAPIRO} {what}")
    # Centred and scaled, for SciPy loses digits on numbers that are large beside their spread.
    scaled = (numbers - np.mean(numbers)) / np.ptp(numbers)
    w, p = stats.shapiro(scaled)
    return Result(name, "W", float(w), (), float(p), len(numbers))


def levene(samples: list[Float64[np.ndarray, "_"]]) -> Outcome:
    """Test whether samples have equal variances: Levene's test about the medians.

    The form of Brown and Forsythe (1974), which is the default of R's `car::leveneTest` too. It
    takes the samples for independent; of paired data its p-value is only approximate.
    """
    name = "Levene's test (about the medians)"
    away = [np.abs(sample - np.median(sample)) for sample in samples]
    if any(len(sample) < 2 for sample in samples):
        return Untestable(name, "needs 2 values in each condition")
    if all(np.ptp(distances) == 0 for distances in away):
        return Untestable(name, "all distances from the medians are equal")
    f, p = stats.levene(*samples, center="median")
    count = sum(len(sample) for sample in samples)
    df = (float(len(samples) - 1), float(count - len(samples)))
    return Result(name, "F", float(f), df, float(p), count)


def mauchly(values: Float64[np.ndarray, "participants conditions"]) -> Outcome:
    """Test sphericity of three or more repeated measures (Mauchly 1940).

    The p-value has the second term of Box's expansion (Anderson, *An introduction to multivariate
    statistical analysis*, section 10.7.4), with the constant of R. The published formula has
    2m³ + 6m² + 3m + 2 in it, m being the number of contrasts; `mauchly.test` of R 4.2 has 3k for
    3m there, k being the number of conditions. The p-value is R's: what a reader checks it against.
    Up to three conditions the term is 0; above, the two differ by about 0.1 % of the p-value.
    """
    name = "Mauchly's test"
    n, k = values.shape
    m = k - 1
    if n <= m + 1:
        return Untestable(name, f"needs more than {m + 1} participants, there are {n}")
    contrasts = _orthonormal_covariance(values)
    spread = float(np.trace(contrasts)) / m
    # Rounding leaves something of about 1e-16 of the spread where a contrast is constant.
    if spread == 0 or np.linalg.eigvalsh(contrasts)[0] < 1e-12 * spread:
        return Untestable(name, "a difference between conditions is the same for all participants")
    w = float(np.exp(np.linalg.slogdet(contrasts)[1] - m * np.log(spread)))
    f, df = n - 1, m * (m + 1) / 2 - 1
    rho = 1 - (2 * m**2 + m + 2) / (6 * m * f)
    second = (m + 2) * (m - 1) * (m - 2) * (2 * m**3 + 6 * m**2 + 3 * k + 2)
    second /= 288 * (f * m * rho) ** 2
    chi2 = -f * rho * np.log(w)
    p1, p2 = stats.chi2.sf(chi2, df), stats.chi2.sf(chi2, df + 4)
    p = min(1.0, max(0.0, float(p1 + second * (p2 - p1))))
    return Result(name, "W", w, (), p, n)


def greenhouse_geisser(values: Float64[np.ndarray, "participants conditions"]) -> float:
    """Return ε̂, the factor for the degrees of freedom: 1 / (conditions - 1) up to 1 (spherical).

    Greenhouse and Geisser, *On methods in the analysis of profile data*, 1959.
    """
    contrasts = _orthonormal_covariance(values)
    m = contrasts.shape[0]
    return float(np.trace(contrasts) ** 2 / (m * np.sum(contrasts**2)))


def _orthonormal_covariance(
    values: Float64[np.ndarray, "participants conditions"],
) -> Float64[np.ndarray, "m m"]:
    """Return the covariance of orthonormal contrasts of the conditions."""
    k = values.shape[1]
    helmert = np.zeros((k - 1, k))
    for row in range(k - 1):
        helmert[row, : row + 1] = 1.0
        helmert[row, row + 1] = -(row + 1)
    helmert /= np.linalg.norm(helmert, axis=1, keepdims=True)
    return helmert @ np.cov(values, rowvar=False) @ helmert.T
