"""The log of a session: one JSON line per event, only ever appended to, on the disk when told so.

What stands in it has happened; everything else in a session's folder follows from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec

from peaking.errors import RecordingError
from peaking.event_log import DamagedLine, EventLog
from peaking.server import wire

FILE_NAME = "log.jsonl"
VERSION = 1


class Event(msgspec.Struct, frozen=True, tag_field="type"):
    """Something that happened, at a time of the server's clock (seconds since 1970)."""

    at_s: float


class NamedSession(msgspec.Struct, frozen=True):
    """What a phone said of a session when it began it."""

    id: wire.Id
    protocol: int
    name: wire.Name
    source: wire.SourceKind
    device: str = ""


class SessionBegun(Event, frozen=True, tag="SessionBegun"):
    """First line of every log."""

    version: int
    session: NamedSession


class CaptureStored(Event, frozen=True, tag="CaptureStored"):
    """Photo, depth and points are on the disk: the moment from which a capture exists."""

    id: str
    number: int
    camera: wire.Camera
    time_s: float
    depth: bool
    points: bool = False


class CaptureRemoved(Event, frozen=True, tag="CaptureRemoved"):
    """Undone by the photographer."""

    id: str


class MpiMade(Event, frozen=True, tag="MpiMade"):
    """An MPI of a capture is on the disk: the first, or one that takes the place of another."""

    id: str
    version: int
    generator: str
    guessed: bool


class SessionNamed(Event, frozen=True, tag="SessionNamed"):
    """Got another name."""

    name: str


class SessionFinished(Event, frozen=True, tag="SessionFinished"):
    """Was finished, or opened again."""

    finished: bool


AnyEvent = SessionBegun | CaptureStored | CaptureRemoved | MpiMade | SessionNamed | SessionFinished


class SessionLog:
    """Appends events to a file; every event is on the disk when `append` returns."""

    def __init__(self, path: Path) -> None:
        """Take the log at `path`, which may not exist yet."""
        self.path = path
        self._log: EventLog[AnyEvent] = EventLog(path, AnyEvent)

    def append(self, event: AnyEvent) -> None:
        """Write one event.

        Raises:
            OSError: It could not be written; the log is as it was before.
        """
        self._log.append(event)

    def read(self) -> Iterator[AnyEvent]:
        """Yield all events, and cut off a last line that a crash left unfinished.

        Raises:
            RecordingError: A line in the middle is damaged, or of a newer version.
        """
        self._log.mend()
        try:
            yield from self._log.read()
        except DamagedLine as error:
            raise RecordingError(
                self.path,
                str(error),
                remedy="it is damaged or of a newer version of peaking; the photos beside it "
                "are untouched",
            ) from error
