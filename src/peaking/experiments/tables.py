"""Results as files that programs and papers read: JSON, CSV, and Table 1 of the paper.

The paper's Table 1 gives each strategy "as ratios" to Ours, with a second number in brackets that
it does not explain. Our reading: the ratio of the means and, in brackets, the ratio of the standard
deviations over the test views. Ratios are taken scene by scene and budget by budget, and averaged.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from peaking.experiments.costs import Costs
from peaking.experiments.results import MEASURES, CaseResult, Difference, ViewScore
from peaking.output import plain
from peaking.reports.csv_table import csv_text

READING = (
    "Ratios to Ours of the mean over the test views and, in brackets, of the standard deviation "
    "(our reading of the paper's Table 1), averaged over scenes and numbers of views."
)

ORDER = (
    "random",
    "every-nth",
    "sharpest",
    "uniform",
    "farthest",
    "coverage",
    "plenoptic",
    "threshold",
    "auto-shutter",
    "peaking",
    "all",
)
"""Strategies in tables and charts: the paper's first, as there; the reference comes last."""


@dataclass(frozen=True)
class Evaluation:
    """All that an evaluation found, and what it was asked.

    Attributes:
        config: What was asked for; any nesting.
        versions: Of peaking and of what it ran on.
        reference: The strategy that is the paper's "Ours".
        results: One per data set, in any order.
        comparisons: From `intervals.compare` with the same reference.
        notes: What is to be known beside the figures; sentences.
        costs: What all steps took; None where nobody knows.
    """

    config: Mapping[str, object]
    versions: Mapping[str, str]
    reference: str
    results: Sequence[CaseResult]
    comparisons: Sequence[Difference]
    notes: Sequence[str] = ()
    costs: Costs | None = None


@dataclass(frozen=True)
class Cell:
    """Mean and standard deviation, or the ratios of both; None where not available."""

    mean: float | None
    std: float | None = None


@dataclass(frozen=True)
class Table:
    """One part of Table 1: a way to reconstruct, and a choice of test views.

    Attributes:
        reconstruct: `mpi` or `3dgs`.
        test_views: `holdout` or `paper`.
        columns: Metrics, keys of `MEASURES`.
        absolute: Strategy → metric → mean and standard deviation, in the order of rows.
        ratios: Strategy → metric → ratios to the reference. Strategies that share no number of
            views with the reference (`all`) are not in it.
        data_sets: Strategy → how many scenes × numbers of views it was averaged over.
    """

    reconstruct: str
    test_views: str
    columns: tuple[str, ...]
    absolute: Mapping[str, Mapping[str, Cell]]
    ratios: Mapping[str, Mapping[str, Cell]]
    data_sets: Mapping[str, int]


def strategies_of(evaluation: Evaluation) -> list[str]:
    """Return the strategies in the order of tables and legends."""
    names = {result.case.strategy for result in evaluation.results}
    places = {name: place for place, name in enumerate(ORDER)}
    return sorted(
        names, key=lambda name: (name == evaluation.reference, places.get(name, len(ORDER)), name)
    )


def table_1(evaluation: Evaluation) -> list[Table]:
    """Return the parts of Table 1, MPI before 3DGS, `holdout` before `paper`."""
    parts = {(r.case.reconstruct, r.case.test_views) for r in evaluation.results}
    ordered = sorted(sorted(parts, key=lambda part: part[1]), key=lambda part: part[0] != "mpi")
    return [_table(evaluation, *part) for part in ordered]


def table_md(evaluation: Evaluation) -> str:
    """Return Table 1 as ratios, then in absolute values, as Markdown."""
    # "--" may not stand within a comment.
    parts = [f"<!-- {_provenance(evaluation).replace('--', '- -')} -->\n", f"{READING}\n"]
    parts += [f"{note}\n" for note in evaluation.notes]
    for table in table_1(evaluation):
        ratios = {name: ratio_texts(table, name) for name in table.ratios}
        absolute = {
            name: [*absolute_texts(table, name), str(table.data_sets[name])]
            for name in table.absolute
        }
        heads = column_heads(table)
        parts += [
            f"## {heading(table)}\n",
            _md_grid(evaluation, heads, ratios),
            "Absolute values: mean (standard deviation); PSNR in dB.\n",
            _md_grid(evaluation, [*heads, "data sets"], absolute),
        ]
    return "\n".join(parts)


