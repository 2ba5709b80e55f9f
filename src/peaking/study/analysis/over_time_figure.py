"""The peaked share while the task goes on, by condition."""

# Matplotlib is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure

from peaking.study.analysis.figure_style import LINE, colour_of, styled
from peaking.study.measures import peaked_over_time
from peaking.study.tables import Study

STEPS = 101
"""Places on the axis of progress, from 0 to 100 %."""


def curves_of(study: Study) -> dict[str, Float64[np.ndarray, "trials steps"]]:
    """Return the peaked share of every finished trial over its progress, by condition, in %."""
    found: dict[str, list[np.ndarray]] = {c.name: [] for c in study.protocol.conditions}
    for participant in study.counting:
        for trial in participant.trials:
            samples = peaked_over_time(trial)
            if trial.finished and len(samples) > 1:
                found[trial.trial.condition].append(progress_curve(samples))
    return {name: np.array(curves) for name, curves in found.items() if curves}


def progress_curve(samples: Sequence[tuple[float, float]]) -> Float64[np.ndarray, "steps"]:
    """Return shares in % at evenly spaced progress; a sample holds until the next one.

    Args:
        samples: (seconds since the task began, share 0…1), at least one, in order.
    """
    times_s = np.array([time_s for time_s, _ in samples])
    shares = np.array([share for _, share in samples])
    at_s = np.linspace(times_s[0], times_s[-1], STEPS)
    return 100 * shares[np.searchsorted(times_s, at_s, side="right") - 1]


def over_time(
    curves: Mapping[str, Float64[np.ndarray, "trials steps"]], labels: Mapping[str, str]
) -> Figure:
    """Draw median and quartiles over the trials of each condition.

    Args:
        curves: By name of the condition, see `curves_of`.
        labels: Of all conditions, by name, in their order.
    """
    progress = np.linspace(0, 100, STEPS)
    with styled():
        figure = Figure(figsize=(7.6, 3.2), layout="constrained")
        axes = figure.subplots()
        for index, (name, label) in enumerate(labels.items()):
            if name not in curves:
                continue
            low, middle, high = np.quantile(curves[name], (0.25, 0.5, 0.75), axis=0)
            colour = colour_of(index)
            axes.fill_between(progress, low, high, color=colour, alpha=0.16, linewidth=0)
            axes.plot(progress, middle, color=colour, linewidth=1.8, label=label)
        axes.set_xlim(0, 100)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Progress of the task, %")
        axes.set_ylabel("Peaked share, %")
        axes.grid(axis="y", color=LINE, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(frameon=False)
    return figure
