"""The tables: every number (long), one line per participant (wide), what they mean, the results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from peaking.reports.csv_table import csv_text
from peaking.study.analysis.matrix import Matrix
from peaking.study.analysis.measure_analysis import Analysis, MeasureAnalysis
from peaking.study.measure_catalogue import Measure
from peaking.study.statistics.outcome import Effect, Outcome, Untestable
from peaking.study.tables import Measurement

Cell = str | int | float | None

LONG_COLUMNS = {
    "participant": "Pseudonym",
    "condition": "Name of the condition",
    "scene": "Name of the scene",
    "position": "Position of the trial in the participant's order, from 1",
    "measure": "Name of the measure",
    "value": "The value; empty: missing",
}

RESULT_COLUMNS = {
    "measure": "Name of the measure",
    "first": "First condition compared; differences are first minus second",
    "second": "Second condition compared",
    "test": "Name of the test",
    "chosen": "Role of the test: assumption, chosen, not chosen, pair or order",
    "n": "Number of participants used",
    "symbol": "Symbol of the statistic",
    "statistic": "Value of the statistic",
    "df1": "Degrees of freedom; empty if the test has none",
    "df2": "Second degrees of freedom",
    "p": "Two-sided p-value, not corrected",
    "p_holm": "p-value after Holm's correction; the largest if a measure is in several families",
    "corrected_in": "Families in which p was corrected, or the pairs of the measure",
    "effect": "Symbol of the effect; a test with several has a line for each",
    "effect_value": "Size of the effect",
    "effect_low": "Lower limit of its 95% confidence interval",
    "effect_high": "Upper limit",
    "interval_method": "Method of the interval. A rank-biserial has two lines: by Fisher's z "
    "(reported; the same as R's effectsize) and a score interval, which contains the true value in "
    "95% of studies even for strong effects or few participants",
    "remark": "Remarks, or why there is no result",
    "decision_path": "Why this test was chosen",
}


def long_csv(numbers: Sequence[Measurement]) -> str:
    """Return one line per participant, trial and measure."""
    rows = ((n.participant, n.condition, n.scene, n.position, n.measure, n.value) for n in numbers)
    return _csv(list(LONG_COLUMNS), rows)


def wide_csv(matrices: Sequence[Matrix]) -> str:
    """Return one line per participant, one column per measure and condition (`tct_s__peaking`)."""
    if not matrices:
        return _csv(["participant"], [])
    conditions, participants = matrices[0].conditions, matrices[0].participants
    header = ["participant", *(f"place__{name}" for name in conditions)]
    header += [f"{m.measure.name}__{name}" for m in matrices for name in conditions]
    rows: list[list[Cell]] = []
    for index, participant in enumerate(participants):
        places = [int(place) + 1 or None for place in matrices[0].places[index]]
        numbers = [_number(value) for m in matrices for value in m.values[index]]
        rows.append([participant, *places, *numbers])
    return _csv(header, rows)


def codebook_csv(catalogue: Sequence[Measure], conditions: Sequence[str]) -> str:
    """Return what every column of the tables, and every measure, is."""
    header = ["file", "name", "label", "unit", "kind", "lowest", "highest", "description"]
    rows: list[Sequence[Cell]] = [
        ["long.csv", name, "", "", "column", None, None, words]
        for name, words in LONG_COLUMNS.items()
    ]
    rows.append(["wide.csv", "participant", "", "", "column", None, None, "Pseudonym"])
    rows += [
        [
            "wide.csv",
            f"place__{name}",
            "",
            "",
            "column",
            1,
            len(conditions),
            f"Position of {name} in the participant's order, from 1; empty: not done",
        ]
        for name in conditions
    ]
    rows += [
        [
            "long.csv (measure), wide.csv (before __condition)",
            m.name,
            m.label,
            m.unit,
            m.kind,
            m.low,
            m.high,
            f"{m.description}. In wide.csv: mean over the scenes of the condition",
        ]
        for m in catalogue
    ]
    rows += [
        ["results.csv", name, "", "", "column", None, None, words]
        for name, words in RESULT_COLUMNS.items()
    ]
    return _csv(header, rows)


def results_csv(analysis: Analysis) -> str:
    """Return every test that was made or could not be: one line per test and effect."""
    rows = [row for measure in analysis.measures for row in _result_rows(measure)]
    return _csv(list(RESULT_COLUMNS), rows)


def result_records(analysis: Analysis) -> list[dict[str, Cell]]:
    """Return the lines of results.csv as one dictionary each."""
    rows = [row for measure in analysis.measures for row in _result_rows(measure)]
    return [dict(zip(RESULT_COLUMNS, row, strict=True)) for row in rows]


def _result_rows(analysis: MeasureAnalysis) -> list[list[Cell]]:
    name, decision = analysis.measure.name, analysis.decision
    named = analysis.matrix.conditions
    ends = (named[0], named[1]) if len(named) == 2 else ("", "")
    path = " ".join(decision.path())
    families = " ".join(c.family for c in analysis.corrected)
    rows: list[list[Cell]] = []
    for step in decision.steps:
        rows += _outcome_rows([name, "", "", step.outcome.test, "assumption"], step.outcome)
    head: list[Cell] = [name, *ends, decision.outcome.test, "chosen"]
    rows += _outcome_rows(
        head, decision.outcome, p_holm=analysis.p_corrected, family=families, path=path
    )
    rows += _outcome_rows([name, *ends, decision.other.test, "not chosen"], decision.other)
    for pair in decision.pairs:
        rows += _outcome_rows(
            [name, pair.first, pair.second, pair.outcome.test, "pair"],
            pair.outcome,
            p_holm=pair.p_holm,
            family="pairs of the measure",
        )
    if analysis.order is not None:
        for outcome in (analysis.order.period, analysis.order.carry_over):
            rows += _outcome_rows([name, "", "", outcome.test, "order"], outcome)
    return rows


def _outcome_rows(
    head: list[Cell],
    outcome: Outcome,
    *,
    p_holm: float | None = None,
    family: str = "",
    path: str = "",
) -> list[list[Cell]]:
    if isinstance(outcome, Untestable):
        return [[*head, *[None] * 13, outcome.reason, path]]
    df = [*outcome.df, None, None][:2]
    front: list[Cell] = [*head, outcome.n, outcome.symbol, outcome.statistic, *df, outcome.p]
    front += [p_holm, family if p_holm is not None else ""]
    remark = "; ".join(outcome.remarks)
    effects: list[Effect | None] = list(outcome.effects) or [None]
    return [[*front, *_effect_cells(effect), remark, path] for effect in effects]


def _effect_cells(effect: Effect | None) -> list[Cell]:
    if effect is None:
        return [None] * 5
    return [effect.symbol, effect.value, effect.low, effect.high, effect.method]


def _number(value: float) -> float | None:
    return None if value != value else float(value)  # NaN alone differs from itself


def _csv(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    return csv_text([header, *rows])
