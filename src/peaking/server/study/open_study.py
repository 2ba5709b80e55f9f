"""A study that is being run: its folder, its participants, and nobody else at the same time."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable
from pathlib import Path

from peaking.errors import PeakingError
from peaking.server.study.open_participant import OpenParticipant
from peaking.study import records
from peaking.study.privacy import erased
from peaking.study.protocol import FILE_NAME, load_protocol, remarks, trials_of
from peaking.study.texts import Texts


class UnknownParticipant(PeakingError):
    """There is nobody of this pseudonym."""


class OpenStudy:
    """A study's folder; whoever opens it holds it (`privacy.held`)."""

    def __init__(self, folder: Path, *, clock: Callable[[], float] = time.time) -> None:
        """Open it.

        Raises:
            StudyError: The protocol, a translation or a log cannot be used.
        """
        self.folder = folder
        self.protocol = load_protocol(folder)
        self.texts = Texts(self.protocol, folder)
        self._digest = hashlib.sha256((folder / FILE_NAME).read_bytes()).hexdigest()
        self._clock = clock
        self._lock = threading.RLock()
        found = [self._open(name) for name in records.pseudonyms(folder)]
        self.participants = {p.pseudonym: p for p in found}

    @property
    def remarks(self) -> list[str]:
        """Return sentences that the experimenter should know."""
        said = remarks(self.protocol)
        others = [
            p.pseudonym for p in self.participants.values() if p.protocol_sha256 != self._digest
        ]
        if others:
            said.append(
                f"{FILE_NAME} was changed after {', '.join(others)} began: their procedure may "
                "differ from that of the others."
            )
        missing = self.texts.untranslated()
        if missing:
            said.append(
                f"Some texts ({len(missing)}) have no translation into "
                f"{self.protocol.language!r} and are shown in English. The first is {missing[0]}."
            )
        return said

    def get(self, pseudonym: str) -> OpenParticipant:
        """Return a participant.

        Raises:
            UnknownParticipant: There is nobody of this pseudonym.
        """
        with self._lock:
            if pseudonym not in self.participants:
                raise UnknownParticipant("There is no such participant in this study.")
            return self.participants[pseudonym]

    def add(self, new_id: str) -> tuple[OpenParticipant, bool]:
        """Begin a participant: the next pseudonym, and the first free place in the design.

        Args:
            new_id: Made by the console. The same id is the same participant.

        Returns:
            The participant, and whether they are new.
        """
        with self._lock:
            for known in self.participants.values():
                if known.id == new_id:
                    return known, False
            number = 1 + max(
                (int(p[1:]) for p in [*self.participants, *erased(self.folder)]), default=0
            )
            taken = {p.record.row for p in self.participants.values() if not p.record.excluded}
            row = next(place for place in range(len(taken) + 1) if place not in taken)
            pseudonym = f"P{number:02d}"
            begun = records.ParticipantBegun(
                at_s=self._clock(),
                version=records.VERSION,
                participant=pseudonym,
                row=row,
                trials=trials_of(self.protocol, row),
                protocol_sha256=self._digest,
                id=new_id,
            )
            records.participant_folder(self.folder, pseudonym).mkdir(parents=True, exist_ok=True)
            records.log_of(self.folder, pseudonym).append(begun)
            self.participants[pseudonym] = self._open(pseudonym)
            return self.participants[pseudonym], True

    def _open(self, pseudonym: str) -> OpenParticipant:
        return OpenParticipant(self.folder, pseudonym, protocol=self.protocol, clock=self._clock)
