"""All sessions below one folder: begun complete or not at all, opened again, erased."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

from peaking.errors import OutputError, RecordingError
from peaking.output import flush, write_atomically
from peaking.server import session_log, wire
from peaking.server.dataset import transforms_json
from peaking.server.disk_full import DiskFull, room_explained
from peaking.server.open_session import (
    ERASED,
    FOLDERS,
    TRANSFORMS,
    OpenSession,
    UnknownSession,
)
from peaking.server.session_log import SessionLog


class SessionStore:
    """All sessions below one folder."""

    def __init__(self, root: Path, *, clock: Callable[[], float] = time.time) -> None:
        """Open the sessions below `root`, which is made when it is not there.

        A folder that cannot be opened is left alone and told in `problems`.
        """
        self.root = root
        self.problems: list[str] = []
        self._clock = clock
        self._lock = threading.Lock()
        self._sessions: dict[str, OpenSession] = {}
        self._erased: set[str] = set()
        root.mkdir(parents=True, exist_ok=True)
        for leftover in root.glob(".*.erased"):
            shutil.rmtree(leftover, ignore_errors=True)
        for log in sorted(root.glob(f"*/{session_log.FILE_NAME}")):
            if log.parent.name.startswith("."):
                continue
            try:
                session = OpenSession(log.parent, clock=clock)
                self._sessions[session.id] = session
            except (RecordingError, OutputError, OSError) as error:
                self.problems.append(str(error))

    def sessions(self) -> list[OpenSession]:
        """Return all sessions, oldest first."""
        with self._lock:
            return list(self._sessions.values())

    def get(self, session_id: str) -> OpenSession:
        """Return a session.

        Raises:
            UnknownSession: It is not here.
        """
        with self._lock:
            if session_id not in self._sessions:
                raise UnknownSession("There is no such session on this server.")
            return self._sessions[session_id]

    def begin(self, session_id: str, new: wire.NewSession) -> tuple[OpenSession, bool]:
        """Return the session of this id, and whether it was made now.

        Raises:
            UnknownSession: It was erased while this server ran.
            DiskFull: There is no room; nothing of it was kept.
        """
        with self._lock:
            if session_id in self._sessions:
                return self._sessions[session_id], False
            if session_id in self._erased:
                raise UnknownSession(ERASED)
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
                    session_id, new.protocol, new.name, new.source, new.device
                ),
            )
            try:
                with room_explained():
                    hidden.mkdir(exist_ok=True)
                    (hidden / session_log.FILE_NAME).unlink(missing_ok=True)
                    for name in FOLDERS:
                        (hidden / name).mkdir(parents=True, exist_ok=True)
                    write_atomically(hidden / TRANSFORMS, transforms_json(()))
                    SessionLog(hidden / session_log.FILE_NAME).append(begun)
                    hidden.rename(folder)
            except DiskFull:
                shutil.rmtree(hidden, ignore_errors=True)
                raise
            flush(self.root)
            session = OpenSession(folder, clock=self._clock)
            self._sessions[session_id] = session
            return session, True

    def erase(self, session_id: str) -> None:
        """Delete a session with all its photos; one that is not here stays refused."""
        with self._lock:
            self._erased.add(session_id)
            session = self._sessions.pop(session_id, None)
        if session is not None:
            session.erase()
