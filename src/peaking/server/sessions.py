"""All sessions below one folder: begun complete or not at all, opened again, deleted, erased."""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

from peaking.errors import OutputError, PeakingError
from peaking.output import flush, write_atomically
from peaking.server import session_log, wire
from peaking.server.dataset import transforms_json
from peaking.server.disk_full import room_explained
from peaking.server.open_session import OpenSession, SessionGone
from peaking.server.session_files import FOLDERS, TRANSFORMS
from peaking.server.session_log import SessionLog
from peaking.server.store_folder import ID_FILE, PRIVATE, StoreFolder, changed_s, ids_of
from peaking.server.told import cause_of

RESTORABLE_S = 30 * 24 * 3600.0
"""So long a deleted session can be restored; then it is erased."""

_log = logging.getLogger("peaking.server")


class UnknownSession(PeakingError):
    """There is no session of this id."""


class SessionStore:
    """All sessions below one folder, which this process has until the store is closed."""

    def __init__(self, root: Path, *, clock: Callable[[], float] = time.time) -> None:
        """Open the sessions below `root`, which is made when it is not there.

        Erasures that were interrupted are finished. A folder that cannot be opened is left alone
        and told in `problems`.

        Raises:
            OutputError: Another process has the folder, or it cannot be written to.
        """
        self.root = root
        self._clock = clock
        self._lock = threading.Lock()
        self._sessions: dict[str, OpenSession] = {}
        self._told_of_erasures: list[Callable[[str], None]] = []
        self._folder = StoreFolder(root, clock=clock)
        self._deleted_ids: set[str] = set()
        """Of deleted sessions that cannot be opened."""
        self.problems = self._folder.clean()
        for folder in self._folder.sessions():
            if (folder / session_log.FILE_NAME).is_file():
                self._open(folder)
            elif (folder / "images").is_dir():
                self.problems.append(
                    f"{folder}: has no {session_log.FILE_NAME}; open it as a recording, or move it"
                )
        try:
            self.erase_expired()
        except (OSError, PeakingError) as error:
            self.problems.append(f"{root}: what was deleted long ago could not be erased: {error}")

    def close(self) -> None:
        """Let another process have the folder."""
        self._folder.close()

    def sessions(self) -> list[OpenSession]:
        """Return all sessions, oldest first, without deleted ones."""
        return [session for session in self.all_sessions() if session.deleted_s is None]

    def all_sessions(self) -> list[OpenSession]:
        """Return all sessions, oldest first, deleted ones too."""
        return list(self._sessions.copy().values())

    def get(self, session_id: str) -> OpenSession:
        """Return a session.

        Raises:
            SessionGone: It was deleted or erased.
            UnknownSession: It is not here.
        """
        session = self.get_any(session_id)
        if session.deleted_s is not None:
            raise SessionGone(final=False)
        return session

    def get_any(self, session_id: str) -> OpenSession:
        """Return a session, or one that was deleted and can be restored.

        Raises:
            SessionGone: It was erased.
            UnknownSession: It is not here.
        """
        session = self._sessions.get(session_id)
        if session is not None:
            return session
        if session_id in self._folder.erased_ids:
            raise SessionGone(final=True)
        if session_id in self._deleted_ids:
            raise SessionGone(final=False)
        raise UnknownSession("There is no such session on this server.")

    def begin(
        self, session_id: str, new: wire.NewSession, *, owner: str | None = None
    ) -> tuple[OpenSession, bool]:
        """Return the session of this id, and whether it was made now.

        Args:
            session_id: Made by the client.
            new: What the client says of it.
            owner: In a study, the participant who was granted it.

        Raises:
            SessionGone: It was deleted or erased.
            DiskFull: There is no room; nothing of it was kept.
        """
        with self._lock:
            with contextlib.suppress(UnknownSession):
                return self.get(session_id), False
            now_s = self._clock()
            when = time.strftime("%Y-%m-%d_%H%M%S", time.localtime(now_s))
            folder = self.root / f"{when}_{session_id[:8]}"
            # The whole id where two share their beginning in the same second.
            if folder.exists():
                folder = self.root / f"{when}_{session_id}"
            hidden = folder.with_name(f".{folder.name}.partial")
            begun = session_log.SessionBegun(
                at_s=now_s,
                version=session_log.VERSION,
                session=session_log.NamedSession(
                    session_id, new.protocol, new.name, new.source, new.device, owner
                ),
            )
            try:
                with room_explained():
                    shutil.rmtree(hidden, ignore_errors=True)
                    hidden.mkdir(mode=PRIVATE)
                    for name in FOLDERS:
                        (hidden / name).mkdir(parents=True, exist_ok=True)
                    write_atomically(hidden / TRANSFORMS, transforms_json(()))
                    (hidden / ID_FILE).write_text(session_id)
                    SessionLog(hidden / session_log.FILE_NAME).append(begun)
                    hidden.rename(folder)
                    flush(self.root)
                    session = OpenSession(folder, clock=self._clock)
            except BaseException:
                shutil.rmtree(hidden, ignore_errors=True)
                shutil.rmtree(folder, ignore_errors=True)
                raise
            self._sessions[session_id] = session
            return session, True

    def delete(self, session_id: str) -> OpenSession:
        """Delete a session; it can be restored for `RESTORABLE_S`. Again does nothing.

        Raises:
            SessionGone: It was erased.
            UnknownSession: It is not here.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            session = self.get_any(session_id)
            session.delete()
            session.move(self._folder.deleted / session.folder.name)
            return session

    def restore(self, session_id: str) -> OpenSession:
        """Bring a deleted session back. Again does nothing.

        Raises:
            SessionGone: It was erased.
            UnknownSession: It is not here.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            session = self.get_any(session_id)
            session.restore()
            session.move(self.root / session.folder.name)
            return session

    def when_erased(self, tell: Callable[[str], None]) -> None:
        """Have `tell` called, in any thread, with the id of each session that is erased."""
        self._told_of_erasures.append(tell)

    def erase(self, session_id: str) -> None:
        """Erase a session, with all that was made of it: for ever, also one that is not here yet.

        Raises:
            OSError: It could not be noted; nothing was erased.
            OutputError: It is noted, and something is left that cannot be deleted.
        """
        with self._lock:
            self._folder.note_erased(session_id)
            session = self._sessions.pop(session_id, None)
            if session is not None:
                session.close_for_ever()
            for folder in self._folder.sessions_of([session_id]):
                self._folder.delete(folder)
            left = self._folder.left_of(session_id)
            said = map(StoreFolder.cannot_be_deleted, left)
            self.problems += [problem for problem in said if problem not in self.problems]
        for tell in self._told_of_erasures:
            tell(session_id)
        if left:
            raise OutputError(StoreFolder.cannot_be_deleted(left[0]))

    def erase_expired(self) -> list[str]:
        """Erase the sessions that were deleted too long ago to be restored; return their ids.

        Raises:
            OSError: As `erase`; what comes after is tried again.
        """
        oldest_s = self._clock() - RESTORABLE_S
        expired = [
            session.id
            for session in self.all_sessions()
            if session.deleted_s is not None and session.deleted_s < oldest_s
        ]
        for session_id in expired:
            self.erase(session_id)
        for folder in self._folder.deleted.glob("[!.]*/"):
            if not ids_of(folder) & self._sessions.keys() and changed_s(folder) < oldest_s:
                self._folder.delete(folder)  # it cannot be opened
        return expired

    # Inside

    def _open(self, folder: Path) -> None:
        """Open a session, and finish what a crash interrupted."""
        deleted = folder.parent == self._folder.deleted
        try:
            folder.chmod(PRIVATE)
            session = OpenSession(folder, clock=self._clock)
            if session.id in self._sessions:
                other = self._sessions[session.id].folder.name
                self.problems.append(
                    f"{folder}: is the same session as {other}; move one of them away"
                )
                return
            if deleted and session.problems:  # the line about it may be what is lost
                session.delete(at_s=changed_s(folder))
            where = self.root if session.deleted_s is None else self._folder.deleted
            session.move(where / folder.name)
        except Exception as error:  # whatever it is, the other sessions must be served
            if not isinstance(error, PeakingError | OSError):
                _log.exception("%s could not be opened", folder)
            self.problems.append(
                str(error)
                if isinstance(error, PeakingError)
                else f"{folder}: cannot be opened ({cause_of(error)}); its photos are untouched"
            )
            self._deleted_ids |= ids_of(folder) if deleted else set()
            return
        self._sessions[session.id] = session
        self.problems += session.problems
