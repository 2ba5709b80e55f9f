"""The log of a session: one JSON line per event, only ever appended to, on the disk when told so.

What stands in it has happened; everything else in a session's folder follows from it.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from peaking.event_log import EventLog
from peaking.foreign_json import decode_json
from peaking.server import wire

FILE_NAME = "log.jsonl"
VERSION = 1


class Event(msgspec.Struct, frozen=True, tag_field="type"):
    """Something that happened, at a time of the server's clock (seconds since 1970)."""

    at_s: float


class NamedSession(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a phone said of a session when it began it."""

    id: wire.Id
    protocol: int
    name: wire.Name
    source: wire.SourceKind
    device: str = ""
    owner: str | None = None
    """In a study: the participant who was granted this session."""


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
    corrected_world_from_cam: wire.Pose | None = None
    """Where the phone found that the photo was taken, beside what it says in `camera`."""
    automatic: bool = False
    """Taken by an automatic shutter."""


class CaptureRemoved(Event, frozen=True, tag="CaptureRemoved"):
    """Undone by the photographer."""

    id: str


class CaptureSetAside(Event, frozen=True, tag="CaptureSetAside"):
    """Taken out of the data set by the program."""

    id: str


class CaptureRestored(Event, frozen=True, tag="CaptureRestored"):
    """Is in the data set again, after an undo or after it was set aside."""

    id: str


class CaptureDropped(Event, frozen=True, tag="CaptureDropped"):
    """Set aside longest when there were too many: its files are deleted."""

    id: str


class CaptureErased(Event, frozen=True, tag="CaptureErased"):
    """Erased for ever: its files, and what was made of them."""

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
    """Was finished, or opened again. What was undone before it was finished cannot be restored.

    Photos that were taken after `at_s` are not taken in while it is finished.
    """

    finished: bool


class SessionDeleted(Event, frozen=True, tag="SessionDeleted"):
    """Was deleted as a whole; it can be restored for some time."""


class SessionRestored(Event, frozen=True, tag="SessionRestored"):
    """Was restored after it had been deleted."""


AnyEvent = (
    SessionBegun
    | CaptureStored
    | CaptureRemoved
    | CaptureSetAside
    | CaptureRestored
    | CaptureDropped
    | CaptureErased
    | MpiMade
    | SessionNamed
    | SessionFinished
    | SessionDeleted
    | SessionRestored
)


class Named(msgspec.Struct):
    """Which session a log is of, and whose; it is read from logs of any version."""

    id: str
    owner: str | None = None


class _FirstLine(msgspec.Struct):
    session: Named


def named_in(log: Path) -> Named | None:
    """Return which session a log is of; None where its first line cannot be read."""
    try:
        with log.open("rb") as file:
            return decode_json(file.readline(), _FirstLine).session
    except (OSError, ValueError):
        return None


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

    def read(self) -> tuple[list[AnyEvent], list[str]]:
        """Return the events, and a sentence for each line that cannot be read."""
        events, damaged = self._log.read_around_damage()
        return events, [f"{self.path}: {line}; it was left out" for line in damaged]
