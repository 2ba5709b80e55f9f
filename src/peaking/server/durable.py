"""Writes that are on the disk when they return, or leave nothing behind; full disks, explained."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Generator
from pathlib import Path

from peaking.errors import OutputError, PeakingError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class DiskFull(PeakingError):
    """There is no room on the server's disk; nothing was kept."""


@contextlib.contextmanager
def room_explained() -> Generator[None, None, None]:
    """Turn "no space left" into a sentence for the photographer.

    Raises:
        DiskFull: The block failed for want of room.
    """
    try:
        yield
    except (OSError, OutputError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if isinstance(cause, OSError) and cause.errno in _FULL:
            raise DiskFull(
                "The server's disk is full; nothing of this was kept there. Free some space: the "
                "phone holds the capture until then."
            ) from error
        raise


def write_durably(path: Path, data: bytes) -> None:
    """Write a file so that it is on the disk under its name; what stood there is replaced.

    Raises:
        OSError: It could not be written; what stood there still does.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    flush_names(path.parent)


def append(path: Path, data: bytes, *, durably: bool) -> None:
    """Append to a file, which is made when it is not there.

    Args:
        path: The file.
        data: Bytes.
        durably: Return only when they are on the disk.

    Raises:
        OSError: They could not be written; the file is as it was before.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        try:
            rest = memoryview(data)
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            if durably:
                os.fsync(descriptor)
        except BaseException:
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, size)
                os.fsync(descriptor)
            raise
    finally:
        os.close(descriptor)


def flush_names(folder: Path) -> None:
    """Wait until the names in a folder are on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
