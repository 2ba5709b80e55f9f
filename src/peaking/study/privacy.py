"""Whose data is whose, who was erased, and which photos may not be kept.

Copying and erasing is done where the sessions are kept: `peaking.server.study`.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec

from peaking.errors import StudyError
from peaking.event_log import EventLog
from peaking.study.records import (
    AnyEvent,
    ConsentGiven,
    ConsentRefused,
    DraftKept,
    ImagesErased,
    ParticipantExcluded,
    PhoneEvent,
    SessionLinked,
    StepFinished,
    StepRepeated,
    log_of,
    pseudonyms,
    step_of,
)

ERASED = "erased.jsonl"
SERVING = ".serving"
KEPT_FOR_REVIEW_S = 24 * 3600.0
"""So long after a participant's last step photos that may not be kept wait for their review."""

_BY_THE_PHONE = (PhoneEvent, DraftKept)
"""What a page that was left open may tell for ever."""


class ErasedParticipant(msgspec.Struct, frozen=True, omit_defaults=True):
    """A line of erased.jsonl, written before anything is deleted."""

    participant: str
    at_s: float
    sessions: list[str] = []
    """Ids of the capture sessions that are erased along."""
    id: str | None = None
    """By which the console had added the participant."""


@contextmanager
def held(study: Path) -> Generator[None, None, None]:
    """Lock a study's folder while the block runs.

    Raises:
        StudyError: The folder is not there, or another process has it.
    """
    try:
        descriptor = os.open(study / SERVING, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise StudyError(
            study, f"cannot be opened ({error.strerror})", remedy="give the folder of a study"
        ) from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise StudyError(
            study, "is being served by another process", remedy="stop that one first (Ctrl-C)"
        ) from None
    try:
        yield
    finally:
        os.close(descriptor)


def no_such_participant(study: Path, participant: str, known: Collection[str]) -> StudyError:
    """Return the error for a pseudonym that nobody has."""
    return StudyError(
        study,
        f"there is no participant {participant!r}",
        remedy=f"choose from: {', '.join(known) or 'none yet'}",
    )


def erased_log(study: Path) -> EventLog[ErasedParticipant]:
    """Return the log of erased participants."""
    return EventLog(study / ERASED, ErasedParticipant)


def read_erased(study: Path) -> tuple[list[ErasedParticipant], list[str]]:
    """Return the erased participants, and a sentence for each line that cannot be read."""
    log = erased_log(study)
    try:
        entries, damaged = log.read_around_damage()
    except FileNotFoundError:
        return [], []
    remedy = "if a participant is there who was erased, erase them again: peaking study erase"
    return entries, [f"{log.path}: {line}; {remedy}" for line in damaged]


def erased(study: Path) -> list[ErasedParticipant]:
    """Return the erased participants; their pseudonyms are never assigned again."""
    return read_erased(study)[0]


def owners(logs: Mapping[str, Sequence[AnyEvent]]) -> dict[str, str]:
    """Return whose each capture session is: of the participant who was granted it first.

    Args:
        logs: Events by pseudonym.
    """
    granted = [
        (event.at_s, pseudonym, event.session)
        for pseudonym, events in logs.items()
        for event in events
        if isinstance(event, SessionLinked)
    ]
    return {session: pseudonym for _, pseudonym, session in sorted(granted, reverse=True)}


def readable_logs(study: Path) -> dict[str, Sequence[AnyEvent]]:
    """Return the events of all participants by pseudonym, without lines that cannot be read."""
    names = pseudonyms(study)
    return {name: log_of(study, name).read_around_damage()[0] for name in names}


def sessions_to_forget(
    events: Sequence[AnyEvent], *, now_s: float, begun: Collection[str] = ()
) -> list[str]:
    """Return the capture sessions of a participant whose photos may not be kept (any longer).

    Photos that may not be kept wait for the review of their trial: until it is over, the capture is
    begun anew, consent is asked for again, the participant refuses or is excluded, or nothing
    happens for `KEPT_FOR_REVIEW_S`.

    Args:
        events: Of the participant; damaged ones may be missing.
        now_s: Seconds since 1970.
        begun: Sessions that are theirs though no event may say so.
    """
    if not refuses_images(events):
        return []
    happened_s = [e.at_s for e in events if step_of(e) and not isinstance(e, _BY_THE_PHONE)]
    left = now_s - max(happened_s, default=0.0) > KEPT_FOR_REVIEW_S or any(
        isinstance(e, ConsentRefused | ParticipantExcluded) for e in events
    )
    gone: set[str] = set()
    waiting = dict.fromkeys(begun, "")
    found = list(begun)
    for event in events:
        match event:
            case SessionLinked():
                found.append(event.session)
                waiting[event.session] = event.step
            case ImagesErased():
                gone.add(event.session)
            case StepFinished() if event.step.endswith(".review"):
                trial = event.step.removesuffix("review")
                waiting = {s: step for s, step in waiting.items() if not step.startswith(trial)}
            case StepRepeated():
                waiting = {
                    s: step for s, step in waiting.items() if event.step not in ("consent", step)
                }
            case _:
                pass
    return [s for s in dict.fromkeys(found) if s not in gone and (left or s not in waiting)]


def refuses_images(events: Sequence[AnyEvent]) -> bool:
    """Return whether the participant's last answer does not let photos be kept."""
    answers = [e for e in events if isinstance(e, ConsentGiven | ConsentRefused)]
    return bool(answers) and not (isinstance(answers[-1], ConsentGiven) and answers[-1].images)
