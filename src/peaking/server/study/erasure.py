"""Erasing a participant: noted first, then done, and finished at the next start if it was cut."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path

from peaking.errors import StudyError
from peaking.server.sessions import SessionStore
from peaking.study.privacy import (
    ErasedParticipant,
    erased,
    erased_log,
    held,
    owners,
    readable_logs,
)
from peaking.study.records import ParticipantBegun, participant_folder


def erase_participant(
    study: Path, participant: str, *, clock: Callable[[], float] = time.time
) -> None:
    """Erase all that is kept of a participant, photos too; only the pseudonym stays taken.

    A participant whose log is damaged is erased all the same.

    Raises:
        StudyError: There is no such participant, or the study is being served.
        OutputError: The folder of sessions is being served.
    """
    logs = readable_logs(study)
    if participant not in logs:
        raise StudyError(
            study,
            f"there is no participant {participant!r}",
            remedy=f"choose from: {', '.join(logs) or 'none yet'}",
        )
    with held(study):
        store = SessionStore(study / "sessions")
        try:
            begun = [e for e in logs[participant] if isinstance(e, ParticipantBegun)]
            granted = [session for session, who in owners(logs).items() if who == participant]
            begun_by = [s.id for s in store.all_sessions() if s.owner == participant]
            entry = ErasedParticipant(
                participant=participant,
                at_s=clock(),
                sessions=sorted({*granted, *begun_by}),
                id=begun[0].id if begun else None,
            )
            erased_log(study).append(entry)
            finish_erasures(study, store)
        finally:
            store.close()


def finish_erasures(study: Path, store: SessionStore) -> None:
    """Do what is noted in erased.jsonl; again does nothing.

    Raises:
        OSError: Something cannot be deleted.
    """
    for entry in erased(study):
        for session in entry.sessions:
            store.erase(session)
        folder = participant_folder(study, entry.participant)
        if folder.exists():
            shutil.rmtree(folder)
