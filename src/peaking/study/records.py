"""What happened in a study: one append-only log per participant, and what follows from it.

    STUDY/protocol.toml
    STUDY/participants/P01/events.jsonl     every event, one JSON line each, flushed to the disk
    STUDY/sessions/…                        what was captured, as `peaking serve` keeps it
    STUDY/erased.jsonl                      pseudonyms that were erased, never given again

Killed at any moment, a log holds every event that was acknowledged; a torn last line is not one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from peaking.errors import StudyError
from peaking.event_log import DamagedLine, EventLog
from peaking.study.protocol import Trial
from peaking.study.questionnaires import Answer

VERSION = 1
LOG_NAME = "events.jsonl"

Pseudonym = Annotated[str, Meta(pattern=r"^P[0-9]{2,4}$(?!\n)")]
"""P01, P02 …: given by the program, so that nobody's name is ever written."""

StepKey = Annotated[str, Meta(pattern=r"^[a-z0-9_]{1,30}(\.[a-z0-9_-]{1,50}){0,2}$(?!\n)")]
"""A step of the procedure (`procedure.py`): `consent`, `t1.capture`, `t2.ask.sus` …"""

EventId = Annotated[str, Meta(pattern=r"^[0-9a-zA-Z-]{1,64}$(?!\n)")]
"""Made by the phone or the console, so that what is sent twice is kept once."""

Who = Literal["participant", "experimenter"]


class Event(msgspec.Struct, frozen=True, tag_field="type"):
    """Something that happened, at a time of the server's clock (seconds since 1970)."""

    at_s: float


class ParticipantBegun(Event, frozen=True, omit_defaults=True, tag="ParticipantBegun"):
    """First line of every log."""

    version: int
    participant: Pseudonym
    row: int
    """Place in the counterbalanced design, from 0."""
    trials: list[Trial]
    protocol_sha256: str
    """Of the protocol.toml that was served then."""
    id: EventId | None = None
    """None in logs of version 0.1.0, and in simulated ones."""


class ConsentGiven(Event, frozen=True, tag="ConsentGiven"):
    """The participant agreed, to keeping the photos too or not."""

    images: bool
    text_sha256: str
    """Of the text that was agreed to."""


class ConsentRefused(Event, frozen=True, tag="ConsentRefused"):
    """The participant did not agree; nothing else is asked."""


class StepStarted(Event, frozen=True, tag="StepStarted"):
    """A phase began."""

    step: StepKey
    by: Who = "experimenter"


class StepFinished(Event, frozen=True, tag="StepFinished"):
    """A phase ended."""

    step: StepKey
    by: Who = "experimenter"


class StepRepeated(Event, frozen=True, omit_defaults=True, tag="StepRepeated"):
    """A phase is done once more; what came from it before does not count."""

    step: StepKey
    reason: str
    id: EventId | None = None
    """Of the repetition: the same for all steps that are done again with the one asked for."""


class DraftKept(Event, frozen=True, tag="DraftKept"):
    """A half-filled form, so that a reload loses nothing."""

    step: StepKey
    answers: dict[str, Answer]


class Answered(Event, frozen=True, tag="Answered"):
    """A questionnaire was handed in."""

    step: StepKey
    questionnaire: str
    answers: dict[str, Answer]
    language: str = "en"


class SessionLinked(Event, frozen=True, tag="SessionLinked"):
    """The capture session of a step."""

    step: StepKey
    session: str


class NoteAdded(Event, frozen=True, omit_defaults=True, tag="NoteAdded"):
    """Something the experimenter wrote down."""

    text: str
    id: EventId | None = None


class ParticipantExcluded(Event, frozen=True, tag="ParticipantExcluded"):
    """Does not count, and somebody else gets the place in the design; the data stay."""

    reason: str


class ImagesErased(Event, frozen=True, tag="ImagesErased"):
    """The photos of a session were deleted, because the participant did not agree to keep them."""

    session: str


class PhoneEvent(Event, frozen=True):
    """Told by the capture page. `time_s` is the phone's clock (seconds since 1970)."""

    id: EventId
    step: StepKey
    time_s: float


class CaptureBegun(PhoneEvent, frozen=True, tag="CaptureBegun"):
    """The first picture in which the shutter worked: the task's time begins."""


