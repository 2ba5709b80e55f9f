"""Erasing a participant: noted first, then done, and finished at the next start if it was cut."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from peaking.errors import OutputError, StudyError
from peaking.server.devices import Devices, has_devices
from peaking.server.sessions import SessionStore
from peaking.study.privacy import (
    ErasedParticipant,
    erased_log,
    held,
    no_such_participant,
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
        StudyError: There is no such participant, the study is being served, or something is left.
        OutputError: The folder of sessions is being served.
    """
    logs = readable_logs(study)
    if participant not in logs:
        raise no_such_participant(study, participant, logs)
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
            left = finish_erasures(study, store, [entry], devices_of(store))
        finally:
            store.close()
    if left:
        raise StudyError(study, left[0], remedy="put that right, and erase them again")


def devices_of(store: SessionStore) -> Devices | None:
    """Return the devices that are paired for the sessions; None where none ever was."""
    return Devices(store.root) if has_devices(store.root) else None


def finish_erasures(
    study: Path,
    store: SessionStore,
    entries: Sequence[ErasedParticipant],
    devices: Devices | None,
) -> list[str]:
    """Erase participants as it was noted; again does nothing.

    Their own folder goes last: as long as it is there, they can be erased again.

    Returns:
        A sentence for each participant of whom something is left.
    """
    problems: list[str] = []
    for entry in entries:
        folder = participant_folder(study, entry.participant)
        try:
            for session in entry.sessions:
                store.erase(session)
            if devices is not None:
                devices.forget(entry.participant)
            if folder.exists():
                shutil.rmtree(folder)
        except (OSError, OutputError) as error:
            cause = (error.strerror if isinstance(error, OSError) else None) or str(error)
            problems.append(f"{entry.participant} is erased, and something is left ({cause})")
    return problems
