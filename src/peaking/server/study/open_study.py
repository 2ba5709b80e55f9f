"""A study that is being run: its folder, its participants, and nobody else at the same time."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable
from pathlib import Path

from peaking.errors import OutputError, PeakingError, StudyError
from peaking.server.admission import NotAdmitted
from peaking.server.sessions import SessionStore, UnknownSession
from peaking.server.store_folder import PRIVATE
from peaking.server.study import wire
from peaking.server.study.erasure import devices_of, finish_erasures
from peaking.server.study.open_participant import NotNow, OpenParticipant
from peaking.study import records
from peaking.study.privacy import (
    erased,
    owners,
    read_erased,
    sessions_to_forget,
)
from peaking.study.protocol import FILE_NAME, load_protocol, remarks, trials_of
from peaking.study.texts import Texts


class UnknownParticipant(PeakingError):
    """There is nobody of this pseudonym."""


class OpenStudy:
    """A study's folder; whoever opens it holds it (`privacy.held`)."""

    def __init__(
        self, folder: Path, sessions: SessionStore, *, clock: Callable[[], float] = time.time
    ) -> None:
        """Open it, and finish erasures that were interrupted.

        A participant whose log is damaged is set aside. `problems` tells that, and what cannot be
        erased.

        Args:
            folder: Of the study.
            sessions: What is captured in it.
            clock: Seconds since 1970.

        Raises:
            StudyError: The protocol or a translation cannot be used.
        """
        self.folder = folder
        self.sessions = sessions
        noted, self.problems = read_erased(folder)
        devices = devices_of(sessions) if noted else None
        self.problems += finish_erasures(folder, sessions, noted, devices)
        self.problems += devices.problems if devices is not None else []
        (folder / "participants").mkdir(exist_ok=True)
        (folder / "participants").chmod(PRIVATE)
        self.protocol = load_protocol(folder)
        self.texts = Texts(self.protocol, folder)
        self._digest = hashlib.sha256((folder / FILE_NAME).read_bytes()).hexdigest()
        self._clock = clock
        self._lock = threading.RLock()
        self.participants: dict[str, OpenParticipant] = {}
        self._rows_set_aside: set[int] = set()
        for name in records.pseudonyms(folder):
            try:
                self.participants[name] = self._open(name)
            except StudyError as error:
                self._set_aside(name, error)
        self._owners = owners({p.pseudonym: p.events for p in self.participants.values()})
        self.problems += self.forget_overdue_images()[1]

    @property
    def remarks(self) -> list[str]:
        """Return sentences that the experimenter should know."""
        said = [*remarks(self.protocol), *self.problems]
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

        Raises:
            NotNow: The participant of this id was erased.
        """
        with self._lock:
            for known in self.participants.values():
                if known.id == new_id:
                    return known, False
            gone = erased(self.folder)
            if new_id in [entry.id for entry in gone]:
                raise NotNow("This participant was erased. Reload the page.")
            given = [*records.pseudonyms(self.folder), *(entry.participant for entry in gone)]
            number = 1 + max((int(name[1:]) for name in given), default=0)
            taken = {p.record.row for p in self.participants.values() if not p.record.excluded}
            taken |= self._rows_set_aside
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

    # Whose sessions are whose

    def grant(self, participant: OpenParticipant, step: str, begun: wire.SessionBegun) -> None:
        """Let a participant begin a capture session in a step: this one, and once.

        Raises:
            NotNow: It is another step's turn, or the session is not theirs.
            SessionGone: The session was erased.
        """
        with self._lock:
            owner = self._owners.get(begun.session)
            if owner not in (None, participant.pseudonym):
                raise NotNow("This capture session belongs to somebody else. Reload the page.")
            if owner is None and self._is_known(begun.session):
                raise NotNow("This capture session is not of this study. Reload the page.")
            participant.link(step, begun)
            self._owners = {**self._owners, begun.session: participant.pseudonym}

    def owner(self, session_id: str) -> str | None:
        """Return the participant who was granted a session, or nobody."""
        return self._owners.get(session_id)

    def to_begin(self, session_id: str) -> str | None:
        """Return the participant who was granted a session.

        Raises:
            NotAdmitted: Nobody was, or they have not agreed to take part.
        """
        self.to_add(session_id)
        return self._owners[session_id]

    def to_add(self, session_id: str) -> None:
        """Let a photo or samples be added to a session.

        Raises:
            NotAdmitted: It was granted to nobody, or they have not agreed to take part.
        """
        participant = self.participants.get(self._owners.get(session_id, ""))
        if participant is None:
            raise NotAdmitted(
                "In a study, a capture begins on the participant's page: open their link."
            )
        if not participant.agreed:
            raise NotAdmitted("This participant has not agreed to take part: nothing is kept.")

    def to_end(self, session_id: str) -> None:
        """Refuse: what is captured in a study is erased with its participant.

        Raises:
            NotAdmitted: Always.
        """
        raise NotAdmitted(
            "In a study, captures are erased with their participant: peaking study erase."
        )

    def forget_images(self, participant: OpenParticipant) -> bool:
        """Erase the photos that may not be kept any longer; return whether there were any.

        Raises:
            OSError: It could not be noted.
            OutputError: Something is left that cannot be deleted.
        """
        sessions = participant.sessions_to_forget()
        for session in sessions:
            self.sessions.erase(session)
            participant.images_erased(session)
        return bool(sessions)

    def forget_overdue_images(self) -> tuple[list[OpenParticipant], list[str]]:
        """Erase the photos that may not be kept any longer, of everybody, set aside or not.

        Returns:
            The participants of whom something was erased, and a sentence for each of whom
            something cannot be.
        """
        told: list[OpenParticipant] = []
        problems: list[str] = []
        for name in records.pseudonyms(self.folder):
            try:
                participant = self.participants.get(name)
                if participant is None:
                    self._forget_images_of_one_set_aside(name)
                elif self.forget_images(participant):
                    told.append(participant)
            except (OSError, OutputError) as error:
                cause = (error.strerror if isinstance(error, OSError) else None) or str(error)
                problems.append(f"{name}: photos cannot be erased ({cause})")
        return told, problems

    # Inside

    def _is_known(self, session_id: str) -> bool:
        try:
            self.sessions.get(session_id)
        except UnknownSession:
            return False
        return True

    def _forget_images_of_one_set_aside(self, pseudonym: str) -> None:
        events, _ = records.log_of(self.folder, pseudonym).read_around_damage()
        begun = [s.id for s in self.sessions.all_sessions() if s.owner == pseudonym]
        for session in sessions_to_forget(events, now_s=self._clock(), begun=begun):
            self.sessions.erase(session)

    def _set_aside(self, pseudonym: str, error: StudyError) -> None:
        self.problems.append(f"{pseudonym} is set aside: {error}")
        events, _ = records.log_of(self.folder, pseudonym).read_around_damage()
        answers = (records.ConsentGiven, records.ConsentRefused)
        if self.protocol.consent.strip() and not any(isinstance(e, answers) for e in events):
            self.problems.append(
                f"{pseudonym}: whether photos may be kept cannot be read; put back a copy of the "
                "log, or erase the participant"
            )
        begun = [event for event in events if isinstance(event, records.ParticipantBegun)]
        self._rows_set_aside |= {event.row for event in begun}

    def _open(self, pseudonym: str) -> OpenParticipant:
        return OpenParticipant(self.folder, pseudonym, protocol=self.protocol, clock=self._clock)