class CaptureEnded(PhoneEvent, frozen=True, tag="CaptureEnded"):
    """The participant pressed Finish: the task's time ends."""


class ViewTaken(PhoneEvent, frozen=True, tag="ViewTaken"):
    """The shutter was pressed and the photo is safe on the phone."""

    capture: str
    world_from_cam: list[float] = []
    """`[R | t]` row by row, 12 numbers (CONVENTIONS.md)."""


class ViewUndone(PhoneEvent, frozen=True, tag="ViewUndone"):
    """A view was taken back."""

    capture: str


class ViewJoined(PhoneEvent, frozen=True, tag="ViewJoined"):
    """The view takes part in the picture: communication and generation since ViewTaken are over."""

    capture: str
    acknowledged_s: float | None = None
    """When the server had it on its disk."""
    generated_s: float | None = None
    """When the phone heard that its MPI was made."""


class PeakedTold(PhoneEvent, frozen=True, tag="PeakedTold"):
    """What the page measured: about once a second, in every condition, shown or not."""

    peaked_share: float
    views: int
    world_from_cam: list[float] = []
    wrong_share: float | None = None
    """None, like the two that follow, in logs of version 0.1.0."""
    unseen_share: float | None = None
    unfixable_share: float | None = None


class TrackingLost(PhoneEvent, frozen=True, tag="TrackingLost"):
    """The phone does not know where it is."""


class TrackingFound(PhoneEvent, frozen=True, tag="TrackingFound"):
    """It knows again."""


class PageGone(PhoneEvent, frozen=True, tag="PageGone"):
    """Told afterwards: the page was closed or reloaded at `time_s` and came back at `until_s`."""

    until_s: float


class GuideTold(PhoneEvent, frozen=True, tag="GuideTold"):
    """A number that the guide shows, such as `z_min_m`."""

    name: str
    value: float


AnyPhoneEvent = (
    CaptureBegun
    | CaptureEnded
    | ViewTaken
    | ViewUndone
    | ViewJoined
    | PeakedTold
    | TrackingLost
    | TrackingFound
    | PageGone
    | GuideTold
)
AnyEvent = (
    ParticipantBegun
    | ConsentGiven
    | ConsentRefused
    | StepStarted
    | StepFinished
    | StepRepeated
    | DraftKept
    | Answered
    | SessionLinked
    | NoteAdded
    | ParticipantExcluded
    | ImagesErased
    | AnyPhoneEvent
)


@dataclass(frozen=True)
class TrialRecord:
    """What happened in one trial, without what was repeated afterwards."""

    trial: Trial
    events: Sequence[AnyEvent]
    """Of the last time each of its steps was done, in order."""
    answers: dict[str, dict[str, Answer]] = field(default_factory=dict[str, dict[str, Answer]])
    """By questionnaire, then item."""
    finished: bool = False
    """Its capture was done to the end."""


@dataclass(frozen=True)
class ParticipantRecord:
    """One participant: what is known, and nothing that is not."""

    pseudonym: str
    row: int
    trials: Sequence[TrialRecord]
    answers: dict[str, dict[str, Answer]]
    """Of the questionnaires outside trials, by questionnaire, then item."""
    consented: bool
    images: bool
    """Photos may be kept; so they may where consent is not asked for on the phone."""
    excluded: str | None
    """Why this participant does not count; None: counts."""
    sessions: Sequence[str]
    """Ids of all capture sessions, repeated ones too."""
    notes: Sequence[str]


def participant_folder(study: Path, pseudonym: str) -> Path:
    """Return where a participant's records lie, or would."""
    return study / "participants" / pseudonym


def log_of(study: Path, pseudonym: str) -> EventLog[AnyEvent]:
    """Return the log of a participant; its folder has to be there before it is appended to."""
    return EventLog(participant_folder(study, pseudonym) / LOG_NAME, AnyEvent)


def pseudonyms(study: Path) -> list[str]:
    """Return those who have a log, in order."""
    found = (study / "participants").glob(f"P*/{LOG_NAME}")
    return sorted((p.parent.name for p in found), key=lambda name: int(name[1:]))


