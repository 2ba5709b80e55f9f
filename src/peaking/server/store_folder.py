"""The folder of all sessions, apart from the sessions themselves: who has it, and what was erased.

In it lie the sessions (`2026-11-30_101500_5e551011`), and beside them `.deleted` with sessions that
were deleted and can be restored, `.peaking/lock`, held by the process that serves the folder, and
`.peaking/erased`, with an empty file for each session that was erased: it never comes back.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import sys
import time
import weakref
from collections.abc import Callable, Collection
from pathlib import Path

import msgspec

from peaking.errors import OutputError
from peaking.foreign_json import decode_json
from peaking.output import check_folder, flush
from peaking.server import session_log, wire

PRIVATE = 0o700
"""Mode of folders: photos are nobody else's."""
OWN = ".peaking"
DELETED = ".deleted"
ERASED_SUFFIX = ".erased"
ID_FILE = ".id"
"""In a session's folder: its id once more, for when its log is damaged."""

_SHORT_NAME = re.compile(r"\d{4}-\d\d-\d\d_\d{6}_(?P<begin>.{8})")
"""Of a session's folder: when it was begun, and how its id begins."""


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
        check_folder(root)
        try:
            if not root.is_dir():
                root.mkdir(parents=True, mode=PRIVATE)
            for folder in (root / OWN, root / DELETED, root / OWN / "erased"):
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
        self._tombstones = root / OWN / "erased"
        self.erased_ids = {path.name for path in self._tombstones.iterdir()}

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
        real = (path for path in found if path.is_dir() and not path.is_symlink())
        return sorted(real, key=lambda path: path.name)

    def sessions_of(self, ids: Collection[str]) -> list[Path]:
        """Return the folders of sessions of these ids, also of those that cannot be opened."""
        beginnings = {one[:8] for one in ids}
        found: list[Path] = []
        for folder in self.sessions():
            known = ids_of(folder)
            name = _SHORT_NAME.fullmatch(folder.name)  # all that is left of very old ones
            if known & set(ids) or (not known and name and name["begin"] in beginnings):
                found.append(folder)
        return found

    def note_erased(self, session_id: str) -> None:
        """Write down that a session is erased; on the disk when this returns.

        Raises:
            OSError: It could not be written.
        """
        if session_id not in self.erased_ids:
            (self._tombstones / session_id).touch()
            flush(self._tombstones)
            self.erased_ids.add(session_id)

    def delete(self, folder: Path) -> None:
        """Delete a session's folder with all that was made of it.

        What is left of it, when the system refuses, is hidden, and deleted at the next start.
        """
        hidden = self.root / f".{folder.name}{ERASED_SUFFIX}"
        shutil.rmtree(hidden, ignore_errors=True)
        try:
            folder.rename(hidden)
            flush(self.root)
        except FileNotFoundError:
            pass
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(hidden, ignore_errors=True)

    def left_of(self, session_id: str) -> list[Path]:
        """Return what is left of a session that was erased, also of one that cannot be told."""
        hidden = self.root.glob(f".*{ERASED_SUFFIX}")
        left = (path for path in hidden if session_id in (ids_of(path) or {session_id}))
        return [*self.sessions_of([session_id]), *left]

    @staticmethod
    def cannot_be_deleted(folder: Path) -> str:
        """Return the sentence about what is left of a session."""
        return f"{folder}: is erased and cannot be deleted; delete it by hand"

    def clean(self) -> list[str]:
        """Finish what a crash interrupted; return a sentence for whatever cannot be deleted."""
        problems: list[str] = []
        for folder in self.sessions_of(self.erased_ids) if self.erased_ids else ():
            self.delete(folder)
        for place in (self.root, self.deleted):
            for leftover in place.glob(".*.partial"):
                shutil.rmtree(leftover, ignore_errors=True)
            for leftover in place.glob(f".*{ERASED_SUFFIX}"):
                shutil.rmtree(leftover, ignore_errors=True)
                if leftover.exists():
                    problems.append(self.cannot_be_deleted(leftover))
        problems += (
            f"{path}: is a link, and sessions must lie here to be erased; move the folder itself"
            for path in self.root.glob("[!.]*/")
            if path.is_symlink()
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
        with contextlib.suppress(OSError):  # on a full disk nobody is told who holds it
            os.truncate(self._lock, 0)
            os.pwrite(self._lock, msgspec.json.encode(holder), 0)


def ids_of(folder: Path) -> set[str]:
    """Return what the session in a folder is called: one id, as a rule; none where it is damaged.

    It is two where one of its files is damaged in a way that is not noticed.
    """
    named = session_log.named_in(folder / session_log.FILE_NAME)
    found = set[str]() if named is None else {named.id}
    with contextlib.suppress(OSError, ValueError):
        found.add(msgspec.convert((folder / ID_FILE).read_text(), wire.Id))
    return found


def changed_s(folder: Path) -> float:
    """Return when a folder was last changed or moved, seconds since 1970."""
    status = folder.stat()
    return max(status.st_mtime, status.st_ctime)


def _who(said: bytes) -> str:
    try:
        holder = decode_json(said, Holder)
    except ValueError:
        return "another process"
    since = time.strftime("%H:%M", time.localtime(holder.since_s))
    return f"another process ({holder.command!r}, number {holder.pid}, since {since})"
