"""One participant of a study that is run: what may happen next, each event on the disk first."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from peaking.errors import PeakingError, StudyError
from peaking.server.study import wire
from peaking.study import records
from peaking.study.privacy import sessions_to_forget
from peaking.study.procedure import (
    Step,
    StepState,
    current,
    repeated_with,
    states_of,
    steps_of,
)
from peaking.study.protocol import FILE_NAME, Protocol, Trial
from peaking.study.questionnaires import Answer, problems
from peaking.study.records import (
    AnyEvent,
    ParticipantRecord,
    TrialRecord,
    record_of,
    trial_record_of,
)

CAPTURING = ("practice", "scan", "capture")
"""Kinds of steps that have a capture session."""

MAX_SESSIONS = 500
"""Capture sessions of one participant: a page that is reloaded begins another."""

E = TypeVar("E", bound=records.Event)


MAX_DRAFT_BYTES = 200_000
MAX_DRAFTS_BYTES = 20_000_000
"""Of one change of a half-filled form, and of all that one participant makes."""

MAX_TOLD = 100_000
"""Events that one participant's phone tells: a day of them."""


class TooMuch(PeakingError):
    """More is sent than anybody types or does; it is not kept."""


class NotNow(PeakingError):
    """Something was asked that does not fit the step; the page shows an older state."""


class Incomplete(PeakingError):
    """A form is not complete; `items` says what is wrong where."""

    def __init__(self, items: dict[str, str]) -> None:
        """Keep what is wrong."""
        super().__init__("Some answers are missing or not valid.")
        self.items = items


