"""What holds of the study's statistics whatever the numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.study.statistics.decision import Decision, decide_groups, decide_paired
from peaking.study.statistics.holm_correction import holm
from peaking.study.statistics.outcome import Outcome, Result
from peaking.study.statistics.paired import paired_t, wilcoxon
from peaking.study.statistics.rank_sums import score_limits as limits_of_groups
from peaking.study.statistics.signed_rank_test import score_limits

ANSWERS = st.integers(1, 7)
TIMES = st.floats(1.0, 500.0).map(lambda x: round(x, 2))
SHARES = ("partial η²", "η²", "W", "ε²")
EXAMPLES = 40
"""Each makes a whole decision."""


@st.composite
def tables(draw: st.DrawFn, *, most_conditions: int = 4) -> np.ndarray:
    rows, columns = draw(st.integers(0, 12)), draw(st.integers(2, most_conditions))
    kind = draw(st.sampled_from([ANSWERS, TIMES, st.just(3)]))
    cells = draw(st.lists(kind, min_size=rows * columns, max_size=rows * columns))
    return np.array(cells, dtype=np.float64).reshape(rows, columns)


def results_of(decision: Decision) -> list[Result]:
    outcomes: list[Outcome] = [step.outcome for step in decision.steps]
    outcomes += [decision.outcome, decision.other, *(pair.outcome for pair in decision.pairs)]
    return [outcome for outcome in outcomes if isinstance(outcome, Result)]


def check(decision: Decision) -> None:
    assert decision.path()
    for result in results_of(decision):
        assert 0 <= result.p <= 1
        assert math.isfinite(result.statistic)
        for effect in result.effects:
            assert math.isfinite(effect.value)
            if effect.low is not None and effect.high is not None:
                assert effect.low <= effect.high
                # A share of variance is estimated too high; where F or χ² is in the lower 2.5 % of
                # its distribution without an effect, both limits are 0 (as in R's effectsize).
                if effect.symbol not in SHARES or effect.high > 0:
                    assert effect.low - 1e-9 <= effect.value <= effect.high + 1e-9


@settings(max_examples=EXAMPLES, deadline=None)
@given(tables())
def test_any_table_of_repeated_measures_gives_results_or_sentences(values: np.ndarray) -> None:
    names = [f"c{index}" for index in range(values.shape[1])]
    check(decide_paired(values, names, alpha=0.05))


@settings(max_examples=EXAMPLES, deadline=None)
@given(tables())
def test_any_groups_give_results_or_sentences(values: np.ndarray) -> None:
    names = [f"c{index}" for index in range(values.shape[1])]
    check(decide_groups(list(values.T), names, alpha=0.05))


@settings(max_examples=EXAMPLES, deadline=None)
@given(tables(most_conditions=2))
def test_swapping_the_conditions_turns_the_sign_and_keeps_p(values: np.ndarray) -> None:
    first, second = values.T
    for test in (paired_t, wilcoxon):
        there, back = test(first, second), test(second, first)
        assert type(there) is type(back)
        if isinstance(there, Result) and isinstance(back, Result):
            assert there.p == pytest.approx(back.p, rel=1e-9)
            for one, other in zip(there.effects, back.effects, strict=True):
                assert one.value == pytest.approx(-other.value, abs=1e-9)
                if one.low is not None and other.high is not None:
                    assert one.low == pytest.approx(-other.high, rel=1e-6, abs=1e-6)


@settings(max_examples=EXAMPLES, deadline=None)
@given(tables(most_conditions=2), st.sampled_from([0.001, 60.0, 1000.0]))
def test_the_unit_does_not_matter(values: np.ndarray, factor: float) -> None:
    there, scaled = wilcoxon(*values.T), wilcoxon(*(values * factor).T)
    if isinstance(there, Result) and isinstance(scaled, Result):
        assert there.p == scaled.p
        assert there.effects[0] == scaled.effects[0]


@given(st.lists(st.floats(0, 1), max_size=12))
def test_holm_raises_p_and_keeps_their_order(p_values: list[float]) -> None:
    corrected = holm(p_values)
    assert all(c >= p for c, p in zip(corrected, p_values, strict=True))
    assert all(c <= 1 for c in corrected)
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    assert [corrected[i] for i in order] == sorted(corrected)


@given(st.integers(1, 80), st.floats(0, 1))
def test_limits_of_a_rank_biserial_hold_it_and_stay_in_range(m: int, share: float) -> None:
    signed = -1 + 2 * round(share * m * (m + 1) / 2) / (m * (m + 1) / 2)
    of_groups = -1 + 2 * round(share * m * (m + 1)) / (m * (m + 1))
    for r, (low, high) in (
        (signed, score_limits(signed, m)),
        (of_groups, limits_of_groups(of_groups, m, m + 1)),
    ):
        assert -1 <= low <= r + 1e-9
        assert r - 1e-9 <= high <= 1


def test_limits_come_closer_with_more_participants() -> None:
    widths = [np.ptp(score_limits(0.5, m)) for m in (5, 10, 20, 50, 200)]
    assert widths == sorted(widths, reverse=True)
