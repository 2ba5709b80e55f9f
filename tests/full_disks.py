"""Disks of a real server that are really full, in two ways.

`SmallDisk` is a tmpfs of some megabytes, mounted where only the server sees it: in a namespace of
its own, which needs no root where users may make namespaces, and leaves nothing behind. Not every
machine allows that (containers often do not), so there is also `SmallFiles`: the kernel's limit of
a file's size, set on the running server. It needs no right at all, so what is tested with it is
tested everywhere. Both end in an error of the kernel's own, at a real write.
"""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import pytest

from live_server import LiveServer

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_MOUNT = 'mount -t tmpfs -o size="$0" none "$1" && shift && exec "$@"'


class FullDisk(Protocol):
    """What a test does with a disk."""

    def wrap(self, sessions: Path) -> Sequence[str]:
        """Return what comes before the server's command, so that its sessions lie on this disk."""
        ...

    def fill(self, server: LiveServer) -> None:
        """Let the next write of a photo fail."""
        ...

    def free(self, server: LiveServer) -> None:
        """Let writes succeed again."""
        ...

    def sessions(self, server: LiveServer) -> Path:
        """Return where a test finds the server's sessions."""
        ...


class SmallDisk:
    """A tmpfs of a few megabytes."""

    def __init__(self, size: str = "16m") -> None:
        """Take a size as mount does; nothing is mounted yet."""
        self.size = size

    def wrap(self, sessions: Path) -> Sequence[str]:
        """Mount it on the folder of the sessions, in a namespace of the server's own."""
        sessions.mkdir(parents=True, exist_ok=True)
        return (
            "unshare",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            _MOUNT,
            self.size,
            str(sessions),
        )

    def sessions(self, server: LiveServer) -> Path:
        """Look through the server's eyes: elsewhere the folder is empty."""
        return Path(f"/proc/{server.process.pid}/root{server.sessions}")

    def fill(self, server: LiveServer, *, free_pages: int = 0) -> None:
        """Fill it to the last page, or leave some free."""
        filler = self.sessions(server) / "filler"
        with filler.open("ab", buffering=0) as file:
            # The server may give pages back meanwhile: what it could not finish.
            while True:
                with contextlib.suppress(OSError):
                    while file.write(bytes(PAGE_BYTES)) == PAGE_BYTES:
                        pass
                if os.statvfs(filler).f_bavail == 0:
                    break
        os.truncate(filler, filler.stat().st_size - free_pages * PAGE_BYTES)

    def free(self, server: LiveServer) -> None:
        """Take the filler away."""
        (self.sessions(server) / "filler").unlink()


class SmallFiles:
    """The kernel refuses to let a file grow beyond some kilobytes."""

    def wrap(self, sessions: Path) -> Sequence[str]:
        """Leave the command alone."""
        return ()

    def sessions(self, server: LiveServer) -> Path:
        """Return the folder itself."""
        return server.sessions

    def fill(self, server: LiveServer) -> None:
        """Set the limit, below any photo and above a log's first lines."""
        _, most = resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (4096, most))

    def free(self, server: LiveServer) -> None:
        """Lift it."""
        _, most = resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (most, most))


def small_disk(folder: Path) -> SmallDisk:
    """Return a small disk; skip, and say why, where this machine lets nobody mount one."""
    refusal = _refusal(folder)
    if refusal:
        pytest.skip(f"no small disk can be mounted here ({refusal}); SmallFiles is tested")
    return SmallDisk()


def any_full_disk(folder: Path) -> FullDisk:
    """Return a small disk, or else small files: nothing is skipped."""
    return SmallFiles() if _refusal(folder) else SmallDisk()


def _refusal(folder: Path) -> str:
    """Try to mount one; return why that fails."""
    command = [*SmallDisk().wrap(folder / "tried"), "true"]
    if shutil.which(command[0]) is None:
        return f"there is no {command[0]}"
    tried = subprocess.run(command, capture_output=True, text=True, check=False)
    return tried.stderr.strip() if tried.returncode else ""
