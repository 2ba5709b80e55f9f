"""Tests of the study's statistics worked by hand, and what is said where nothing can be tested."""

from __future__ import annotations

import numpy as np
import pytest

from peaking.study.statistics.assumptions import levene, mauchly, shapiro_wilk
from peaking.study.statistics.groups import mann_whitney, welch_t
from peaking.study.statistics.holm_correction import holm
from peaking.study.statistics.order_effect_tests import order_effects
from peaking.study.statistics.outcome import Outcome, Result, Untestable
from peaking.study.statistics.paired import paired_t, wilcoxon
from peaking.study.statistics.power import power_paired_t, smallest_effect
from peaking.study.statistics.samples import differences
from peaking.study.statistics.several import friedman, kruskal_wallis, repeated_anova, welch_anova


def numbers(*values: float) -> np.ndarray:
    return np.array(values, dtype=np.float64)


def result(outcome: Outcome) -> Result:
    assert isinstance(outcome, Result), outcome
    return outcome


def reason(outcome: Outcome) -> str:
    assert isinstance(outcome, Untestable), outcome
    return outcome.reason


ZERO = numbers(0, 0, 0, 0, 0)


def test_five_pairs_that_all_rise() -> None:
    ours = result(wilcoxon(numbers(1, 2, 3, 4, 5), ZERO))
    assert ours.statistic == 15  # 1 + 2 + 3 + 4 + 5
    assert ours.p == 2 / 2**5
    fisher, score, hodges_lehmann = ours.effects
    assert fisher.value == score.value == score.high == 1.0
    assert (fisher.low, fisher.high) == (1.0, 1.0)  # a point, in R too
    assert score.low == pytest.approx(0.2, abs=0.01)
    assert hodges_lehmann.low is None  # no 95 % interval of Walsh averages for five pairs


def test_ranks_with_a_tie_and_a_zero() -> None:
    # 0 is dropped; |-1|, |1| share the ranks 1 and 2; 2 and 3 have 3 and 4.
    ours = result(wilcoxon(numbers(0, -1, 1, 2, 3), ZERO))
    assert ours.statistic == 1.5 + 3 + 4
    assert ours.effects[0].value == pytest.approx((8.5 - 1.5) / 10)
    # V >= 8.5 for 3 of the 16 signs: all positive, and either tied one negative.
    assert ours.p == 2 * 3 / 16
    assert "1 of 5 differences are 0 and were dropped" in ours.remarks
    assert "tied differences have their mean rank" in ours.remarks


def test_mean_of_paired_differences() -> None:
    # Differences 1, 2, 3, 4, 5: mean 3, variance 2.5.
    ours = result(paired_t(numbers(2, 4, 6, 8, 10), numbers(1, 2, 3, 4, 5)))
    assert ours.statistic == pytest.approx(3 / (2.5 / 5) ** 0.5)
    assert ours.df == (4.0,)
    d_av, d_z, mean = ours.effects
    assert d_av.value == pytest.approx(3 / ((10 + 2.5) / 2) ** 0.5)
    assert d_z.value == pytest.approx(3 / 2.5**0.5)
    assert mean.value == pytest.approx(3)


def test_pairs_between_groups() -> None:
    # Of 25 pairs the first is larger in 20, and equal in 1.
    first, second = numbers(3, 5, 6, 7, 8), numbers(1, 2, 3, 4, 4.5)
    ours = result(mann_whitney(first, second))
    assert ours.statistic == 2.5 + 5 + 5 + 5 + 5
    assert ours.effects[0].value == pytest.approx(2 * 22.5 / 25 - 1)


def test_holm_worked_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []
    with pytest.raises(ValueError, match="0…1"):
        holm([float("nan")])


def test_a_study_of_twenty_finds_two_thirds_of_a_standard_deviation() -> None:
    smallest = smallest_effect(n=20.0, alpha=0.05, paired=True)
    assert smallest == pytest.approx(0.66, abs=0.005)  # as in Cohen's tables
    assert power_paired_t(smallest, n=20.0, alpha=0.05) == pytest.approx(0.8)
    assert power_paired_t(0.0, n=20.0, alpha=0.05) == pytest.approx(0.05)


def test_five_people_and_a_strict_level_still_have_a_smallest_effect() -> None:
    # statsmodels' own two-sided power is NaN there.
    smallest = smallest_effect(n=5.0, alpha=0.001, paired=True)
    assert power_paired_t(-smallest, n=5.0, alpha=0.001) == pytest.approx(0.8)
    assert power_paired_t(50.0, n=5.0, alpha=0.001) == pytest.approx(1.0)


def test_a_learning_effect_is_a_period_effect() -> None:
    # Everybody gains 10 in the second trial; conditions do not differ.
    noise = numbers(0, 1, -1, 2, 0, 1, -2, 1, 0, -1)
    places = np.array([[0, 1], [1, 0]] * 5)
    values = 50 + 10.0 * places + np.stack((noise, np.zeros(10)), axis=1)
    found = order_effects(values, places)
    assert result(found.period).p < 0.001
    assert result(found.carry_over).p > 0.05


def test_rounding_does_not_untie() -> None:
    away = differences(numbers(0.3, 0.2, 1.1), numbers(0.1, 0.0, 1.1))
    assert away[0] == away[1]
    assert away[2] == 0


FEW = numbers(1, 2, 3, 4)
SAME = numbers(7, 7, 7, 7, 7)
ROWS = np.tile(numbers(1, 2, 3), (6, 1))


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        (paired_t(FEW, FEW + 1), "needs 5 pairs, there are 4"),
        (wilcoxon(FEW, FEW + 1), "needs 5 pairs, there are 4"),
        (wilcoxon(numbers(), numbers()), "needs 5 pairs, there are 0"),
        (paired_t(SAME, SAME), "all differences are 0"),
        (wilcoxon(SAME, SAME), "all differences are 0"),
        (paired_t(SAME, SAME - 2), "all differences are 2"),
        (shapiro_wilk(SAME), "all values are 7"),
        (shapiro_wilk(FEW[:2]), "needs 3 values, there are 2"),
        (levene([SAME, SAME + 1]), "all distances from the medians are equal"),
        (welch_t(FEW, SAME), "needs 5 participants in each group, there are 4, 5"),
        (welch_t(SAME, SAME + 1), "no variance"),
        (mann_whitney(SAME, SAME), "all values in both groups are equal"),
        (mauchly(ROWS[:3]), "needs more than 3 participants, there are 3"),
        (mauchly(ROWS), "the same for all participants"),
        (repeated_anova(ROWS, spherical=True), "all participants have the same differences"),
        (friedman(np.ones((6, 3))), "no participant has different values"),
        (friedman(np.ones((4, 3))), "needs 5 participants, there are 4"),
        (welch_anova([SAME, SAME, SAME]), "all values of one group are equal"),
        (kruskal_wallis([SAME, SAME, SAME]), "all values in all groups are equal"),
        (kruskal_wallis([SAME, FEW, SAME]), "there are 5, 4, 5"),
    ],
)
def test_what_cannot_be_tested_is_a_sentence(outcome: Outcome, said: str) -> None:
    assert said in reason(outcome)


def test_a_constant_shift_still_has_ranks() -> None:
    ours = result(wilcoxon(SAME, SAME - 2))
    assert ours.effects[0].value == 1.0


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_missing_numbers_are_refused_not_dropped(bad: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        paired_t(numbers(1, 2, 3, 4, bad), ZERO)
    with pytest.raises(ValueError, match="finite"):
        mann_whitney(numbers(1, 2, 3, 4, bad), ZERO)
