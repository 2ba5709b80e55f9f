"""Which test: the paper's decision, with every step kept so that it can be printed.

"We performed sphericity, normality, and homogeneity of variance tests on our collected data. We
used the T-test only when all the preliminary tests were satisfied, and otherwise, we used Wilcoxon
signed-rank tests" (section 4.1). A preliminary test is satisfied when its p-value is not below
alpha. One that cannot be made is not satisfied. The test that was not chosen is made too, and shown
beside the other, so that a reader sees what hangs on the choice.

==============  ==========================  ===========================================
conditions      all satisfied               otherwise
==============  ==========================  ===========================================
2, same people  paired t-test, d_av         Wilcoxon signed-rank, rank-biserial
2, groups       Welch's t-test, d_av        Mann–Whitney, rank-biserial
≥ 3, same       repeated-measures ANOVA     Friedman; the pairs as above, Holm-corrected
≥ 3, groups     Welch's ANOVA               Kruskal–Wallis; the pairs as above, Holm-corrected
==============  ==========================  ===========================================

Sphericity does not choose between ANOVA and Friedman: where Mauchly's test rejects it (or cannot be
made), the degrees of freedom are corrected by Greenhouse and Geisser's ε. Welch's tests do not ask
for equal variances, so between groups Levene's test is shown and does not decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from jaxtyping import Float64

from peaking.study.statistics.assumptions import levene, mauchly, shapiro_wilk
from peaking.study.statistics.groups import mann_whitney, welch_t
from peaking.study.statistics.holm_correction import holm
from peaking.study.statistics.outcome import MIN_SAMPLE, Outcome, Result, Untestable
from peaking.study.statistics.paired import paired_t, wilcoxon
from peaking.study.statistics.samples import differences
from peaking.study.statistics.several import (
    friedman,
    kruskal_wallis,
    repeated_anova,
    welch_anova,
)

Answer = Literal["yes", "no", "undecidable"]


@dataclass(frozen=True)
class DecisionStep:
    """A question about the data, its answer, and the test that gave it."""

    question: str
    answer: Answer
    outcome: Outcome
    decides: bool = True
    """Whether the choice of the test hangs on it."""


@dataclass(frozen=True)
class Pair:
    """Two of three or more conditions, compared after the test of all."""

    first: str
    second: str
    outcome: Outcome
    p_holm: float | None
    """Corrected within the pairs of this measure; none when there is no result."""


@dataclass(frozen=True)
class Decision:
    """How a measure was tested, and what came out."""

    steps: tuple[DecisionStep, ...]
    parametric: bool
    outcome: Outcome
    """Of the chosen test."""
    other: Outcome
    """Of the test that was not chosen."""
    pairs: tuple[Pair, ...] = ()

    def path(self) -> list[str]:
        """Return the decision in sentences, one a step, the last one being the choice."""
        said = [f"{step.question} {_answer(step)}" for step in self.steps]
        satisfied = "all are satisfied" if self.parametric else "not all are satisfied"
        if isinstance(self.outcome, Untestable):
            return [*said, f"No test: {self.outcome.reason}."]
        return [*said, f"Of the deciding tests, {satisfied}: {self.outcome.test}."]


def decide_paired(
    values: Float64[np.ndarray, "participants conditions"],
    names: Sequence[str],
    *,
    alpha: float,
) -> Decision:
    """Test conditions that the same people did.

    Args:
        values: One row per participant, nothing missing.
        names: The conditions, in the order of the columns. Differences are first minus second.
        alpha: Level of the preliminary tests, 0…1.

    Raises:
        ValueError: Shapes do not fit, or a value is missing.
    """
    if values.ndim != 2 or values.shape[1] != len(names) or len(names) < 2:
        raise ValueError(f"need a column for each of 2 or more {names}, got {values.shape}")
    columns = list(values.T)
    if len(values) < MIN_SAMPLE:
        reason = f"needs {MIN_SAMPLE} participants, there are {len(values)}"
        return Decision((), False, Untestable("test", reason), Untestable("test", reason))
    pairs = list(combinations(range(len(names)), 2))
    steps = [
        _step(
            "Are the differences normal?"
            if len(names) == 2
            else f"Are the differences {names[a]} − {names[b]} normal?",
            shapiro_wilk(differences(columns[a], columns[b]), "differences"),
            alpha=alpha,
        )
        for a, b in pairs
    ]
    steps.append(_step("Are the variances equal?", levene(columns), alpha=alpha))
    if len(names) == 2:
        outcomes = paired_t(*columns), wilcoxon(*columns)
        return _chosen(steps, *outcomes)
    sphericity = _step("Does sphericity hold?", mauchly(values), alpha=alpha, decides=False)
    steps.append(sphericity)
    anova = repeated_anova(values, spherical=sphericity.answer == "yes")
    decision = _chosen(steps, anova, friedman(values))
    test = paired_t if decision.parametric else wilcoxon
    compared = [(names[a], names[b], test(columns[a], columns[b])) for a, b in pairs]
    return _with_pairs(decision, compared)


def decide_groups(
    groups: Sequence[Float64[np.ndarray, "_"]], names: Sequence[str], *, alpha: float
) -> Decision:
    """Test conditions that different people did; `groups` has the numbers of each condition.

    Raises:
        ValueError: There are less than two groups, or a value is missing.
    """
    if len(groups) != len(names) or len(names) < 2:
        raise ValueError(f"need the numbers of each of 2 or more {names}, got {len(groups)}")
    if min(len(group) for group in groups) < MIN_SAMPLE:
        counts = ", ".join(str(len(group)) for group in groups)
        reason = f"needs {MIN_SAMPLE} participants in each group, there are {counts}"
        return Decision((), False, Untestable("test", reason), Untestable("test", reason))
    steps = [
        _step(f"Are the values of {name} normal?", shapiro_wilk(group), alpha=alpha)
        for name, group in zip(names, groups, strict=True)
    ]
    variances = levene(list(groups))
    steps.append(_step("Are the variances equal?", variances, alpha=alpha, decides=False))
    if len(names) == 2:
        return _chosen(steps, welch_t(*groups), mann_whitney(*groups))
    decision = _chosen(steps, welch_anova(list(groups)), kruskal_wallis(list(groups)))
    test = welch_t if decision.parametric else mann_whitney
    pairs = combinations(range(len(names)), 2)
    compared = [(names[a], names[b], test(groups[a], groups[b])) for a, b in pairs]
    return _with_pairs(decision, compared)


def _step(question: str, outcome: Outcome, *, alpha: float, decides: bool = True) -> DecisionStep:
    if isinstance(outcome, Untestable):
        return DecisionStep(question, "undecidable", outcome, decides)
    return DecisionStep(question, "no" if outcome.p < alpha else "yes", outcome, decides)


def _chosen(steps: Sequence[DecisionStep], parametric: Outcome, by_ranks: Outcome) -> Decision:
    satisfied = all(step.answer == "yes" for step in steps if step.decides)
    if satisfied:
        return Decision(tuple(steps), True, parametric, by_ranks)
    return Decision(tuple(steps), False, by_ranks, parametric)


def _with_pairs(decision: Decision, compared: Sequence[tuple[str, str, Outcome]]) -> Decision:
    tested = [outcome for _, _, outcome in compared if isinstance(outcome, Result)]
    corrected = iter(holm([outcome.p for outcome in tested]))
    pairs = tuple(
        Pair(first, second, outcome, next(corrected) if isinstance(outcome, Result) else None)
        for first, second, outcome in compared
    )
    return Decision(decision.steps, decision.parametric, decision.outcome, decision.other, pairs)


def _answer(step: DecisionStep) -> str:
    outcome = step.outcome
    if isinstance(outcome, Untestable):
        return f"Undecidable ({outcome.test}: {outcome.reason})."
    word = "Yes" if step.answer == "yes" else "No"
    p = "p < .001" if outcome.p < 0.001 else f"p = {outcome.p:.3f}"
    shown = "" if step.decides else "; shown, it does not decide"
    return f"{word} ({outcome.test}: {outcome.symbol} = {outcome.statistic:.3f}, {p}{shown})."
