"""What a participant may ask for: a copy of all their data, and its erasure.

Erasing itself is done where the sessions are kept: `peaking.server.study.erasure`.
"""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import zipfile
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import msgspec

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import StudyError
from peaking.event_log import EventLog
from peaking.foreign_json import decode_json
from peaking.output import write_atomically
from peaking.reports.csv_table import csv_text
from peaking.study.measures import measures_of
from peaking.study.protocol import load_protocol
from peaking.study.records import (
    AnyEvent,
    ParticipantRecord,
    SessionLinked,
    log_of,
    pseudonyms,
    read_events,
    record_of,
)

ERASED = "erased.jsonl"
SERVING = ".serving"
EXPLANATION = """All data that this study has stored about {participant}.

events.jsonl     every event, one JSON line each: times, answers, positions of the phone
answers.csv      the answers to the questionnaires
measures.csv     the values computed from the events
sessions/        what was captured: photos, depth, positions of the phone
"""


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


def erased_log(study: Path) -> EventLog[ErasedParticipant]:
    """Return the log of erased participants."""
    return EventLog(study / ERASED, ErasedParticipant)


def erased(study: Path) -> list[ErasedParticipant]:
    """Return the erased participants; their pseudonyms are never assigned again."""
    try:
        return erased_log(study).read_around_damage()[0]
    except FileNotFoundError:
        return []


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


def export_participant(study: Path, participant: str, out: Path) -> None:
    """Write all that is kept of a participant into a zip.

    Raises:
        StudyError: There is no such participant, or the records are damaged.
        RecordingError: A link leads out of a session's folder.
        OutputError: The zip cannot be written.
    """
    record = _record(study, participant)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as files:
        files.writestr("README.txt", EXPLANATION.format(participant=participant))
        files.write(log_of(study, participant).path, "events.jsonl")
        files.writestr("answers.csv", _answers_csv(record))
        files.writestr("measures.csv", _measures_csv(record, study))
        for folder in session_folders(study, participant):
            for path in sorted(folder.rglob("*")):
                if path.is_file() and "mpi" not in path.relative_to(folder).parts:
                    data = read_bytes(path, within=folder)
                    files.writestr(f"sessions/{folder.name}/{path.relative_to(folder)}", data)
    write_atomically(out, archive.getvalue())


def session_folders(study: Path, participant: str) -> list[Path]:
    """Return the folders of the capture sessions of a participant, those still there."""
    owner_of = owners(readable_logs(study))
    found: list[Path] = []
    for log in sorted((study / "sessions").glob("*/log.jsonl")):
        with log.open("rb") as file, contextlib.suppress(ValueError):
            begun = decode_json(file.readline(), _Begun).session
            if (begun.owner or owner_of.get(begun.id)) == participant:
                found.append(log.parent)
    return found


class _NamedSession(msgspec.Struct):
    id: str
    owner: str | None = None


class _Begun(msgspec.Struct):
    """As much of a session's first line as is needed here."""

    session: _NamedSession


def _record(study: Path, participant: str) -> ParticipantRecord:
    known = pseudonyms(study)
    if participant not in known:
        raise StudyError(
            study,
            f"there is no participant {participant!r}",
            remedy=f"choose from: {', '.join(known) or 'none yet'}",
        )
    return record_of(read_events(log_of(study, participant)))


def _answers_csv(record: ParticipantRecord) -> str:
    places = [("", record.answers), *((t.trial.key, t.answers) for t in record.trials)]
    rows = [
        [trial, form, item, _plain(answer)]
        for trial, forms in places
        for form, answers in forms.items()
        for item, answer in answers.items()
    ]
    return csv_text([["trial", "questionnaire", "item", "answer"], *rows])


def _measures_csv(record: ParticipantRecord, study: Path) -> str:
    protocol = load_protocol(study)
    rows = [
        [t.trial.key, t.trial.condition, t.trial.scene, name, value]
        for t in record.trials
        for name, value in measures_of(t, protocol).items()
    ]
    return csv_text([["trial", "condition", "scene", "measure", "value"], *rows])


def _plain(value: object) -> object:
    """Return a cell: a choice of several is one text."""
    if isinstance(value, list):
        return "; ".join(str(one) for one in cast("list[object]", value))
    return value
