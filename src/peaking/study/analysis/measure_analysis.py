"""Every measure tested as the paper decides, families corrected, order and power looked at.

Missing numbers are never filled in. A participant who misses a number in one condition is left out
of that measure's tests (`pairwise`), or of all tests (`listwise`); of different people nobody has
to be left out for the other groups' sake. Descriptions take all numbers there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from peaking.study.analysis.matrix import Matrix
from peaking.study.measure_catalogue import Measure
from peaking.study.protocol import Protocol
from peaking.study.statistics.decision import Decision, decide_groups, decide_paired
from peaking.study.statistics.holm_correction import holm
from peaking.study.statistics.order_effect_tests import OrderEffects, order_effects
from peaking.study.statistics.outcome import MIN_SAMPLE, Result, Untestable
from peaking.study.statistics.power import (
    WANTED,
    WILCOXON_EFFICIENCY,
    smallest_effect,
)


@dataclass(frozen=True)
class Description:
    """The numbers of one condition; all None where there are none."""

    condition: str
    count: int
    mean: float | None
    sd: float | None
    """None for fewer than two numbers."""
    median: float | None
    quartiles: tuple[float, float] | None
    """By linear interpolation, R's type 7."""
    extremes: tuple[float, float] | None


@dataclass(frozen=True)
class Corrected:
    """A p-value after Holm's correction in a family."""

    family: str
    tests: int
    """Tests of the family that gave a p-value."""
    p: float


@dataclass(frozen=True)
class MeasureAnalysis:
    """One measure: described, tested, corrected."""

    matrix: Matrix
    described: tuple[Description, ...]
    left_out: tuple[str, ...]
    """Participants who are in no test of this measure, for a missing number."""
    decision: Decision
    order: OrderEffects | None
    """None between groups, and where there is nothing to test."""
    families: tuple[str, ...]
    """In which the protocol declares it; none: explored, and not corrected."""
    corrected: tuple[Corrected, ...] = ()

    @property
    def measure(self) -> Measure:
        """What was measured."""
        return self.matrix.measure

    @property
    def result(self) -> Result | None:
        """The result of the chosen test, if there is one."""
        return self.decision.outcome if isinstance(self.decision.outcome, Result) else None

    @property
    def p_corrected(self) -> float | None:
        """The largest corrected p-value of its families."""
        return max((c.p for c in self.corrected), default=None)

    @property
    def p_decisive(self) -> float | None:
        """What is held against alpha: the corrected p-value if there is one, else the plain one."""
        if self.result is None:
            return None
        return self.result.p if self.p_corrected is None else self.p_corrected


@dataclass(frozen=True)
class Sensitivity:
    """The smallest standardised difference that is found with a chance of 80 %."""

    participants: int
    """In the study within, per group between."""
    alpha: float
    t_test: float
    rank_test: float
    """By the efficiency of Wilcoxon's tests for normal numbers."""


@dataclass(frozen=True)
class Analysis:
    """All measures of a study."""

    protocol: Protocol
    participants: tuple[str, ...]
    """Those who count."""
    excluded: tuple[tuple[str, str], ...]
    """The others, with the reason."""
    measures: tuple[MeasureAnalysis, ...]
    planned: tuple[Sensitivity, ...]
    """For the planned number of participants: one test, and the first of Holm's in each family."""
    reached: tuple[Sensitivity, ...]
    """The same for those who count; empty when they are too few."""


def analyse(
    protocol: Protocol,
    matrices: Sequence[Matrix],
    *,
    excluded: Sequence[tuple[str, str]] = (),
) -> Analysis:
    """Analyse a study.

    Args:
        protocol: Its design, alpha, families, and what is done about missing numbers.
        matrices: Its measures, those without any number too.
        excluded: Participants who do not count, with the reason.
    """
    everywhere = [m for m in matrices if _measured_everywhere(m)]
    incomplete = np.zeros(len(matrices[0].participants) if matrices else 0, dtype=bool)
    if protocol.missing == "listwise":
        for matrix in everywhere:
            incomplete |= _misses(matrix)
    measures = _with_families([_analyse_one(protocol, m, incomplete) for m in matrices], protocol)
    participants = matrices[0].participants if matrices else ()
    sizes = [
        sum(1 for m in measures if family.name in m.families and m.result is not None)
        for family in protocol.families
    ]
    return Analysis(
        protocol=protocol,
        participants=participants,
        excluded=tuple(excluded),
        measures=tuple(measures),
        planned=_sensitivity(protocol, protocol.planned_participants, sizes),
        reached=_sensitivity(protocol, len(participants), sizes),
    )