def read_events(log: EventLog[AnyEvent]) -> list[AnyEvent]:
    """Read a participant's log and check that it is one.

    Raises:
        StudyError: A line in the middle is damaged, or it is of another version.
    """
    try:
        events = log.read()
    except DamagedLine as error:
        raise StudyError(
            log.path,
            str(error),
            remedy="it is damaged or of a newer version of peaking; put back a copy, or erase the "
            "participant",
        ) from error
    except FileNotFoundError:
        raise StudyError(
            log.path, "is not there", remedy="check the pseudonym and the folder"
        ) from None
    first = events[0] if events else None
    if not isinstance(first, ParticipantBegun):
        raise StudyError(
            log.path, "does not begin with ParticipantBegun", remedy="move the folder away"
        )
    if first.version != VERSION:
        raise StudyError(
            log.path,
            f"is {first.version}, this peaking reads {VERSION}",
            field="version",
            remedy="open it with the peaking that wrote it",
        )
    return events


def read_participants(study: Path) -> list[ParticipantRecord]:
    """Read all participants of a study's folder, excluded ones too.

    Raises:
        StudyError: A log is damaged.
    """
    return [record_of(read_events(log_of(study, name))) for name in pseudonyms(study)]


def record_of(events: Sequence[AnyEvent]) -> ParticipantRecord:
    """Gather a participant's events; the first one is ParticipantBegun."""
    begun = events[0]
    if not isinstance(begun, ParticipantBegun):
        raise ValueError(f"need a log that begins with ParticipantBegun, got {begun!r}")
    counting = _without_repeated(events)
    consent = [e for e in events if isinstance(e, ConsentGiven | ConsentRefused)]
    given = consent[-1] if consent else None
    excluded = [e.reason for e in events if isinstance(e, ParticipantExcluded)]
    if isinstance(given, ConsentRefused):
        excluded.append("did not consent")
    return ParticipantRecord(
        pseudonym=begun.participant,
        row=begun.row,
        trials=[_trial_record(trial, counting) for trial in begun.trials],
        answers=_answers([e for e in counting if not _in_trial(e, begun.trials)]),
        consented=not isinstance(given, ConsentRefused),
        images=given is None or (isinstance(given, ConsentGiven) and given.images),
        excluded=excluded[0] if excluded else None,
        sessions=[e.session for e in events if isinstance(e, SessionLinked)],
        notes=[e.text for e in events if isinstance(e, NoteAdded)],
    )


def trial_record_of(trial: Trial, events: Sequence[AnyEvent]) -> TrialRecord:
    """Gather what belongs to one trial; events of other trials and of the study may be left out."""
    return _trial_record(trial, _without_repeated(events))


def step_of(event: AnyEvent) -> str | None:
    """Return the step that an event belongs to."""
    return getattr(event, "step", None)


def _without_repeated(events: Sequence[AnyEvent]) -> list[AnyEvent]:
    """Leave out what came from a step before it was repeated, and phones' events told twice."""
    begins_at = {e.step: i for i, e in enumerate(events) if isinstance(e, StepRepeated)}
    counting: list[AnyEvent] = []
    seen: set[str] = set()
    for index, event in enumerate(events):
        if index < begins_at.get(step_of(event) or "", -1):
            continue
        if isinstance(event, PhoneEvent):
            if event.id in seen:
                continue
            seen.add(event.id)
        counting.append(event)
    return counting


def _trial_record(trial: Trial, events: Sequence[AnyEvent]) -> TrialRecord:
    own = [e for e in events if (step_of(e) or "").startswith(trial.key + ".")]
    capture = f"{trial.key}.capture"
    return TrialRecord(
        trial=trial,
        events=own,
        answers=_answers(own),
        finished=any(isinstance(e, StepFinished) and e.step == capture for e in own),
    )


def _in_trial(event: AnyEvent, trials: Sequence[Trial]) -> bool:
    return (step_of(event) or "").partition(".")[0] in [trial.key for trial in trials]


def _answers(events: Sequence[AnyEvent]) -> dict[str, dict[str, Answer]]:
    """Return the last answers of each questionnaire."""
    return {e.questionnaire: e.answers for e in events if isinstance(e, Answered)}
