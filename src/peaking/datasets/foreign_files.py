"""Reads the files of a recording: so many bytes, and not through links that lead out of it.

A recording may be made of links (caches of data sets are), and is then read through them. Who hands
files on, to the network or into another folder, names the folder that they have to lie in.
A hard link is the file itself: it cannot be told from one.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Generator
from pathlib import Path
from typing import BinaryIO

from peaking.errors import RecordingError

FOLLOW_LINKS = (
    "copy the file into the recording, or give --follow-links to the commands that have it"
)


def read_bytes(
    path: Path, count: int | None = None, *, within: Path | None = None, at_most: int | None = None
) -> bytes:
    """Return the bytes of a file, or its first ones.

    Args:
        path: The file.
        count: How many; all by default.
        within: A folder; links that lead out of it are refused.
        at_most: A file of more bytes is refused.

    Raises:
        RecordingError: It cannot be read, is too long, or links lead to it out of
            `within`.
    """
    with opened(path, within=within, at_most=at_most) as file:
        size = os.fstat(file.fileno()).st_size
        return file.read(size if count is None else min(count, size))


@contextlib.contextmanager
def opened(
    path: Path, *, within: Path | None = None, at_most: int | None = None
) -> Generator[BinaryIO]:
    """Yield a file, opened for reading.

    Raises:
        RecordingError: As `read_bytes`.
    """
    with _opened(path, within) as descriptor, os.fdopen(os.dup(descriptor), "rb") as file:
        size = os.fstat(descriptor).st_size
        if at_most is not None and size > at_most:
            raise RecordingError(
                path,
                f"has {size:,} bytes, and at most {at_most:,} are read",
                remedy="store less in it",
            )
        yield file


def open_file(path: Path, *, within: Path) -> BinaryIO:
    """Open a file to read what it holds now, whatever becomes of its name.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: It cannot be read, or links lead to it out of `within`.
    """
    with _opened(path, within) as descriptor:
        return os.fdopen(os.dup(descriptor), "rb", buffering=0)


@contextlib.contextmanager
def real_path(path: Path, *, within: Path | None) -> Generator[str]:
    """Yield a name of the opened file, for what needs a name: no link can be put in its place.

    Raises:
        RecordingError: As `read_bytes`.
    """
    with _opened(path, within) as descriptor:
        yield f"/proc/self/fd/{descriptor}"


@contextlib.contextmanager
def _opened(path: Path, within: Path | None) -> Generator[int]:
    """Open a file for reading, and look where it lies once it is open."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", None) or str(error)
        raise RecordingError(
            path, f"cannot be read ({problem})", remedy="check the file and its rights"
        ) from error
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise RecordingError(path, "is not a file", remedy="put the file there")
        if within is not None and not _lies_in(descriptor, within):
            raise RecordingError(
                path, "is reached by a link that leaves the recording", remedy=FOLLOW_LINKS
            )
        yield descriptor
    except OSError as error:
        raise RecordingError(
            path, f"cannot be read ({error.strerror})", remedy="check the file and its rights"
        ) from error
    finally:
        os.close(descriptor)


def _lies_in(descriptor: int, folder: Path) -> bool:
    """Return whether an open file lies below a folder, as the system knows it."""
    place = Path(os.readlink(f"/proc/self/fd/{descriptor}"))  # noqa: PTH115
    return place.is_relative_to(os.path.realpath(folder))