class OpenParticipant:
    """One participant and their log. May be used from several threads."""

    def __init__(
        self, study: Path, pseudonym: str, *, protocol: Protocol, clock: Callable[[], float]
    ) -> None:
        """Open a log.

        Raises:
            StudyError: The log is damaged.
        """
        self.pseudonym = pseudonym
        self.protocol = protocol
        self.lock = threading.RLock()
        self._clock = clock
        self._log = records.log_of(study, pseudonym)
        self.events: list[AnyEvent] = []
        self.sparse_events: list[AnyEvent] = []
        self._of_trials: dict[str, list[AnyEvent]] = {}
        self._drafts: dict[str, dict[str, Answer]] = {}
        self._draft_bytes = 0
        self._take(records.read_events(self._log))
        self._check_trials(study)
        self.steps = steps_of(protocol, [t.trial for t in self.record.trials])
        self._told = {e.id for e in self.events if isinstance(e, records.PhoneEvent)}

    @property
    def record(self) -> ParticipantRecord:
        """What is known now, without what phones tell all the time; see `trial_record`."""
        return record_of(self.sparse_events)

    def trial_record(self, trial: Trial) -> TrialRecord:
        """Return all that is known of one trial, in time linear in its events alone."""
        return trial_record_of(trial, self.events_of(trial))

    def events_of(self, trial: Trial) -> Sequence[AnyEvent]:
        """Return the events of the steps of a trial."""
        return self._of_trials.get(trial.key, [])

    @property
    def id(self) -> str | None:
        """Made by the console that added this participant; logs of before have none."""
        return self._begun.id

    @property
    def protocol_sha256(self) -> str:
        """Digest of the protocol under which this participant began."""
        return self._begun.protocol_sha256

    @property
    def current(self) -> tuple[Step, StepState] | None:
        """The step that is next or running."""
        return current(self.steps, self.sparse_events)

    @property
    def states(self) -> list[StepState]:
        """Where each step stands."""
        return states_of(self.steps, self.sparse_events)

    def draft(self, step: str) -> dict[str, Answer]:
        """Return what was filled in so far."""
        return dict(self._drafts.get(step, {}))

    @property
    def agreed(self) -> bool:
        """Whether what is captured may be kept at all: where consent is asked for, it was given."""
        if "consent" not in [step.key for step in self.steps]:
            return True
        return self.record.consented and bool(self._events_of(records.ConsentGiven))

    def session(self, step: Step) -> str | None:
        """Return the capture session last begun for the trial of a step, or for its practice.

        None where it was erased before the review was over: another one has to be begun.
        """
        if step.trial is None:
            return None
        kinds = ("practice",) if step.kind == "practice" else ("scan", "capture")
        keys = [f"{step.trial.key}.{kind}" for kind in kinds]
        found = None
        for event in self.sparse_events:
            if isinstance(event, records.SessionLinked) and event.step in keys:
                found = event.session
            elif isinstance(event, records.StepRepeated) and event.step in keys:
                found = None
        reviewed = self.is_done(f"{step.trial.key}.review")
        erased = [e.session for e in self._events_of(records.ImagesErased)]
        return None if found in erased and not reviewed else found

    # The experimenter

    def start(self, step: str) -> None:
        """Start a phase; again does nothing.

        Raises:
            NotNow: It is another step's turn.
        """
        with self.lock:
            if self._expect(step) == "waiting":
                self._append(records.StepStarted(self._clock(), step=step))

    def stop(self, step: str, *, by: records.Who) -> None:
        """End a phase; when it is over already, does nothing.

        Raises:
            NotNow: It has not begun, or it is another step's turn.
        """
        with self.lock:
            if self.is_done(step):
                return
            if self._expect(step) != "running":
                raise NotNow("This part has not started yet.")
            if self._step(step).kind == "consent":
                raise NotNow("The participant answers this on the phone.")
            self._append(records.StepFinished(self._clock(), step=step, by=by))

    def repeat(self, step: str, reason: str, *, new_id: str) -> None:
        """Do a step again, and all that were begun after it; the same id again does nothing.

        Raises:
            NotNow: It has not been done yet.
        """
        with self.lock:
            self._step(step)
            if (new_id, step) in [(e.id, e.step) for e in self._events_of(records.StepRepeated)]:
                return
            again = repeated_with(self.steps, step, self.sparse_events)
            if not again:
                raise NotNow("This part has not been done yet.")
            at_s = self._clock()
            # The step itself comes last: if a power cut keeps only some, the rest is done when the
            # console sends it again.
            for_each = [
                records.StepRepeated(at_s, step=key, reason=reason, id=new_id)
                for key in reversed(again)
            ]
            self._append(*for_each)

    def note(self, text: str, *, new_id: str) -> None:
        """Keep a note of the experimenter; the same id again does nothing."""
        with self.lock:
            if new_id not in [e.id for e in self._events_of(records.NoteAdded)]:
                self._append(records.NoteAdded(self._clock(), text=text, id=new_id))

    def exclude(self, reason: str) -> None:
        """Let the participant not count, once; their place in the design is given again."""
        with self.lock:
            if self.record.excluded is None:
                self._append(records.ParticipantExcluded(self._clock(), reason=reason))

    # The participant

    def consent(self, answer: wire.Consent) -> None:
        """Keep the answer to the consent page; a second one does nothing.

        Raises:
            NotNow: It is another step's turn.
        """
        with self.lock:
            if self.is_done("consent") or self.current is None:
                return
            self._expect("consent")
            at_s = self._clock()
            if not answer.agreed:
                self._append(records.ConsentRefused(at_s))
                return
            digest = hashlib.sha256(self.protocol.consent.encode()).hexdigest()
            self._append(
                records.ConsentGiven(at_s, images=answer.images, text_sha256=digest),
                records.StepFinished(at_s, step="consent", by="participant"),
            )

    def keep_draft(self, step: str, draft: wire.Draft) -> None:
        """Keep what was filled in so far; after the form was handed in, does nothing.

        Raises:
            NotNow: It is another step's turn.
        """
        with self.lock:
            if self.is_done(step):
                return
            self._expect(step)
            form = self._form(step)
            known = {item.id for item in form.items}
            answers = {name: value for name, value in draft.answers.items() if name in known}
            before = self._drafts.get(step, {})
            answers = {name: a for name, a in answers.items() if before.get(name, ...) != a}
            if answers:
                size = len(msgspec.json.encode(answers))
                if size > MAX_DRAFT_BYTES or self._draft_bytes + size > MAX_DRAFTS_BYTES:
                    raise TooMuch("Too much was typed here to keep it all. Hand the form in.")
                self._append(records.DraftKept(self._clock(), step=step, answers=answers))

    def answer(self, step: str, given: wire.Answered) -> None:
        """Keep a form that was handed in; a second time does nothing.

        Raises:
            NotNow: It is another step's turn.
            Incomplete: An answer is missing or not possible.
        """
        with self.lock:
            if self.is_done(step):
                return
            self._expect(step)
            form = self._form(step)
            wrong = problems(form, given.answers)
            if wrong:
                raise Incomplete(wrong)
            at_s = self._clock()
            self._append(
                records.Answered(
                    at_s,
                    step=step,
                    questionnaire=form.name,
                    answers=given.answers,
                    language=self.protocol.language,
                ),
                records.StepFinished(at_s, step=step, by="participant"),
            )

    def link(self, step: str, begun: wire.SessionBegun) -> None:
        """Remember the capture session of a step; again does nothing.

        Raises:
            NotNow: It is another step's turn.
        """
        with self.lock:
            self._expect(step)
            if self._step(step).kind not in CAPTURING:
                raise NotNow("Nothing is captured in this part.")
            if len(self._events_of(records.SessionLinked)) >= MAX_SESSIONS:
                raise NotNow("This participant has begun too many captures.")
            if self.session(self._step(step)) != begun.session:
                self._append(records.SessionLinked(self._clock(), step=step, session=begun.session))

    def tell(self, told: Sequence[wire.Told], *, session: str) -> None:
        """Keep what happened on the phone, each event once; it may come late, from any step.

        Not kept is what comes after its step was begun anew: it belongs to what does not count.

        Raises:
            NotNow: The participant has not agreed to take part.
        """
        with self.lock:
            if not self.agreed:
                raise NotNow("This participant has not agreed to take part: nothing is kept.")
            known = {step.key for step in self.steps} - self._repeated_since(session)
            new = {e.id: e for e in told if e.id not in self._told and e.step in known}
            if len(self._told) + len(new) > MAX_TOLD:
                raise TooMuch("This participant's phone has told too much to keep more of it.")
            if new:
                at_s = self._clock()
                self._append(*[_phone_event(event, at_s) for event in new.values()])
                self._told.update(new)

    def sessions_to_forget(self) -> list[str]:
        """Return sessions whose photos may not be kept any longer, and are still there."""
        with self.lock:
            return sessions_to_forget(self.sparse_events, now_s=self._clock())

    def images_erased(self, session: str) -> None:
        """Remember that the photos of a session are gone."""
        with self.lock:
            self._append(records.ImagesErased(self._clock(), session=session))

    def is_done(self, step: str) -> bool:
        """Return whether a step is over."""
        with self.lock:
            keys = [s.key for s in self.steps]
            return step in keys and self.states[keys.index(step)] == "done"

    # Inside

    @property
    def _begun(self) -> records.ParticipantBegun:
        begun = self.events[0]
        assert isinstance(begun, records.ParticipantBegun)
        return begun

    def _events_of(self, kind: type[E]) -> list[E]:
        return [event for event in self.sparse_events if isinstance(event, kind)]

    def _repeated_since(self, session: str) -> set[str]:
        """Return the steps that were repeated after a capture session was begun."""
        linked = [
            index
            for index, event in enumerate(self.sparse_events)
            if isinstance(event, records.SessionLinked) and event.session == session
        ]
        later = self.sparse_events[linked[-1] :] if linked else []
        return {event.step for event in later if isinstance(event, records.StepRepeated)}

    def _check_trials(self, study: Path) -> None:
        conditions = {condition.name for condition in self.protocol.conditions}
        for trial in self.record.trials:
            if trial.trial.condition not in conditions:
                raise StudyError(
                    study / FILE_NAME,
                    f"{self.pseudonym} does {trial.trial.condition!r}, which is no longer there",
                    field="conditions",
                    remedy="put it back, or begin a new study in another folder",
                )

    def _append(self, *events: AnyEvent) -> None:
        self._log.append(*events)
        self._take(events)

    def _take(self, events: Sequence[AnyEvent]) -> None:
        """Remember events by what asks for them; thousands of them are phones' and drafts."""
        trials = set(self._of_trials)
        if not self.events:
            begun = events[0]
            assert isinstance(begun, records.ParticipantBegun)
            trials = {trial.key for trial in begun.trials}
            self._of_trials = {key: [] for key in trials}
        for event in events:
            if isinstance(event, records.DraftKept):
                self._drafts.setdefault(event.step, {}).update(event.answers)
                self._draft_bytes += len(msgspec.json.encode(event.answers))
            elif not isinstance(event, records.PhoneEvent):
                self.sparse_events.append(event)
            if isinstance(event, records.StepRepeated):
                self._drafts.pop(event.step, None)
            trial = (records.step_of(event) or "").partition(".")[0]
            if trial in trials:
                self._of_trials[trial].append(event)
        self.events += events

    def _step(self, key: str) -> Step:
        found = [step for step in self.steps if step.key == key]
        if not found:
            raise NotNow("There is no such part in this study.")
        return found[0]

    def _expect(self, key: str) -> StepState:
        self._step(key)
        now = self.current
        if now is None or now[0].key != key:
            raise NotNow("Another part is due now: this page was out of date.")
        return now[1]

    def _form(self, key: str) -> wire.Questionnaire:
        name = self._step(key).questionnaire
        if name is None:
            raise NotNow("This part has no form.")
        return self.protocol.questionnaire(name)


def _phone_event(told: wire.Told, at_s: float) -> AnyEvent:
    kind = getattr(records, told.kind)
    fields = {
        name: value
        for name in kind.__struct_fields__
        if name not in ("at_s", "id", "step", "time_s")
        and (value := getattr(told, name)) is not None
    }
    try:
        return kind(at_s=at_s, id=told.id, step=told.step, time_s=told.time_s, **fields)
    except TypeError as error:
        raise NotNow(f"{told.kind}: {error}.") from error
