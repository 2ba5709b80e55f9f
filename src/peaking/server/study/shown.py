"""What the console and a participant's phone show of an open study."""

from __future__ import annotations

import threading
from collections.abc import Callable

import msgspec

from peaking.server.study import wire
from peaking.server.study.open_participant import OpenParticipant
from peaking.server.study.open_study import OpenStudy
from peaking.study import records
from peaking.study.measures import measures_of
from peaking.study.procedure import Step
from peaking.study.protocol import Protocol, Trial
from peaking.study.records import AnyEvent, TrialRecord
from peaking.study.texts import Texts


def participant_state(participant: OpenParticipant, texts: Texts) -> wire.ParticipantState:
    """Return what the phone of a participant shows."""
    with participant.lock:
        now = participant.current
        shown = None
        if now is not None:
            shown = _shown_step(participant, now[0], running=now[1] == "running", texts=texts)
        return wire.ParticipantState(
            participant=participant.pseudonym,
            title=participant.protocol.title,
            language=texts.language,
            step=shown,
            done=participant.states.count("done"),
            total=len(participant.steps),
            refused=not participant.record.consented,
        )


def _participant_line(
    participant: OpenParticipant, trials: list[wire.TrialLine]
) -> wire.ParticipantLine:
    with participant.lock:
        record, now = participant.record, participant.current
        return wire.ParticipantLine(
            participant=participant.pseudonym,
            state="excluded" if record.excluded else "done" if now is None else now[1],
            current=None if now is None else now[0].key,
            excluded=record.excluded,
            images=record.images,
            on_phone=False,
            steps=_step_lines(participant),
            trials=trials,
            notes=list(record.notes),
        )


class ConsoleView:
    """What the console shows. A line is made anew when its events have become more, and only then.

    Events are only ever added, so their number says whether a line is up to date. For one thread
    at a time.
    """

    def __init__(self, study: OpenStudy) -> None:
        """Begin without lines."""
        self._study = study
        self._remarks: list[str] = []
        self._lines: dict[str, tuple[int, wire.ParticipantLine]] = {}
        self._trials: dict[tuple[str, str], tuple[int, wire.TrialLine]] = {}
        self._lock = threading.Lock()

    def state(
        self, phone_links: list[str], *, on_phone: Callable[[str], bool]
    ) -> wire.ConsoleState:
        """Return what it shows now; a participant is `on_phone` while a page of theirs is open."""
        with self._lock:
            participants = self._study.participants.copy()
            if not self._lines or participants.keys() != self._lines.keys():
                gone = self._lines.keys() - participants.keys()
                self._lines = {p: line for p, line in self._lines.items() if p not in gone}
                self._trials = {k: line for k, line in self._trials.items() if k[0] not in gone}
                self._remarks = self._study.remarks
            return wire.ConsoleState(
                title=self._study.protocol.title,
                planned=self._study.protocol.planned_participants,
                remarks=self._remarks,
                phone_links=phone_links,
                participants=[
                    msgspec.structs.replace(self._line(participant), on_phone=on_phone(name))
                    for name, participant in participants.items()
                ],
            )

    def _line(self, participant: OpenParticipant) -> wire.ParticipantLine:
        number, line = self._lines.get(participant.pseudonym, (0, None))
        events = len(participant.events)
        if line is None or number != events:
            trials = [self._trial(participant, t.trial) for t in participant.record.trials]
            line = _participant_line(participant, trials)
            self._lines[participant.pseudonym] = events, line
        return line

    def _trial(self, participant: OpenParticipant, trial: Trial) -> wire.TrialLine:
        key = participant.pseudonym, trial.key
        number, line = self._trials.get(key, (0, None))
        events = len(participant.events_of(trial))
        if line is None or number != events:
            line = _trial_line(participant.trial_record(trial), participant.protocol)
            self._trials[key] = events, line
        return line


def _shown_step(
    participant: OpenParticipant, step: Step, *, running: bool, texts: Texts
) -> wire.ShownStep:
    capture = None
    if step.trial is not None:
        condition = participant.protocol.condition(step.trial.condition)
        capture = wire.CaptureSetting(
            overlay=condition.overlay,
            guide=condition.guide,
            area_side_m=condition.area_side_m,
            session=participant.session(step),
        )
    return wire.ShownStep(
        key=step.key,
        kind=step.kind,
        running=running,
        text="" if step.kind == "ask" else texts.task(step.kind),
        form=None if step.questionnaire is None else texts.form(step.questionnaire),
        draft=participant.draft(step.key),
        capture=capture,
        over_camera=step.questionnaire in participant.protocol.ask.after_capture
        and step.trial is not None,
    )


def _step_lines(participant: OpenParticipant) -> list[wire.StepLine]:
    began: dict[str, float] = {}
    ended: dict[str, float] = {}
    for event in participant.sparse_events:
        match event:
            case records.StepStarted():
                began[event.step] = event.at_s
            case records.StepFinished():
                ended[event.step] = event.at_s
            case records.StepRepeated():
                began.pop(event.step, None)
                ended.pop(event.step, None)
            case _:
                pass
    return [
        wire.StepLine(
            key=step.key,
            kind=step.kind,
            label=_label(participant.protocol, step),
            state=state,
            began_s=began.get(step.key),
            ended_s=ended.get(step.key),
        )
        for step, state in zip(participant.steps, participant.states, strict=True)
    ]


def _label(protocol: Protocol, step: Step) -> str:
    if step.questionnaire is not None:
        return protocol.questionnaire(step.questionnaire).title
    return step.kind.capitalize()


def _trial_line(record: TrialRecord, protocol: Protocol) -> wire.TrialLine:
    numbers = measures_of(record, protocol)
    own: list[AnyEvent] = [
        e for e in record.events if records.step_of(e) == f"{record.trial.key}.capture"
    ]
    taken = {e.capture for e in own if isinstance(e, records.ViewTaken)}
    undone = {e.capture for e in own if isinstance(e, records.ViewUndone)}
    shares = [e.peaked_share for e in own if isinstance(e, records.PeakedTold)]
    return wire.TrialLine(
        key=record.trial.key,
        condition=protocol.condition(record.trial.condition).label,
        scene=protocol.scene(record.trial.scene).label,
        tct_s=numbers["tct_s"],
        nct_s=numbers["nct_s"],
        captures=len(taken - undone),
        peaked_share=shares[-1] if shares else None,
        tracking_losses=sum(isinstance(e, records.TrackingLost) for e in own),
    )
