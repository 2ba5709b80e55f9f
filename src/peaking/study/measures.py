"""From the events of a trial to its numbers, named as in `measure_catalogue.py`.

TCT, the task completion time, runs from the first picture in which the shutter worked to Finish, by
the phone's clock, without the time in which the page was gone. NCT is TCT without communication
and generation: without the time in which a view that was taken had not joined the picture yet.
Waits that overlap count once. Where the condition shows nothing that depends on the views (`overlay
= "none"`), nobody waits, and NCT equals TCT, as in the paper's LLFF.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

from peaking.study.measure_catalogue import TASK_MEASURES, Measure, catalogue, column
from peaking.study.protocol import Protocol
from peaking.study.questionnaires.scoring import scores
from peaking.study.records import (
    AnyEvent,
    CaptureBegun,
    CaptureEnded,
    Event,
    PageGone,
    PeakedTold,
    PhoneEvent,
    StepFinished,
    StepStarted,
    TrackingFound,
    TrackingLost,
    TrialRecord,
    ViewJoined,
    ViewTaken,
    ViewUndone,
)

MAX_GAP_S = 5.0
"""A longer silence between two samples of the peaked share is not bridged."""

Interval = tuple[float, float]
E = TypeVar("E", bound=Event)


def catalogue_of(protocol: Protocol) -> list[Measure]:
    """Return every measure that a trial of this study has, in the order of the tables."""
    return catalogue([protocol.questionnaire(name) for name in protocol.ask.in_trial()])


def measures_of(trial: TrialRecord, protocol: Protocol) -> dict[str, float | None]:
    """Return the numbers of one trial, by the names of `catalogue`; None: not known."""
    found = _task_measures(trial, protocol)
    for name in protocol.ask.in_trial():
        form = protocol.questionnaire(name)
        for score, value in scores(form, trial.answers.get(name, {})).items():
            found[column(form, score)] = value
    return found


def peaked_over_time(trial: TrialRecord) -> list[tuple[float, float]]:
    """Return (seconds since the task began, peaked share 0 … 1) of all samples of the capture."""
    begun = _first(trial.events, CaptureBegun)
    if begun is None:
        return []
    return [(e.time_s - begun.time_s, e.peaked_share) for e in _samples(trial)]


def _task_measures(trial: TrialRecord, protocol: Protocol) -> dict[str, float | None]:
    task = _task_interval(trial)
    found: dict[str, float | None] = dict.fromkeys((m.name for m in TASK_MEASURES), None)
    found["scan_s"] = _step_seconds(trial, "scan")
    if not trial.finished:
        return found
    capture = _of_step(trial, "capture")
    taken = [e for e in capture if isinstance(e, ViewTaken)]
    undone = {e.capture for e in capture if isinstance(e, ViewUndone)}
    found["captures"] = float(len({e.capture for e in taken} - undone))
    found["undone"] = float(len(undone))
    found["tracking_losses"] = float(sum(isinstance(e, TrackingLost) for e in capture))
    samples = _samples(trial)
    found["peaked_last"] = 100 * samples[-1].peaked_share if samples else None
    found["peaked_mean"] = _mean_over_time(samples)
    found["peaked_at_shutter"] = _at_shutter(samples, taken)
    if task is None:
        return found
    gone = _union([(e.time_s, e.until_s) for e in capture if isinstance(e, PageGone)], task)
    found["interrupted_s"] = _length(gone)
    found["tct_s"] = task[1] - task[0] - _length(gone)
    waiting = 0.0
    if protocol.condition(trial.trial.condition).overlay == "peaks":
        # What was waited for while the page was gone is already left out of TCT.
        waits = _waits(capture, task[1])
        waiting = _length(_union([*waits, *gone], task)) - _length(gone)
    found["waiting_s"] = waiting
    found["nct_s"] = found["tct_s"] - waiting
    found["tracking_lost_s"] = _length(_union(_lost(capture, task[1]), task))
    return found


def _task_interval(trial: TrialRecord) -> Interval | None:
    """Return begin and end of the task by one clock: the phone's, else the server's."""
    begun, ended = _first(trial.events, CaptureBegun), _first(trial.events, CaptureEnded)
    if begun is not None and ended is not None:
        return begun.time_s, max(ended.time_s, begun.time_s)
    # Stopped from the console: the phone's clock at that moment is not known, the offset is.
    stops = [e for e in _of_step(trial, "capture") if isinstance(e, StepFinished)]
    if begun is None or not stops:
        return None
    return begun.time_s, max(begun.time_s + stops[-1].at_s - begun.at_s, begun.time_s)


def _step_seconds(trial: TrialRecord, kind: str) -> float | None:
    events = _of_step(trial, kind)
    started, finished = _first(events, StepStarted), _first(events, StepFinished)
    if started is None or finished is None:
        return None
    return max(finished.at_s - started.at_s, 0.0)


def _waits(events: Sequence[AnyEvent], end_s: float) -> list[Interval]:
    """Return from when to when each view was on its way into the picture."""
    until: dict[str, float] = {}
    for event in events:
        if isinstance(event, ViewJoined | ViewUndone):
            until.setdefault(event.capture, event.time_s)
    taken = [e for e in events if isinstance(e, ViewTaken)]
    return [(e.time_s, until.get(e.capture, end_s)) for e in taken]


def _lost(events: Sequence[AnyEvent], end_s: float) -> list[Interval]:
    found: list[Interval] = []
    since: float | None = None
    for event in events:
        if isinstance(event, TrackingLost) and since is None:
            since = event.time_s
        elif isinstance(event, TrackingFound) and since is not None:
            found.append((since, event.time_s))
            since = None
    return found if since is None else [*found, (since, end_s)]


def _union(intervals: Iterable[Interval], within: Interval) -> list[Interval]:
    """Return the intervals inside `within`, joined where they overlap."""
    inside = sorted((max(a, within[0]), min(b, within[1])) for a, b in intervals)
    joined: list[Interval] = []
    for begin, end in inside:
        if end <= begin:
            continue
        if joined and begin <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((begin, end))
    return joined


def _length(intervals: Iterable[Interval]) -> float:
    return sum((end - begin for begin, end in intervals), start=0.0)


def _samples(trial: TrialRecord) -> list[PeakedTold]:
    found = [e for e in _of_step(trial, "capture") if isinstance(e, PeakedTold)]
    return sorted(found, key=lambda e: e.time_s)


def _mean_over_time(samples: Sequence[PeakedTold]) -> float | None:
    """Return the mean share in per cent; a sample holds until the next one."""
    weights = [min(after.time_s - before.time_s, MAX_GAP_S) for before, after in pairwise(samples)]
    if not samples:
        return None
    if sum(weights) <= 0:
        return 100 * samples[-1].peaked_share
    shares = [s.peaked_share for s in samples[:-1]]
    return 100 * sum(w * s for w, s in zip(weights, shares, strict=True)) / sum(weights)


def _at_shutter(samples: Sequence[PeakedTold], taken: Sequence[ViewTaken]) -> float | None:
    found: list[float] = []
    for view in taken:
        before = [s for s in samples if s.time_s <= view.time_s]
        if before:
            found.append(before[-1].peaked_share)
    return 100 * sum(found) / len(found) if found else None


def _of_step(trial: TrialRecord, kind: str) -> list[AnyEvent]:
    key = f"{trial.trial.key}.{kind}"
    own = [e for e in trial.events if getattr(e, "step", None) == key]
    # A phone that was offline tells late; its own clock knows the order.
    return sorted(own, key=lambda e: e.time_s if isinstance(e, PhoneEvent) else e.at_s)


def _first(events: Sequence[AnyEvent], kind: type[E]) -> E | None:
    return next((e for e in events if isinstance(e, kind)), None)
