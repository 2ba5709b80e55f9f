"""Analyse a study's folder and write everything: complete, or nothing."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from matplotlib.figure import Figure

from peaking.errors import StudyError
from peaking.output import complete_or_absent
from peaking.study.analysis import words
from peaking.study.analysis.box_plot_figure import box_plots
from peaking.study.analysis.csv_files import codebook_csv, long_csv, results_csv, wide_csv
from peaking.study.analysis.figure_style import png_bytes, svg_bytes
from peaking.study.analysis.forest_plot import forest
from peaking.study.analysis.likert_figure import is_likert, likert
from peaking.study.analysis.matrix import build_matrices
from peaking.study.analysis.measure_analysis import Analysis, MeasureAnalysis, analyse
from peaking.study.analysis.method_text import method
from peaking.study.analysis.over_time_figure import curves_of, over_time
from peaking.study.analysis.report import report_page
from peaking.study.measures import catalogue_of
from peaking.study.tables import measurements, read_study


def analyse_folder(study_folder: Path, out: Path, *, version: str) -> Analysis:
    """Read a study, analyse it, write tables, figures, text and report.

    Args:
        study_folder: With protocol.toml and participants/.
        out: Folder to write; it must not exist, or be empty.
        version: Of peaking, for the report.

    Raises:
        StudyError: The study cannot be read, or nobody counts.
        OutputError: `out` cannot be written.
    """
    study = read_study(study_folder)
    if not study.counting:
        raise StudyError(
            study_folder,
            "has no participants to analyse",
            remedy="analyse it after somebody has taken part, or try: peaking study simulate",
        )
    numbers = measurements(study)
    catalogue = catalogue_of(study.protocol)
    conditions = tuple(condition.name for condition in study.protocol.conditions)
    matrices = build_matrices(numbers, catalogue, conditions)
    excluded = [(p.pseudonym, p.excluded) for p in study.participants if p.excluded is not None]
    analysis = analyse(study.protocol, matrices, excluded=excluded)
    with complete_or_absent(out) as folder:
        for name, text in {
            "long.csv": long_csv(numbers),
            "wide.csv": wide_csv(matrices),
            "codebook.csv": codebook_csv(catalogue, conditions),
            "results.csv": results_csv(analysis),
            "results.txt": results_text(analysis),
        }.items():
            (folder / name).write_bytes(text.encode("utf-8"))
        (folder / "figures").mkdir()
        drawings: dict[str, bytes] = {}
        figures = figures_of(analysis)
        curves = curves_of(study)
        if curves:
            labels = {condition.name: condition.label for condition in study.protocol.conditions}
            figures["over_time"] = over_time(curves, labels)
        for name, figure in figures.items():
            drawings[name] = svg_bytes(figure)
            (folder / "figures" / f"{name}.svg").write_bytes(drawings[name])
            (folder / "figures" / f"{name}.png").write_bytes(png_bytes(figure))
        page = report_page(analysis, drawings, version=version)
        (folder / "report.html").write_bytes(page.encode("utf-8"))
    return analysis


def figures_of(analysis: Analysis) -> dict[str, Figure]:
    """Return the figures by name; those that have something to show."""
    labels = [condition.label for condition in analysis.protocol.conditions]
    found: dict[str, Figure] = {}
    boxed = [m for m in analysis.measures if _is_boxed(m)]
    if boxed:
        found["boxes"] = box_plots(boxed, labels)
    tested = [m for m in analysis.measures if m.result is not None]
    if tested and len(labels) == 2:
        found["effects"] = forest(tested, labels)
    by_points: dict[int, list[MeasureAnalysis]] = defaultdict(list)
    for measure in analysis.measures:
        if is_likert(measure):
            by_points[round(measure.measure.high or 0.0)].append(measure)
    for points, items in sorted(by_points.items(), reverse=True):
        found[f"likert-{points}"] = likert(items, labels)
    return found


def _is_boxed(analysis: MeasureAnalysis) -> bool:
    """Whether a measure is in the figure of boxes: declared, or a whole score."""
    there = sum(1 for described in analysis.described if described.count)
    return there >= 2 and (bool(analysis.families) or analysis.measure.kind == "score")


def results_text(analysis: Analysis) -> str:
    """Return method, results and decision paths as plain text."""
    lines = [analysis.protocol.title, "", "Method", "", method(analysis), "", "Results", ""]
    tested = [m for m in analysis.measures if m.families or m.result is not None]
    lines += [words.sentence(m, analysis.protocol) for m in tested]
    lines += ["", "Decision paths"]
    for measure in tested:
        lines += ["", f"{measure.measure.label} ({measure.measure.name})"]
        lines += [f"  {line}" for line in measure.decision.path()]
        if measure.result is not None:
            lines.append(f"  Not chosen: {words.other_test(measure.decision.other)}")
    return "\n".join(lines) + "\n"
