"""Answers on scales as stacks about the middle: how many disagreed, how many agreed."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from peaking.study.analysis.figure_style import INK, LINE, MUTED, styled, wrapped
from peaking.study.analysis.measure_analysis import MeasureAnalysis
from peaking.study.analysis.words import short_name, stars

ROW_IN = 0.24
"""Height of one bar, inches."""


def is_likert(analysis: MeasureAnalysis) -> bool:
    """Whether a measure is answered in few whole steps."""
    measure = analysis.measure
    return (
        measure.kind == "item"
        and measure.low is not None
        and measure.high is not None
        and 2 <= measure.high - measure.low + 1 <= 11
        and any(d.count for d in analysis.described)
    )


def likert(measures: Sequence[MeasureAnalysis], labels: Sequence[str]) -> Figure:
    """Draw one bar per item and condition, centred on the middle answer.

    Args:
        measures: Items that all have the same scale, see `is_likert`.
        labels: Of the conditions.
    """
    points = _points(measures[0])
    rows = len(measures) * (len(labels) + 0.9)
    with styled():
        figure = Figure(figsize=(9.0, max(2.2, rows * ROW_IN + 1.0)), layout="constrained")
        axes = figure.subplots()
        y = 0.0
        ticks: list[float] = []
        names: list[str] = []
        for analysis in measures:
            middle = y + (len(labels) - 1) / 2
            _label(axes, analysis, middle)
            for label, column in zip(labels, analysis.matrix.values.T, strict=True):
                _bar(axes, y, column, points)
                ticks.append(y)
                names.append(label)
                y += 1
            y += 0.9
        _frame(axes, ticks, names, points)
        figure.legend(
            handles=[
                Patch(facecolor=colour, edgecolor="white", label=str(point))
                for point, colour in zip(points, _colours(len(points)), strict=True)
            ],
            loc="outside lower center",
            ncols=len(points),
            frameon=False,
            handlelength=1.2,
            columnspacing=1.2,
            title=f"{_ends(measures[0])}",
            title_fontsize=8.5,
        )
    return figure


def _points(analysis: MeasureAnalysis) -> list[int]:
    low, high = analysis.measure.low or 0.0, analysis.measure.high or 0.0
    return list(range(round(low), round(high) + 1))


def _ends(analysis: MeasureAnalysis) -> str:
    words = analysis.measure.description
    if words.endswith(")") and " … " in words:
        low, _, high = words[words.rfind("(") + 1 : -1].partition(" … ")
        return f"{_points(analysis)[0]} = {low},  {_points(analysis)[-1]} = {high}"
    return ""


def _colours(count: int) -> list[tuple[float, float, float, float]]:
    """Return colours from red over grey to blue, that people who cannot tell red from green can."""
    return [colormaps["RdBu"](0.12 + 0.76 * i / (count - 1)) for i in range(count)]


def _bar(axes: Axes, y: float, column: Float64[np.ndarray, "n"], points: Sequence[int]) -> None:
    there = column[~np.isnan(column)]
    if not len(there):
        return
    # Means over several scenes lie between the steps: to the nearest.
    answers = np.floor(there + 0.5)
    shares = np.array([100 * float(np.mean(answers == point)) for point in points])
    middle = (len(points) - 1) / 2
    before = sum(s for i, s in enumerate(shares) if i < middle)
    before += sum(s / 2 for i, s in enumerate(shares) if i == middle)
    left = -float(before)
    for share, colour in zip(shares, _colours(len(points)), strict=True):
        if share:
            axes.barh(y, share, left=left, height=0.86, color=colour, edgecolor="white", lw=0.6)
            if share >= 7:
                dark = sum(colour[:3]) < 1.75
                axes.text(
                    left + share / 2,
                    y,
                    f"{share:.0f}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if dark else INK,
                )
        left += share


def _label(axes: Axes, analysis: MeasureAnalysis, y: float) -> None:
    mark = stars(analysis.p_decisive)
    name = f"{short_name(analysis.measure)} {mark}".strip()
    text = f"{wrapped(analysis.measure.label, 46)}"
    axes.annotate(
        text,
        (0, y),
        xycoords=("axes fraction", "data"),
        xytext=(-96, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=7.5,
        color=INK,
        annotation_clip=False,
    )
    axes.annotate(
        name,
        (1, y),
        xycoords=("axes fraction", "data"),
        xytext=(6, 0),
        textcoords="offset points",
        ha="left",
        va="center",
        fontsize=8,
        fontweight="bold",
        color=INK,
        annotation_clip=False,
    )


def _frame(axes: Axes, ticks: Sequence[float], names: Sequence[str], points: Sequence[int]) -> None:
    axes.set_yticks(ticks, names, fontsize=7.5)
    axes.set_ylim(max(ticks) + 0.8, min(ticks) - 0.8)
    axes.set_xlim(-100, 100)
    axes.set_xticks(range(-100, 101, 50), [f"{abs(x)} %" for x in range(-100, 101, 50)])
    axes.axvline(0, color=MUTED, linewidth=0.8, zorder=0)
    axes.grid(axis="x", color=LINE, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    side = "answers below and above the middle" if len(points) % 2 else "lower and upper half"
    axes.set_xlabel(f"Participants, {side}", fontsize=8, color=MUTED)
