"""What the analysis does on many simulated studies: false positives, and intervals that hold.

A study without any effect should be called significant in 5 % of its tests, and in at most 5 % of
its families after Holm's correction. With known effects, 95 % of the intervals should hold them.
"""

# SciPy is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64
from scipy import stats

from peaking.study.analysis.matrix import Matrix
from peaking.study.analysis.measure_analysis import Analysis, MeasureAnalysis, analyse
from peaking.study.measure_catalogue import Measure
from peaking.study.measures import catalogue_of
from peaking.study.protocol import Protocol, trials_of
from peaking.study.simulation.drawing import Drawn, draw
from peaking.study.simulation.truth import Truth
from peaking.study.statistics.outcome import SCORE, Result
from peaking.study.statistics.samples import differences
from peaking.study.statistics.signed_rank_test import rank_biserial, signed_ranks

LARGE = 100_000
"""Participants from whose numbers the population's effects are taken."""

MAX_WALSH = 3000


@dataclass
class Count:
    """How often something happened."""

    happened: int = 0
    of: int = 0

    def add(self, happened: bool) -> None:
        """Count one more."""
        self.happened += happened
        self.of += 1

    @property
    def share(self) -> float:
        """How often, 0…1; NaN of nothing."""
        return self.happened / self.of if self.of else float("nan")

    def limits(self, confidence: float = 0.95) -> tuple[float, float]:
        """Return the exact binomial limits of the share (Clopper and Pearson 1934)."""
        interval = stats.binomtest(self.happened, self.of).proportion_ci(confidence)
        return float(interval.low), float(interval.high)


def _counts() -> dict[str, Count]:
    return defaultdict(Count)


@dataclass
class FalsePositives:
    """Of studies without an effect."""

    tests: dict[str, Count] = field(default_factory=_counts)
    """By measure: uncorrected p below alpha."""
    families: dict[str, Count] = field(default_factory=_counts)
    """By family: any corrected p below alpha."""
    uncorrected_families: dict[str, Count] = field(default_factory=_counts)
    """By family: any uncorrected p below alpha, what correction is for."""
    parametric: dict[str, Count] = field(default_factory=_counts)
    """By measure: how often the decision took the t-test."""


@dataclass
class Coverage:
    """Of studies with a known effect."""

    held: dict[str, dict[str, Count]] = field(default_factory=lambda: defaultdict(_counts))
    """By effect (`d_av`, `d_z`, `M_diff`, `r_rb`, `HL`), then measure: the interval held it. What
    the score interval of the rank-biserial held is in `r_rb, score`."""
    truths: dict[str, dict[str, float]] = field(default_factory=lambda: defaultdict(dict))
    """By effect, then measure: what is true in the population."""
    significant: dict[str, Count] = field(default_factory=_counts)
    """By measure: uncorrected p below alpha, the power."""
    parametric: dict[str, Count] = field(default_factory=_counts)


def matrices_from(drawn: Drawn, protocol: Protocol) -> list[Matrix]:
    """Arrange drawn numbers as the analysis takes them, in the orders of the protocol."""
    catalogue = {measure.name: measure for measure in catalogue_of(protocol)}
    conditions = tuple(condition.name for condition in protocol.conditions)
    count = len(next(iter(drawn.values())))
    places = np.empty((count, len(conditions)), dtype=np.int64)
    for row in range(count):
        for place, trial in enumerate(trials_of(protocol, row)):
            places[row, conditions.index(trial.condition)] = place
    participants = tuple(f"P{row + 1:02d}" for row in range(count))
    plain = Measure("", "", "", "score", "")
    return [
        Matrix(catalogue.get(name, plain), participants, conditions, values, places)
        for name, values in drawn.items()
        if name in catalogue
    ]


def false_positives(
    protocol: Protocol, truths: Sequence[Truth], *, studies: int, rng: np.random.Generator
) -> FalsePositives:
    """Analyse studies in which nothing differs."""
    found = FalsePositives()
    for _ in range(studies):
        drawn = draw(truths, protocol.planned_participants, rng)
        _count_study(found, analyse(protocol, matrices_from(drawn, protocol)))
    return found


def _count_study(found: FalsePositives, analysis: Analysis) -> None:
    alpha = analysis.protocol.alpha
    for measure in analysis.measures:
        if measure.result is not None:
            found.tests[measure.measure.name].add(measure.result.p < alpha)
            found.parametric[measure.measure.name].add(measure.decision.parametric)
    for family in analysis.protocol.families:
        own = [m for m in analysis.measures if family.name in m.families and m.result is not None]
        found.families[family.name].add(
            any(c.p < alpha for m in own for c in m.corrected if c.family == family.name)
        )
        found.uncorrected_families[family.name].add(any(_p(m) < alpha for m in own))


def _p(measure: MeasureAnalysis) -> float:
    return 1.0 if measure.result is None else measure.result.p


def coverage(
    protocol: Protocol, truths: Sequence[Truth], *, studies: int, rng: np.random.Generator
) -> Coverage:
    """Analyse studies with known effects; both tests' intervals are looked at, chosen or not."""
    found = Coverage()
    population = draw(truths, LARGE, rng)
    for name, values in population.items():
        for symbol, value in population_effects(values).items():
            found.truths[symbol][name] = value
    for _ in range(studies):
        drawn = draw(truths, protocol.planned_participants, rng)
        for measure in analyse(protocol, matrices_from(drawn, protocol)).measures:
            name = measure.measure.name
            if measure.result is not None:
                found.significant[name].add(measure.result.p < protocol.alpha)
                found.parametric[name].add(measure.decision.parametric)
            for outcome in (measure.decision.outcome, measure.decision.other):
                if not isinstance(outcome, Result):
                    continue
                for effect in outcome.effects:
                    if effect.low is None or effect.high is None:
                        continue
                    true = found.truths[effect.symbol][name]
                    by = ", score" if effect.method == SCORE else ""
                    found.held[effect.symbol + by][name].add(effect.low <= true <= effect.high)
    return found


def population_effects(
    values: Float64[np.ndarray, "participants conditions"],
) -> dict[str, float]:
    """Return the effects of two conditions in a whole population, by their symbols.

    The median of the Walsh averages, whose number grows with the square, is that of the first
    `MAX_WALSH` participants.
    """
    first, second = values[:, 0], values[:, 1]
    away = differences(first, second)
    found = {"M_diff": float(away.mean())}
    if away.any():
        found["d_z"] = float(away.mean() / away.std())
        found["d_av"] = float(away.mean() / np.sqrt((first.var() + second.var()) / 2))
        found["r_rb"] = rank_biserial(signed_ranks(away))
        some = away[:MAX_WALSH]
        rows, columns = np.triu_indices(len(some))
        found["HL"] = float(np.median(some[rows] + some[columns])) / 2
    return found
