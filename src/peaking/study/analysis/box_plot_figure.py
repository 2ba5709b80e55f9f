"""Box plots of measures with significance marks, as in the paper's figure of results."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peaking.study.analysis.figure_style import INK, LINE, MUTED, colour_of, styled, wrapped
from peaking.study.analysis.measure_analysis import MeasureAnalysis
from peaking.study.analysis.words import short_name, stars
from peaking.study.measure_catalogue import Measure

COLUMNS = 4
PANEL_IN = (2.25, 2.6)
"""Width and height of one panel, inches."""

MAX_LINES = 60
"""Participants up to which the numbers of each are joined by a line."""


def box_plots(measures: Sequence[MeasureAnalysis], labels: Sequence[str]) -> Figure:
    """Draw one panel per measure: boxes, every participant's numbers, marks of significance.

    Boxes go from the first to the third quartile with the median, whiskers to the farthest number
    within 1.5 interquartile ranges, a diamond is the mean. The points of one participant are joined
    where the conditions were done by the same people.

    Args:
        measures: What to draw, at least one.
        labels: Of the conditions, in their order.
    """
    columns = min(COLUMNS, len(measures))
    rows = math.ceil(len(measures) / columns)
    with styled():
        figure = Figure(figsize=(columns * PANEL_IN[0], rows * PANEL_IN[1]), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        for index, axes in enumerate(grid.flat):
            if index < len(measures):
                _panel(axes, measures[index], labels)
            else:
                axes.set_axis_off()
    return figure


def marks_of(analysis: MeasureAnalysis) -> list[tuple[int, int, str]]:
    """Return which pairs of conditions are marked, and how: corrected p-values where there are.

    Pairs of three and more conditions are marked only where the test of all is significant.
    """
    count = len(analysis.matrix.conditions)
    if count == 2:
        mark = stars(analysis.p_decisive)
        return [(0, 1, mark)] if mark else []
    if not stars(analysis.p_decisive):
        return []
    pairs = zip(combinations(range(count), 2), analysis.decision.pairs, strict=False)
    return [(a, b, stars(pair.p_holm)) for (a, b), pair in pairs if stars(pair.p_holm)]


def _panel(axes: Axes, analysis: MeasureAnalysis, labels: Sequence[str]) -> None:
    values = analysis.matrix.values
    columns = [column[~np.isnan(column)] for column in values.T]
    _points(axes, values)
    for index, column in enumerate(columns):
        if len(column):
            _box(axes, index, column)
    axes.set_xticks(range(len(labels)), [wrapped(label, 9) for label in labels])
    axes.set_xlim(-0.6, len(labels) - 0.4)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color=LINE, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title(wrapped(_title(analysis), 24), loc="left")
    _scale_ticks(axes, analysis.measure)
    _marks(axes, marks_of(analysis), columns)


def _title(analysis: MeasureAnalysis) -> str:
    measure = analysis.measure
    unit = f", {measure.unit}" if measure.unit in ("s", "%") else ""
    return f"{short_name(measure)}{unit}"


def _box(axes: Axes, index: int, column: Float64[np.ndarray, "n"]) -> None:
    colour = colour_of(index)
    axes.boxplot(
        column,
        positions=[index],
        widths=0.5,
        showfliers=False,  # every number is drawn as a point
        showmeans=True,
        patch_artist=True,
        boxprops={"facecolor": f"{colour}33", "edgecolor": colour, "linewidth": 1.1},
        whiskerprops={"color": colour, "linewidth": 1.1},
        capprops={"color": colour, "linewidth": 1.1},
        medianprops={"color": colour, "linewidth": 2.2, "solid_capstyle": "butt"},
        meanprops={
            "marker": "D",
            "markersize": 4.5,
            "markerfacecolor": "white",
            "markeredgecolor": INK,
            "markeredgewidth": 0.9,
        },
        manage_ticks=False,
        zorder=3,
    )


def _points(axes: Axes, values: Float64[np.ndarray, "participants conditions"]) -> None:
    """Draw every number beside its box's middle, always at the same place."""
    count = len(values)
    # A low-discrepancy sequence spreads equal numbers without a random source.
    offsets = 0.34 * (np.arange(1, count + 1) * 0.6180339887 % 1 - 0.5)
    if count <= MAX_LINES:
        for offset, row in zip(offsets, values, strict=True):
            axes.plot(
                np.arange(len(row)) + offset, row, color=MUTED, alpha=0.22, linewidth=0.7, zorder=1
            )
    for index, column in enumerate(values.T):
        axes.scatter(
            index + offsets, column, s=9, color=colour_of(index), alpha=0.55, linewidths=0, zorder=4
        )


def _marks(
    axes: Axes, marks: Sequence[tuple[int, int, str]], columns: Sequence[np.ndarray]
) -> None:
    numbers = np.concatenate(columns) if columns else np.array([])
    if not len(numbers):
        return
    low, high = float(numbers.min()), float(numbers.max())
    span = high - low or 1.0
    top = high + 0.06 * span
    for first, second, mark in sorted(marks, key=lambda m: m[1] - m[0]):
        tip = top + 0.05 * span
        axes.plot([first, first, second, second], [top, tip, tip, top], color=INK, linewidth=0.9)
        axes.text((first + second) / 2, tip, mark, ha="center", va="bottom", fontsize=11)
        top = tip + 0.14 * span
    axes.set_ylim(low - 0.06 * span, top + (0.06 * span if marks else 0.0))


def _scale_ticks(axes: Axes, measure: Measure) -> None:
    """Let the axis of answers have its own steps, and none beyond the scale."""
    if measure.kind == "item" and measure.low is not None and measure.high is not None:
        step = 1 if measure.high - measure.low <= 10 else 20
        axes.set_yticks(np.arange(measure.low, measure.high + step / 2, step))
