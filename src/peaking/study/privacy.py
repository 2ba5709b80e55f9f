"""What a participant may ask for: a copy of all their data, and its deletion."""

from __future__ import annotations

import fcntl
import io
import os
import shutil
import time
import zipfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import msgspec

from peaking import event_log
from peaking.errors import StudyError
from peaking.output import write_atomically
from peaking.reports.csv_table import csv_text
from peaking.study.measures import measures_of
from peaking.study.protocol import load_protocol
from peaking.study.records import (
    ParticipantRecord,
    log_of,
    participant_folder,
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


@contextmanager
def held(study: Path) -> Generator[None, None, None]:
    """Lock a study's folder while the block runs.

    Raises:
        StudyError: The folder is not there, or another process has it.
    """
    try:
        descriptor = os.open(study / SERVING, os.O_RDWR | os.O_CREAT, 0o644)
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


def erased(study: Path) -> list[str]:
    """Return the pseudonyms of erased participants; they are never assigned again."""
    path = study / ERASED
    if not path.is_file():
        return []
    lines = path.read_bytes().split(b"\n")[:-1]
    return [msgspec.json.decode(line)["participant"] for line in lines]


def export_participant(study: Path, participant: str, out: Path) -> None:
    """Write all that is kept of a participant into a zip.

    Raises:
        StudyError: There is no such participant, or the records are damaged.
        OutputError: The zip cannot be written.
    """
    record = _record(study, participant)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as files:
        files.writestr("README.txt", EXPLANATION.format(participant=participant))
        files.write(log_of(study, participant).path, "events.jsonl")
        files.writestr("answers.csv", _answers_csv(record))
        files.writestr("measures.csv", _measures_csv(record, study))
        for folder in session_folders(study, record):
            for path in sorted(folder.rglob("*")):
                if path.is_file() and "mpi" not in path.relative_to(folder).parts:
                    files.write(path, f"sessions/{folder.name}/{path.relative_to(folder)}")
    write_atomically(out, archive.getvalue())


def erase_participant(
    study: Path, participant: str, *, clock: Callable[[], float] = time.time
) -> None:
    """Delete all that is kept of a participant, photos too; only the pseudonym stays taken.

    Raises:
        StudyError: There is no such participant, or the study is being served.
    """
    record = _record(study, participant)
    with held(study):
        gone = msgspec.json.encode({"participant": participant, "at_s": clock()}) + b"\n"
        event_log.append(study / ERASED, gone, durably=True)
        for folder in [*session_folders(study, record), participant_folder(study, participant)]:
            shutil.rmtree(folder)


def session_folders(study: Path, record: ParticipantRecord) -> list[Path]:
    """Return the folders of the capture sessions of a participant, those still there."""
    wanted = set(record.sessions)
    found: list[Path] = []
    for log in sorted((study / "sessions").glob("*/log.jsonl")):
        with log.open("rb") as file:
            begun = msgspec.json.decode(file.readline())
        if begun.get("session", {}).get("id") in wanted:
            found.append(log.parent)
    return found


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
