"""How large an effect a study of a planned size can find."""

# SciPy and statsmodels are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Callable

from statsmodels.stats.power import TTestIndPower, TTestPower

from peaking.study.statistics.intervals import root_between

WANTED = 0.8
"""The usual chance to find an effect that is there."""

WILCOXON_EFFICIENCY = 3 / math.pi
"""Of Wilcoxon's tests beside the t-test for normal numbers: n · 3/π pairs of one serve as n."""


def power_paired_t(d_z: float, *, n: float, alpha: float) -> float:
    """Return the chance that a paired t-test of n pairs is significant (two-sided)."""
    return _both_tails(TTestPower().power, abs(d_z), n, alpha)


def power_two_sample_t(d: float, *, n: float, alpha: float) -> float:
    """Return the chance that a t-test of two groups of n each is significant (two-sided)."""
    return _both_tails(TTestIndPower().power, abs(d), n, alpha)


def smallest_effect(*, n: float, alpha: float, paired: bool, power: float = WANTED) -> float:
    """Return the standardised difference (d_z when paired, d when not) found with this power.

    The root is searched here, for `solve_power` of statsmodels stops at 4e-7 of it.

    Raises:
        ValueError: There are too few participants, or alpha and power leave nothing to find.
    """
    if not (n >= 2 and 0 < alpha < power < 1):
        raise ValueError(f"need n >= 2 and 0 < alpha < power < 1, got {n}, {alpha}, {power}")
    of = power_paired_t if paired else power_two_sample_t
    highest = 1.0
    while of(highest, n=n, alpha=alpha) < power:
        highest *= 2
    return root_between(lambda d: of(d, n=n, alpha=alpha) - power, 0.0, highest)


def _both_tails(power: Callable[..., float], effect: float, n: float, alpha: float) -> float:
    above = power(effect, n, alpha / 2, alternative="larger")
    below = power(effect, n, alpha / 2, alternative="smaller")
    # SciPy gives NaN where nothing is left below; the two-sided power of statsmodels is NaN then.
    return float(above) + (0.0 if math.isnan(below) else float(below))
