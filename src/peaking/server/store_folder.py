"""The folder of all sessions, apart from the sessions themselves: who has it, and what was erased.

In it lie the sessions (`2026-11-30_101500_5e551011`), and beside them `.deleted` with sessions that
were deleted and can be restored, `.peaking/lock`, held by the process that serves the folder, and
`.peaking/erased.jsonl`, the ids of erased sessions: they never come back.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import sys
import time
import weakref
from collections.abc import Callable, Collection
from pathlib import Path

import msgspec

from peaking.errors import OutputError
from peaking.event_log import EventLog
from peaking.foreign_json import decode_json
from peaking.output import flush
from peaking.server import session_log

PRIVATE = 0o700
"""Mode of folders: photos are nobody else's."""
OWN = ".peaking"
DELETED = ".deleted"
ERASED_SUFFIX = ".erased"


class Erased(msgspec.Struct, frozen=True):
    """A session that was erased, written before anything is deleted."""

    session: str
    at_s: float


class Holder(msgspec.Struct, frozen=True):
    """Who has the lock."""

    pid: int
    command: str
    since_s: float


class StoreFolder:
    """A folder of sessions that this process has, until it is closed or the process ends."""

    def __init__(self, root: Path, *, clock: Callable[[], float]) -> None:
        """Make the folder where it is not there, and lock it.

        Args:
            root: The folder.
            clock: Seconds since 1970.

        Raises:
            OutputError: Another process has it, or it cannot be written to.
        """
        self.root = root
        try:
            if not root.is_dir():
                root.mkdir(parents=True, mode=PRIVATE)
            for folder in (root / OWN, root / DELETED):
                folder.mkdir(exist_ok=True, mode=PRIVATE)
                folder.chmod(PRIVATE)
            self._lock = os.open(root / OWN / "lock", os.O_RDWR | os.O_CREAT, 0o600)
            self._unlock = weakref.finalize(self, os.close, self._lock)
            os.fchmod(self._lock, 0o600)
        except OSError as error:
            raise OutputError(
                f"{root}: sessions cannot be kept there ({error.strerror}); give a folder that you "
                "may write to"
            ) from error
        self._take(now_s=clock())
        self._tombstones: EventLog[Erased] = EventLog(root / OWN / "erased.jsonl", Erased)
        self.problems: list[str] = []
        self.erased_ids = self._read_tombstones()

    def close(self) -> None:
        """Let another process have the folder."""
        self._unlock()

    @property
    def deleted(self) -> Path:
        """Where deleted sessions lie."""
        return self.root / DELETED

    def sessions(self) -> list[Path]:
        """Return the folders of all sessions, deleted ones too, by name."""
        found = [*self.root.glob("[!.]*/"), *self.deleted.glob("[!.]*/")]
        return sorted((path for path in found if path.is_dir()), key=lambda path: path.name)

    def sessions_of(self, ids: Collection[str]) -> list[Path]:
        """Return the folders of sessions of these ids, also of those that cannot be opened."""
        endings = tuple(f"_{end}" for one in ids for end in (one, one[:8]))
        found: list[Path] = []
        for folder in self.sessions():
            known = _id_in(folder / session_log.FILE_NAME)
            if known in ids or (known is None and folder.name.endswith(endings)):
                found.append(folder)
        return found

    def note_erased(self, session_id: str, *, at_s: float) -> None:
        """Write down that a session is erased; on the disk when this returns.

        Raises:
            OSError: It could not be written.
        """
        if session_id not in self.erased_ids:
            self._tombstones.append(Erased(session_id, at_s))
            self.erased_ids.add(session_id)

    def delete(self, folder: Path) -> bool:
        """Delete a session's folder with all that was made of it; return whether it is gone.

        What is left of it, when the system refuses, is deleted at the next start.
        """
        hidden = self.root / f".{folder.name}{ERASED_SUFFIX}"
        with contextlib.suppress(FileNotFoundError):
            folder.rename(hidden)
            flush(self.root)
        shutil.rmtree(hidden, ignore_errors=True)
        return not hidden.exists()

    def clean(self) -> list[str]:
        """Finish what a crash interrupted; return a sentence for whatever cannot be deleted."""
        problems = list(self.problems)
        for folder in self.sessions_of(self.erased_ids) if self.erased_ids else ():
            self.delete(folder)
        for place in (self.root, self.deleted):
            for leftover in place.glob(".*.partial"):
                shutil.rmtree(leftover, ignore_errors=True)
            for leftover in place.glob(f".*{ERASED_SUFFIX}"):
                shutil.rmtree(leftover, ignore_errors=True)
                if leftover.exists():
                    problems.append(
                        f"{leftover}: is erased and cannot be deleted; delete it by hand"
                    )
        return problems

    def _take(self, *, now_s: float) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            said = os.pread(self._lock, 1000, 0)
            self._unlock()
            raise OutputError(
                f"{self.root}: {_who(said)} has this folder; stop it first (Ctrl-C), or give "
                "another folder"
            ) from None
        except OSError as error:
            self._unlock()
            raise OutputError(
                f"{self.root}: cannot be locked ({error.strerror}); give a folder on a local disk"
            ) from error
        command = "peaking " + (sys.argv[1] if sys.argv[1:] and sys.argv[1].isalpha() else "")
        holder = Holder(os.getpid(), command.strip(), now_s)
        os.truncate(self._lock, 0)
        os.pwrite(self._lock, msgspec.json.encode(holder), 0)

    def _read_tombstones(self) -> set[str]:
        try:
            self._tombstones.mend()
            events, damaged = self._tombstones.read_around_damage()
        except FileNotFoundError:
            return set()
        self.problems += [f"{self._tombstones.path}: {line}" for line in damaged]
        return {event.session for event in events}


class _Named(msgspec.Struct):
    id: str


class _FirstLine(msgspec.Struct):
    session: _Named


def _id_in(log: Path) -> str | None:
    """Return the id in the first line of a session's log; None where it cannot be read."""
    try:
        with log.open("rb") as file:
            return decode_json(file.readline(), _FirstLine).session.id
    except (OSError, ValueError):
        return None


def _who(said: bytes) -> str:
    try:
        holder = decode_json(said, Holder)
    except ValueError:
        return "another process"
    since = time.strftime("%H:%M", time.localtime(holder.since_s))
    return f"another process ({holder.command!r}, number {holder.pid}, since {since})"
