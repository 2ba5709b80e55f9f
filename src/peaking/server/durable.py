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


def flush_names(folder: Path) -> None:
    """Wait until the names in a folder are on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
