"""The chart of `plan_chart` as a PNG, by Matplotlib (extra `study`)."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import io

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullLocator

from peaking.guidance.plan_svg import COLOURS, EYES_M, NAMES, apart, plan_curves, ticks
from peaking.guidance.plenoptic import PlenopticBound
from peaking.guidance.viewing import Factor, Viewing

SIZE_IN, DPI = (7.6, 4.2), 200
INK, LINE = "#14181f", "#dde1e7"


def plan_picture(bound: PlenopticBound, viewing: Viewing) -> bytes:
    """Draw N over the distance of the eyes.

    Returns:
        A PNG file of 1520 × 840 pixels on a white ground.
    """
    curves = plan_curves(bound, viewing)
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(*EYES_M)
    axes.set_ylim(*curves.views_range)
    for factor, views in curves.alone.items():
        axes.plot(curves.eyes_m, views, "--", color=COLOURS[factor], linewidth=1.4)
    axes.plot(curves.eyes_m, curves.together, color=INK, linewidth=2.2)
    # Labels stand right of the axes, in shares of their height from the top.
    to_share = axes.transData + axes.transAxes.inverted()
    ends: dict[Factor, float] = {
        factor: 1 - float(to_share.transform((1.0, views[-1]))[1])
        for factor, views in curves.alone.items()
    }
    for factor, down in apart(ends, least=0.05).items():
        axes.text(
            1.02,
            1 - down,
            NAMES[factor],
            color=COLOURS[factor],
            transform=axes.transAxes,
            va="center",
        )
    planned = (viewing.eye_m, curves.planned.num_views_exact)
    axes.plot(*planned, "o", color=INK)
    axes.annotate(curves.words, planned, (8, -20), textcoords="offset points", weight="bold")
    for axis, ends_of_axis in ((axes.xaxis, EYES_M), (axes.yaxis, curves.views_range)):
        axis.set_major_locator(FixedLocator(ticks(*ends_of_axis)))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FormatStrFormatter("%g"))
    axes.grid(color=LINE)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("eyes to screen, m", loc="right")
    axes.set_ylabel("views, N", loc="top")
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=DPI)
    return out.getvalue()