def describe(condition: str, column: Float64[np.ndarray, "n"]) -> Description:
    """Describe the numbers of a condition that are there."""
    there = column[~np.isnan(column)]
    if not len(there):
        return Description(condition, 0, None, None, None, None, None)
    low, middle, high = (float(q) for q in np.quantile(there, (0.25, 0.5, 0.75)))
    return Description(
        condition=condition,
        count=len(there),
        mean=float(there.mean()),
        sd=float(there.std(ddof=1)) if len(there) > 1 else None,
        median=middle,
        quartiles=(low, high),
        extremes=(float(there.min()), float(there.max())),
    )


def _analyse_one(protocol: Protocol, matrix: Matrix, incomplete: np.ndarray) -> MeasureAnalysis:
    labels = [protocol.condition(name).label for name in matrix.conditions]
    out = incomplete | _misses(matrix)
    decision, order = _untested(_why_untestable(protocol, matrix)), None
    if _why_untestable(protocol, matrix) is None:
        if protocol.design == "within":
            values = matrix.values[~out]
            decision = decide_paired(values, labels, alpha=protocol.alpha)
            if len(values) >= MIN_SAMPLE:
                order = order_effects(values, matrix.places[~out])
        else:
            kept = matrix.values[~out]
            groups = [column[~np.isnan(column)] for column in kept.T]
            decision = decide_groups(groups, labels, alpha=protocol.alpha)
    else:
        out = np.zeros(len(matrix.participants), dtype=bool)
    return MeasureAnalysis(
        matrix=matrix,
        described=tuple(
            describe(name, column)
            for name, column in zip(matrix.conditions, matrix.values.T, strict=True)
        ),
        left_out=tuple(np.array(matrix.participants, dtype=object)[out]),
        decision=decision,
        order=order,
        families=tuple(f.name for f in protocol.families if matrix.measure.name in f.measures),
    )


def _untested(reason: str | None) -> Decision:
    nothing = Untestable("test", reason or "")
    return Decision((), False, nothing, nothing)


def _why_untestable(protocol: Protocol, matrix: Matrix) -> str | None:
    there = [
        protocol.condition(name).label
        for name, column in zip(matrix.conditions, matrix.values.T, strict=True)
        if not np.isnan(column).all()
    ]
    if len(matrix.conditions) < 2:
        return "the study has one condition; there is nothing to compare"
    if not there:
        return "nothing was measured"
    if len(there) < len(matrix.conditions):
        return f"measured with {' and '.join(there)} only"
    return None


def _measured_everywhere(matrix: Matrix) -> bool:
    return len(matrix.participants) > 0 and not np.isnan(matrix.values).all(axis=0).any()


def _misses(matrix: Matrix) -> np.ndarray:
    """Say who misses a number in a condition that was to be done."""
    missing = np.isnan(matrix.values) & (matrix.places >= 0)
    return np.asarray(missing.any(axis=1))


def _with_families(measures: list[MeasureAnalysis], protocol: Protocol) -> list[MeasureAnalysis]:
    corrected: dict[str, list[Corrected]] = {m.measure.name: [] for m in measures}
    for family in protocol.families:
        results = {
            m.measure.name: m.result.p
            for m in measures
            if family.name in m.families and m.result is not None
        }
        for name, p in zip(results, holm(list(results.values())), strict=True):
            corrected[name].append(Corrected(family.name, len(results), p))
    return [replace(m, corrected=tuple(corrected[m.measure.name])) for m in measures]


def _sensitivity(
    protocol: Protocol, participants: int, sizes: Sequence[int]
) -> tuple[Sensitivity, ...]:
    """Return it for one test, and for the strictest step of Holm's correction of each family."""
    paired = protocol.design == "within"
    n = participants if paired else participants // max(len(protocol.conditions), 1)
    if n < MIN_SAMPLE or len(protocol.conditions) < 2 or protocol.alpha >= WANTED:
        return ()
    levels = sorted({protocol.alpha, *(protocol.alpha / size for size in sizes if size)})
    return tuple(
        Sensitivity(
            participants=n,
            alpha=alpha,
            t_test=smallest_effect(n=float(n), alpha=alpha, paired=paired),
            rank_test=smallest_effect(n=n * WILCOXON_EFFICIENCY, alpha=alpha, paired=paired),
        )
        for alpha in reversed(levels)
    )
