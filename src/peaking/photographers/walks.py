"""Seeded walks through a task: people go on, dwell, turn about and return."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.photographers.tasks import Coordinates, Task

STEP_S = 0.05
SMOOTHING_S = 0.35
"""Nobody turns at a corner."""

STRIDE = 0.45
"""Deviation of where one goes next, in coordinates."""

RETURNS, TURNS, DWELLS = 0.2, 0.2, 0.45
"""How often one goes back to a place seen before, only looks elsewhere, or stays a while."""

DWELL_S = 1.6
"""Mean of how long."""


@dataclass(frozen=True)
class Walk:
    """Coordinates of a task every `STEP_S`."""

    steps: Float64[np.ndarray, "n 5"]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return (len(self.steps) - 1) * STEP_S

    def at(self, time_s: float) -> Coordinates:
        """Return where one is; before the beginning and after the end one stands still."""
        place = min(max(time_s / STEP_S, 0.0), len(self.steps) - 1.0)
        low = min(int(place), len(self.steps) - 2)
        return self.steps[low] + (place - low) * (self.steps[low + 1] - self.steps[low])


def draw_walk(
    task: Task, rng: np.random.Generator, *, seconds: float, speed_m_per_s: float
) -> Walk:
    """Draw a walk.

    Args:
        task: What is photographed.
        rng: Decides where it leads.
        seconds: How long it takes, > 0.
        speed_m_per_s: How fast one goes where one goes; turning counts as in `Task.length_m`.
    """
    here = rng.uniform(0.1, 0.9, size=5)
    stops, legs, time_s = [here], [np.repeat(here[None], 2, axis=0)], 0.0
    while time_s < seconds:
        there = _next_stop(task, here, stops, rng)
        leg_s = max(0.4, task.length_m(here, there) / speed_m_per_s)
        share = (1 - np.cos(np.linspace(0, np.pi, max(2, round(leg_s / STEP_S))))) / 2
        legs.append(here + share[:, None] * (there - here))
        dwell_s = rng.exponential(DWELL_S) if rng.random() < DWELLS else 0.0
        legs.append(np.repeat(there[None], round(dwell_s / STEP_S), axis=0))
        time_s += leg_s + dwell_s
        stops.append(there)
        here = there
    steps = np.concatenate(legs)
    smooth = cv2.GaussianBlur(
        steps, (1, 0), sigmaX=1e-9, sigmaY=SMOOTHING_S / STEP_S, borderType=cv2.BORDER_REPLICATE
    )
    return Walk(np.asarray(smooth, dtype=np.float64)[: round(seconds / STEP_S) + 1])


def _next_stop(
    task: Task, here: Coordinates, stops: list[Coordinates], rng: np.random.Generator
) -> Coordinates:
    kind = rng.random()
    there = here.copy()
    if kind < RETURNS and len(stops) > 2:
        there = stops[int(rng.integers(len(stops) - 1))] + rng.normal(0, 0.04, size=5)
    elif kind < RETURNS + TURNS:
        there[3:] += rng.normal(0, STRIDE, size=2)
    else:
        there += rng.normal(0, STRIDE, size=5)
    return within(task, there)


def within(task: Task, at: Coordinates) -> Coordinates:
    """Return coordinates inside the task: at its walls they are turned back, but not all around."""
    inside = 1 - np.abs(1 - np.mod(at, 2.0))
    free = np.array([task.circles, False, False, task.turns, False])
    return np.where(free, at, inside)