def table_tex(evaluation: Evaluation) -> str:
    r"""Return Table 1 as ratios in LaTeX, set as in the paper; needs `\usepackage{booktabs}`."""
    tables = table_1(evaluation)
    num_columns = max((len(table.columns) for table in tables), default=1)
    lines = [
        f"% {_provenance(evaluation)}",
        r"\begin{table}",
        r"    \centering",
        rf"    \caption{{View synthesis quality of different view sampling strategies. {READING}}}",
        r"    \label{tab:results_synth}",
        rf"    \begin{{tabular}}{{l{'c' * num_columns}}}",
        r"        \toprule",
    ]
    for number, table in enumerate(tables):
        if number:
            lines += [r"        \midrule", r"        \midrule"]
        heads = [
            head.replace("↓", r"$(\downarrow)$").replace("↑", r"$(\uparrow)$")
            for head in column_heads(table)
        ]
        lines += [_tex_row([heading(table), *heads], num_columns), r"        \midrule"]
        for strategy in table.ratios:
            cells = [row_name(evaluation, strategy), *ratio_texts(table, strategy)]
            lines.append(_tex_row(cells, num_columns))
    lines += [r"        \bottomrule", r"    \end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def per_view_csv(evaluation: Evaluation) -> str:
    """Return one line per case and test view; what is not available is empty.

    The first line is "#" and the configuration as JSON, the second has the names.
    """
    score_fields = [field.name for field in fields(ViewScore)]
    heads = ["scene", "strategy", "reconstruct", "test_views", "n_views", "seed", *score_fields]
    rows = [
        [
            *(result.case.scene, result.case.strategy, result.case.reconstruct),
            *(result.case.test_views, result.case.n_views, result.case.seed),
            *(_csv_cell(getattr(score, name)) for name in score_fields),
        ]
        for result in sorted(evaluation.results, key=lambda r: r.case)
        for score in result.scores
    ]
    return csv_text([heads, *rows], provenance=_provenance(evaluation))


def results_json(evaluation: Evaluation) -> str:
    """Return `results.json`: config, versions, rows, compare; null where not available."""
    document = {
        "config": plain(evaluation.config),
        "versions": plain(evaluation.versions),
        "notes": list(evaluation.notes),
        "costs": None if evaluation.costs is None else evaluation.costs.as_dict(),
        "rows": [result.row() for result in sorted(evaluation.results, key=lambda r: r.case)],
        "compare": [asdict(difference) for difference in evaluation.comparisons],
    }
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def column_heads(table: Table) -> list[str]:
    """Return the names of the columns with an arrow to the better side."""
    return [
        f"{MEASURES[c].title} {'↓' if MEASURES[c].less_is_better else '↑'}" for c in table.columns
    ]


def row_name(evaluation: Evaluation, strategy: str) -> str:
    """Return the name of a strategy in a table, "Ours (peaking)" for the reference."""
    return f"Ours ({strategy})" if strategy == evaluation.reference else strategy.capitalize()


def ratio_texts(table: Table, strategy: str) -> list[str]:
    """Return the ratios of a strategy, column by column: "0.972 (0.87)", "–" where missing."""
    return [_pair(table.ratios[strategy][c], "{:.3f}", "{:.2f}") for c in table.columns]


def absolute_texts(table: Table, strategy: str) -> list[str]:
    """Return the values of a strategy, column by column: "24.31 (3.05)", "0.871 (0.042)"."""
    forms = ["{:.2f}" if c.startswith("psnr") else "{:.3f}" for c in table.columns]
    cells = [table.absolute[strategy][c] for c in table.columns]
    return [_pair(cell, form, form) for cell, form in zip(cells, forms, strict=True)]


def _pair(cell: Cell, mean_form: str, std_form: str) -> str:
    if cell.mean is None:
        return "–"
    mean = mean_form.format(cell.mean)
    return mean if cell.std is None else f"{mean} ({std_form.format(cell.std)})"


def heading(table: Table) -> str:
    """Return "MPI, holdout test views"."""
    return f"{table.reconstruct.upper()}, {table.test_views} test views"


def _table(evaluation: Evaluation, reconstruct: str, test_views: str) -> Table:
    sets = _data_sets(evaluation.results, reconstruct, test_views)
    names = [name for name in strategies_of(evaluation) if any(name == key[0] for key in sets)]
    known = {c for cells in sets.values() for c, cell in cells.items() if cell.mean is not None}
    # ST-LPIPS stands in where the official weights of LPIPS are not there, under its own name.
    perceptual = "lpips" if "lpips" in known or "st_lpips" not in known else "st_lpips"
    first = ("psnr", "psnr_p5", "ssim", *([perceptual] if perceptual in known else []))
    others = (name for name in MEASURES if name not in (*first, "lpips", "st_lpips"))
    columns = (*first, *others)
    absolute: dict[str, dict[str, Cell]] = {}
    ratios: dict[str, dict[str, Cell]] = {}
    counts: dict[str, int] = {}
    for name in names:
        own = {key[1:]: cells for key, cells in sets.items() if key[0] == name}
        counts[name] = len(own)
        absolute[name] = {c: _average([cells[c] for cells in own.values()]) for c in columns}
        pairs = [
            (cells, sets[evaluation.reference, *place])
            for place, cells in own.items()
            if (evaluation.reference, *place) in sets
        ]
        if pairs:
            ratios[name] = {c: _average([_ratio(a[c], b[c]) for a, b in pairs]) for c in columns}
    return Table(reconstruct, test_views, columns, absolute, ratios, counts)


def _data_sets(
    results: Sequence[CaseResult], reconstruct: str, test_views: str
) -> dict[tuple[str, str, int], dict[str, Cell]]:
    """Return strategy, scene, n_views → metric → mean and deviation, averaged over the seeds."""
    rows: dict[tuple[str, str, int], list[dict[str, Cell]]] = {}
    for result in results:
        case = result.case
        if (case.reconstruct, case.test_views) == (reconstruct, test_views):
            key = (case.strategy, case.scene, case.n_views)
            rows.setdefault(key, []).append(_cells(result))
    return {
        key: {metric: _average([cells[metric] for cells in seeds]) for metric in MEASURES}
        for key, seeds in rows.items()
    }


def _cells(result: CaseResult) -> dict[str, Cell]:
    row = result.row()
    return {
        metric: Cell(_number(row["psnr_p5"]))
        if metric == "psnr_p5"
        else Cell(_number(row[f"{metric}_mean"]), _number(row[f"{metric}_std"]))
        for metric in MEASURES
    }


def _average(cells: Sequence[Cell]) -> Cell:
    """Return the mean of means and of deviations; None where one is missing."""
    means = [cell.mean for cell in cells if cell.mean is not None]
    stds = [cell.std for cell in cells if cell.std is not None]
    return Cell(
        float(np.mean(means)) if len(means) == len(cells) else None,
        float(np.mean(stds)) if len(stds) == len(cells) else None,
    )


def _ratio(cell: Cell, reference: Cell) -> Cell:
    return Cell(_quotient(cell.mean, reference.mean), _quotient(cell.std, reference.std))


def _quotient(value: float | None, reference: float | None) -> float | None:
    return None if value is None or not reference else value / reference


def _number(value: str | int | float | None) -> float | None:
    return None if value is None else float(value)


def _csv_cell(value: str | int | float | None) -> str | int | None:
    return f"{value:.6f}" if isinstance(value, float) else value


def _provenance(evaluation: Evaluation) -> str:
    versions, config = plain(evaluation.versions), plain(evaluation.config)
    return json.dumps({"versions": versions, "config": config}, ensure_ascii=False)


def _md_grid(
    evaluation: Evaluation, heads: Sequence[str], texts: Mapping[str, Sequence[str]]
) -> str:
    lines = [f"| Strategy | {' | '.join(heads)} |", f"|---|{'---:|' * len(heads)}"]
    for strategy, cells in texts.items():
        lines.append(f"| {' | '.join([row_name(evaluation, strategy), *cells])} |")
    return "\n".join(lines) + "\n"


def _tex_row(cells: Sequence[str], num_columns: int) -> str:
    escaped = [cell.replace("_", r"\_").replace("–", "--") for cell in cells]
    padded = escaped + [""] * (num_columns + 1 - len(cells))
    return f"        {' & '.join(padded)} " + r"\\"
