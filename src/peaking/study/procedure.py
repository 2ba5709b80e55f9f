"""The steps of one participant, in order, and which of them is next: a pure function of the log.

consent, start.ask.demographics, introduction,
t1.practice, t1.scan, t1.capture, t1.ask.paper_before, t1.review, t1.ask.sus …, t2.practice …,
end.ask.comments
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from peaking.study.protocol import Protocol, Trial
from peaking.study.records import (
    AnyEvent,
    ConsentRefused,
    ParticipantExcluded,
    StepFinished,
    StepRepeated,
    StepStarted,
)

Kind = Literal["consent", "ask", "introduction", "practice", "scan", "capture", "review"]
StepState = Literal["waiting", "running", "done"]


@dataclass(frozen=True)
class Step:
    """One phase."""

    key: str
    kind: Kind
    trial: Trial | None = None
    questionnaire: str | None = None

    @property
    def self_paced(self) -> bool:
        """Begins by itself, and the participant ends it."""
        return self.kind in ("consent", "ask")


def steps_of(protocol: Protocol, trials: Sequence[Trial]) -> list[Step]:
    """Return what a participant with these trials goes through."""
    steps: list[Step] = []
    if protocol.consent.strip():
        steps.append(Step("consent", "consent"))
    steps += [_ask("start", name) for name in protocol.ask.at_start]
    if protocol.tasks.introduction.strip():
        steps.append(Step("introduction", "introduction"))
    for trial in trials:
        steps += _trial_steps(protocol, trial)
    return steps + [_ask("end", name) for name in protocol.ask.at_end]


def states_of(steps: Sequence[Step], events: Sequence[AnyEvent]) -> list[StepState]:
    """Return where each step stands: those before the current one are done, those after wait."""
    started: set[str] = set()
    finished: set[str] = set()
    for event in events:
        match event:
            case StepStarted():
                started.add(event.step)
            case StepFinished():
                finished.add(event.step)
            case StepRepeated():
                started.discard(event.step)
                finished.discard(event.step)
            case _:
                pass
    states: list[StepState] = []
    for step in steps:
        earlier_done = all(state == "done" for state in states)
        if step.key in finished and earlier_done:
            states.append("done")
        elif earlier_done and (step.key in started or step.self_paced):
            states.append("running")
        else:
            states.append("waiting")
    return states


def current(steps: Sequence[Step], events: Sequence[AnyEvent]) -> tuple[Step, StepState] | None:
    """Return the step that is next or running; None when all is done, or somebody left."""
    if any(isinstance(event, ConsentRefused | ParticipantExcluded) for event in events):
        return None
    for step, state in zip(steps, states_of(steps, events), strict=True):
        if state != "done":
            return step, state
    return None


def repeated_with(steps: Sequence[Step], step: str, events: Sequence[AnyEvent]) -> list[str]:
    """Return which steps have to be done again when `step` is: it and all begun after it."""
    keys = [s.key for s in steps]
    begun = {
        s.key
        for s, state in zip(steps, states_of(steps, events), strict=True)
        if state != "waiting"
    }
    return [key for key in keys[keys.index(step) :] if key in begun]


def _trial_steps(protocol: Protocol, trial: Trial) -> list[Step]:
    condition = protocol.condition(trial.condition)
    kinds: list[Kind] = []
    if protocol.tasks.practice.strip():
        kinds.append("practice")
    if condition.scan:
        kinds.append("scan")
    kinds.append("capture")
    steps = [Step(f"{trial.key}.{kind}", kind, trial) for kind in kinds]
    steps += [_ask(trial.key, name, trial) for name in protocol.ask.after_capture]
    steps.append(Step(f"{trial.key}.review", "review", trial))
    return steps + [_ask(trial.key, name, trial) for name in protocol.ask.after_review]


def _ask(where: str, questionnaire: str, trial: Trial | None = None) -> Step:
    return Step(f"{where}.ask.{questionnaire}", "ask", trial, questionnaire)
