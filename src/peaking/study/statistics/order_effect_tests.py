"""Did the order of the conditions matter: learning, fatigue, what one condition leaves behind?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int

from peaking.study.statistics.groups import welch_t
from peaking.study.statistics.outcome import Outcome, Untestable
from peaking.study.statistics.several import friedman


@dataclass(frozen=True)
class OrderEffects:
    """Two tests; a small p-value of either puts the comparison of the conditions in doubt."""

    period: Outcome
    """Are later trials different from earlier ones, whatever the condition?"""
    carry_over: Outcome
    """Do those who began with the first condition differ, over both, from the others?"""


def order_effects(
    values: Float64[np.ndarray, "participants conditions"],
    places: Int[np.ndarray, "participants conditions"],
) -> OrderEffects:
    """Test for effects of the order in which the conditions were done.

    Two conditions: the crossover tests of Hills and Armitage (*The two-period cross-over clinical
    trial*, 1979), with Welch's t: the differences first minus second of those who did AB against
    those who did BA (period), and their sums (carry-over). Three or more: Friedman's test over the
    places, on the values less the mean of their condition; carry-over is not told apart there.

    Args:
        values: One row per participant, nothing missing.
        places: 0 for the condition that a participant did first, 1 for the second …
    """
    if values.shape[1] == 2:
        began = places[:, 0] < places[:, 1]
        away, sums = values[:, 0] - values[:, 1], values[:, 0] + values[:, 1]
        return OrderEffects(
            period=_compared("period effect", away, began),
            carry_over=_compared("carry-over", sums, began),
        )
    by_place = np.take_along_axis(
        values - values.mean(axis=0), np.argsort(places, axis=1, kind="stable"), axis=1
    )
    period = friedman(by_place)
    none = Untestable("carry-over", "can be tested for two conditions only")
    return OrderEffects(replace(period, test="Friedman test over positions"), none)


def _compared(what: str, numbers: Float64[np.ndarray, "n"], began: np.ndarray) -> Outcome:
    outcome = welch_t(numbers[began], numbers[~began])
    return replace(outcome, test=f"{what} ({outcome.test})")
