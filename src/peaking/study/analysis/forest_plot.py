"""All effects of two conditions on one axis, with their intervals."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peaking.study.analysis.figure_style import COLOURS, INK, LINE, MUTED, styled, wrapped
from peaking.study.analysis.measure_analysis import MeasureAnalysis
from peaking.study.analysis.words import bounded, decimal, differing_interval, short_name
from peaking.study.statistics.outcome import Effect

ROW_IN = 0.3


def forest(measures: Sequence[MeasureAnalysis], labels: Sequence[str]) -> Figure:
    """Draw the effect of each measure: one panel for Cohen's d, one for rank-biserials.

    Args:
        measures: Those with a result, of two conditions.
        labels: Of the two conditions, in their order.
    """
    kinds = {
        "d_av": ("Cohen’s d_av", decimal),
        "r_rb": ("rank-biserial r_rb", bounded),
    }
    drawn = {
        symbol: [
            (m, m.result.effects[0])
            for m in measures
            if m.result is not None and m.result.effects[0].symbol == symbol
        ]
        for symbol in kinds
    }
    present = [symbol for symbol in kinds if drawn[symbol]]
    rows = [len(drawn[symbol]) + 1 for symbol in present]
    with styled():
        figure = Figure(figsize=(7.6, sum(rows) * ROW_IN + 0.9 * len(rows)), layout="constrained")
        panels = figure.subplots(len(present), 1, squeeze=False, height_ratios=rows)
        for symbol, axes in zip(present, panels.flat, strict=True):
            name, write = kinds[symbol]
            _panel(axes, drawn[symbol], [write(e.value) for _, e in drawn[symbol]])
            axes.set_xlabel(f"{name}:  ← {labels[1]} higher    {labels[0]} higher →", fontsize=8.5)
            if symbol == "r_rb":
                axes.set_xlim(-1.05, 1.05)
            else:
                farthest = max(abs(limit) for limit in axes.get_xlim())
                axes.set_xlim(-farthest, farthest)
    return figure


def _panel(
    axes: Axes, drawn: Sequence[tuple[MeasureAnalysis, Effect]], written: Sequence[str]
) -> None:
    for y, ((analysis, effect), text) in enumerate(zip(drawn, written, strict=True)):
        low = effect.value if effect.low is None else effect.low
        high = effect.value if effect.high is None else effect.high
        surely = low > 0 or high < 0
        colour = COLOURS[0] if surely else MUTED
        axes.plot([low, high], [y, y], color=colour, linewidth=2, solid_capstyle="round")
        score = None if analysis.result is None else differing_interval(analysis.result)
        if score is not None:
            ends = [score.value if end is None else end for end in (score.low, score.high)]
            axes.plot(ends, [y, y], color=colour, linewidth=0.8)
        filled = "full" if analysis.corrected else "none"
        axes.plot(effect.value, y, "o", color=colour, markersize=6, fillstyle=filled, mew=1.4)
        axes.annotate(
            text,
            (1, y),
            xycoords=("axes fraction", "data"),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=INK,
            annotation_clip=False,
        )
    names = [wrapped(short_name(analysis.measure), 40) for analysis, _ in drawn]
    axes.set_yticks(range(len(drawn)), names, fontsize=8, color=INK)
    axes.set_ylim(len(drawn) - 0.4, -0.6)
    axes.axvline(0, color=MUTED, linewidth=0.9, zorder=0)
    axes.grid(axis="x", color=LINE, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
