"""The events of a simulated capture, from which `measures.py` derives the numbers it was given."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from peaking.study.records import (
    AnyEvent,
    CaptureBegun,
    CaptureEnded,
    PeakedTold,
    TrackingFound,
    TrackingLost,
    ViewJoined,
    ViewTaken,
)

BETWEEN_SAMPLES_S = 1.0
"""Of the peaked share."""

LOSSES_PER_MINUTE = 0.4
LOST_S = 0.8

USUAL = {"tct_s": 60.0, "captures": 10.0, "waiting_s": 0.0, "peaked_mean": 5.0}
"""Of what is not given."""


def capture_events(
    step: str, begun_s: float, *, numbers: Mapping[str, float], rng: np.random.Generator
) -> list[AnyEvent]:
    """Take views at even distances in time, each followed by its part of the waiting.

    The peaked share falls while views are taken, about the mean that is given; now and then
    tracking is lost for a moment.

    Args:
        step: Key of the step, `t1.capture`.
        begun_s: When the shutter begins to work.
        numbers: `tct_s`, `captures` (at least 1), `waiting_s` (below tct_s), `peaked_mean` (%).
        rng: For what is not given.

    Returns:
        Events in the order of time, the last one the end of the task.
    """
    tct_s, views, waiting_s, peaked = (numbers.get(name, USUAL[name]) for name in USUAL)
    count = round(views)
    word = f"{step.replace('.', '-')}-{begun_s:.0f}"

    def at(time_s: float) -> float:
        return round(begun_s + time_s, 6)

    told: list[AnyEvent] = []
    for index in range(count):
        taken_s = tct_s * index / count
        taken, joined = at(taken_s), at(taken_s + waiting_s / count)
        capture = f"c{index}-{word}"
        told.append(
            ViewTaken(at_s=taken, id=f"v{index}-{word}", step=step, time_s=taken, capture=capture)
        )
        told.append(
            ViewJoined(
                at_s=joined, id=f"j{index}-{word}", step=step, time_s=joined, capture=capture
            )
        )
    times = np.arange(0.0, tct_s, BETWEEN_SAMPLES_S)
    shares = _shares(times / tct_s, peaked / 100, rng)
    for index, (time_s, share) in enumerate(zip(times.tolist(), shares.tolist(), strict=True)):
        told.append(
            PeakedTold(
                at_s=at(time_s),
                id=f"p{index}-{word}",
                step=step,
                time_s=at(time_s),
                peaked_share=round(share, 6),
                views=min(count, int(time_s / tct_s * count) + 1),
                wrong_share=round(2 * share / 3, 6),
                unseen_share=round(share / 3, 6),
                unfixable_share=0.0,
            )
        )
    for index in range(rng.poisson(LOSSES_PER_MINUTE * tct_s / 60)):
        lost, found = sorted(at(t) for t in _loss(index, tct_s, rng))
        told.append(TrackingLost(at_s=lost, id=f"l{index}-{word}", step=step, time_s=lost))
        told.append(TrackingFound(at_s=found, id=f"f{index}-{word}", step=step, time_s=found))
    told.sort(key=lambda event: event.at_s)
    begun = CaptureBegun(at_s=at(0.0), id=f"b-{word}", step=step, time_s=at(0.0))
    end_s = at(tct_s)
    return [begun, *told, CaptureEnded(at_s=end_s, id=f"e-{word}", step=step, time_s=end_s)]


def _shares(done: np.ndarray, mean: float, rng: np.random.Generator) -> np.ndarray:
    """Return peaked shares that fall, with the mean given (the last sample has no weight in it)."""
    shape = (0.35 + 2.2 * np.exp(-4.0 * done)) * np.exp(rng.normal(0.0, 0.35, len(done)))
    return np.minimum(shape * mean / shape[: max(1, len(shape) - 1)].mean(), 1.0)


def _loss(index: int, tct_s: float, rng: np.random.Generator) -> tuple[float, float]:
    """Return begin and end of a loss; each has its own stretch of the time, so none overlap."""
    begin = tct_s * (1 - 0.5**index) + rng.uniform(0.05, 0.15) * tct_s * 0.5**index
    return begin, min(begin + LOST_S, tct_s)
