"""A log that only grows: one JSON line per event, on the disk when told so.

What stands in it has happened; everything else follows from it. Sessions of the server and
participants of a study are such logs.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

E = TypeVar("E", bound=msgspec.Struct)


def append(path: Path, data: bytes, *, durably: bool) -> None:
    """Append to a file, which is made, readable by its owner only, when it is not there.

    A last line that a crash left unfinished is cut off first.

    Args:
        path: The file.
        data: Bytes.
        durably: Return only when they are on the disk.

    Raises:
        OSError: They could not be written; the file is as it was before.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
    try:
        size = _cut_torn_line(descriptor)
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


def _cut_torn_line(descriptor: int) -> int:
    """Cut off what stands after the last line; return the size, in bytes."""
    size = os.fstat(descriptor).st_size
    if size == 0 or os.pread(descriptor, 1, size - 1) == b"\n":
        return size
    whole = os.pread(descriptor, size, 0).rfind(b"\n") + 1
    os.ftruncate(descriptor, whole)
    return whole


def lines_of(path: Path) -> Iterator[bytes]:
    """Yield the lines of a file one by one, without a last one that is not complete.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        for line in file:
            if line.endswith(b"\n"):
                yield line


class DamagedLine(Exception):
    """A line in the middle of a log cannot be read, or several that follow one another."""

    def __init__(self, number: int, problem: str) -> None:
        """Remember which line (from 1) and why."""
        super().__init__(number, problem)
        self.number = number
        self.last = number
        self.problem = problem

    def __str__(self) -> str:
        """Return a sentence."""
        place = f"line {self.number}"
        if self.last > self.number:
            place = f"lines {self.number} to {self.last}"
        return f"{place} cannot be read ({self.problem})"


class EventLog(Generic[E]):
    """Appends events to a file; every event is on the disk when `append` returns."""

    def __init__(self, path: Path, kind: Any) -> None:
        """Take the log at `path`, which may not exist yet; `kind` is the union of its events."""
        self.path = path
        self._decoder = msgspec.json.Decoder(kind)

    def append(self, *events: E) -> None:
        """Write events in one go; a power cut in the middle may keep the first of them.

        Raises:
            OSError: They could not be written; the log is as it was before.
        """
        lines = b"".join(msgspec.json.encode(event) + b"\n" for event in events)
        append(self.path, lines, durably=True)

    def read(self) -> list[E]:
        """Return all events; a last line that a crash left unfinished is not one.

        Raises:
            DamagedLine: A line in the middle is damaged, or of a newer version.
        """
        events, damaged = self.read_around_damage()
        if damaged:
            raise damaged[0]
        return events

    def read_around_damage(self) -> tuple[list[E], list[DamagedLine]]:
        """Return the events that can be read, and what is wrong with the lines that cannot."""
        events: list[E] = []
        damaged: list[DamagedLine] = []
        for number, line in enumerate(lines_of(self.path), start=1):
            try:
                events.append(self._decoder.decode(line))
            except (ValueError, RecursionError) as error:
                if damaged and damaged[-1].last == number - 1:
                    damaged[-1].last = number
                else:
                    damaged.append(DamagedLine(number, str(error)))
        return events, damaged
