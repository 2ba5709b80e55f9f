"""A copy of all data of a participant, to give to them."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import cast

from peaking.datasets.foreign_files import read_bytes
from peaking.output import replaced
from peaking.reports.csv_table import csv_text
from peaking.server import session_log
from peaking.server.store_folder import ids_of
from peaking.study.measures import measures_of
from peaking.study.privacy import no_such_participant, owners, readable_logs
from peaking.study.protocol import load_protocol
from peaking.study.records import ParticipantRecord, log_of, pseudonyms, read_events, record_of

EXPLANATION = """All data that this study has stored about {participant}.

events.jsonl     every event, one JSON line each: times, answers, positions of the phone
answers.csv      the answers to the questionnaires
measures.csv     the values computed from the events
sessions/        what was captured: photos, depth, positions of the phone

Photos that {participant} undid are not in it: they were taken back, and nobody sees them. They are
deleted with all else when {participant} asks for that.
"""

LEFT_OUT = ("mpi", "removed")
"""Folders of a session: what is made of photos, and photos that were taken back."""


def export_participant(study: Path, participant: str, out: Path) -> None:
    """Write all that is kept of a participant into a zip, without photos that were undone.

    Raises:
        StudyError: There is no such participant, or the records are damaged.
        RecordingError: A link leads out of a session's folder.
        OutputError: The zip cannot be written.
    """
    record = _record(study, participant)
    with replaced(out) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as files:
        files.writestr("README.txt", EXPLANATION.format(participant=participant))
        files.write(log_of(study, participant).path, "events.jsonl")
        files.writestr("answers.csv", _answers_csv(record))
        files.writestr("measures.csv", _measures_csv(record, study))
        for folder in _session_folders(study, participant):
            for path in sorted(folder.rglob("*")):
                name = path.relative_to(folder)
                if path.is_file() and name.parts[0] not in LEFT_OUT:
                    files.writestr(
                        f"sessions/{folder.name}/{name}", read_bytes(path, within=folder)
                    )


def _session_folders(study: Path, participant: str) -> Iterator[Path]:
    """Yield the folders of the capture sessions of a participant, those still there."""
    owner_of = owners(readable_logs(study))
    for log in sorted((study / "sessions").glob(f"*/{session_log.FILE_NAME}")):
        named = session_log.named_in(log)
        owner = None if named is None else named.owner
        if participant in ([owner] if owner else map(owner_of.get, ids_of(log.parent))):
            yield log.parent


def _record(study: Path, participant: str) -> ParticipantRecord:
    known = pseudonyms(study)
    if participant not in known:
        raise no_such_participant(study, participant, known)
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
