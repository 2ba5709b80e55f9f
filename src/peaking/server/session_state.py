"""What the events of a session add up to; no file is touched here."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from peaking.errors import PeakingError
from peaking.options import GeneratorName
from peaking.server import session_log, wire
from peaking.server.dataset import depth_name, photo_name, points_name
from peaking.server.upload import camera_of_wire, pose_of_wire

FAST: GeneratorName = "layered"
"""The generator whose MPIs are made at once; of one that a log does not name, too."""

MAX_NUMBER = 999_999_999
_ENDINGS = (
    session_log.CaptureRemoved,
    session_log.CaptureSetAside,
    session_log.CaptureErased,
    session_log.CaptureDropped,
)


class UnknownCapture(PeakingError):
    """There is no capture of this id in the session."""


class SessionState:
    """The captures of a session, and what is known of it.

    Reading takes no lock: the captures are a mapping that is replaced, never changed. Changing is
    for one thread at a time.

    Attributes:
        begun: How it began.
        name: Its name.
        finished_s: When the photographer finished it, seconds since 1970; None while it goes on.
        deleted_s: When it was deleted, seconds since 1970; None while it is not.
        captures: By id, in the order they arrived, removed ones too.
        number: The highest that a capture was given; none is given twice.
        taken_ids: Of captures that were undone, set aside or erased, and of which nothing else is
            known, since a line of the log is lost.
    """

    def __init__(self, begun: session_log.SessionBegun) -> None:
        """Begin without captures."""
        self.begun = begun
        self.name = begun.session.name
        self.finished_s: float | None = None
        self.deleted_s: float | None = None
        self.captures: Mapping[str, wire.Capture] = {}
        self.number = 0
        self.taken_ids: set[str] = set()
        self._files: dict[str, list[str]] = {}
        self._set_aside: dict[str, None] = {}

    def capture(self, capture_id: str) -> wire.Capture:
        """Return one capture.

        Raises:
            UnknownCapture: It is not here.
        """
        found = self.captures.get(capture_id)
        if found is None:
            raise UnknownCapture("There is no such capture in this session.")
        return found

    def files(self, capture: wire.Capture) -> list[str]:
        """Return the names, within the session's folder, of what was sent of a capture."""
        return self._files[capture.id]

    def longest_aside(self) -> list[wire.Capture]:
        """Return what is set aside and can be restored, those first that are so longest."""
        aside = [self.captures[capture_id] for capture_id in self._set_aside]
        return [c for c in aside if c.ending == "set_aside" and c.restorable]

    def change(self, capture_id: str, **fields: object) -> wire.Capture:
        """Change fields of a capture; return it as it is now.

        Raises:
            UnknownCapture: It is not here.
        """
        changed = msgspec.structs.replace(self.capture(capture_id), **fields)
        self.captures = {**self.captures, capture_id: changed}
        return changed

    def check(self, event: session_log.AnyEvent) -> None:
        """Check an event that comes from a disk, and note the ids of what is not known.

        Raises:
            ValueError: It cannot have happened.
            BadUpload: Nor can a camera be as it says.
        """
        if isinstance(event, session_log.SessionBegun):
            raise ValueError("the session begins twice")
        if isinstance(event, session_log.CaptureStored):
            msgspec.convert(event.id, wire.Id)
            camera_of_wire(event.camera)
            if event.corrected_world_from_cam is not None:
                pose_of_wire(event.corrected_world_from_cam, name="corrected_world_from_cam")
            if event.id in self.captures:
                raise ValueError(f"there are two captures of id {event.id}")
            if not 1 <= event.number <= MAX_NUMBER:
                raise ValueError("no capture has such a number")
            if event.number in (c.number for c in self.captures.values()):
                raise ValueError(f"there are two captures of number {event.number}")
        known = getattr(event, "id", None) in self.captures
        if isinstance(event, _ENDINGS) and not known:
            self.taken_ids.add(event.id)
        elif isinstance(event, session_log.CaptureRestored) and not known:
            self.taken_ids.discard(event.id)

    def apply(self, event: session_log.AnyEvent) -> None:
        """Let an event have happened.

        Raises:
            UnknownCapture: The capture that it is about is not here.
        """
        match event:
            case session_log.CaptureStored():
                self.number = max(self.number, event.number)
                capture = wire.Capture(
                    id=event.id,
                    number=event.number,
                    camera=event.camera,
                    time_s=event.time_s,
                    state="queued",
                    corrected_world_from_cam=event.corrected_world_from_cam,
                    automatic=event.automatic,
                )
                sent = ((photo_name, True), (depth_name, event.depth), (points_name, event.points))
                self._files[event.id] = [name_of(event.number) for name_of, there in sent if there]
                self.captures = {**self.captures, event.id: capture}
            case session_log.CaptureRemoved():
                before = self.capture(event.id)
                there = before.restorable or not before.removed
                restorable = self.finished_s is None and there
                self.change(event.id, removed=True, ending="undone", restorable=restorable)
            case session_log.CaptureSetAside():
                self.change(event.id, removed=True, ending="set_aside", restorable=True)
                self._set_aside.pop(event.id, None)
                self._set_aside[event.id] = None
            case session_log.CaptureRestored():
                self.change(event.id, removed=False, ending=None, restorable=False, automatic=False)
            case session_log.CaptureDropped():
                self.change(event.id, restorable=False)
            case session_log.CaptureErased():
                self.change(event.id, removed=True, ending="erased", restorable=False)
            case session_log.MpiMade():
                self.change(
                    event.id,
                    mpi_version=event.version,
                    generator=event.generator,
                    guessed=event.guessed,
                )
            case session_log.SessionNamed():
                self.name = event.name
            case session_log.SessionFinished():
                self.finished_s = event.at_s if event.finished else None
                undone = [c.id for c in self.captures.values() if c.ending == "undone"]
                for capture_id in undone if event.finished else ():
                    self.change(capture_id, restorable=False)
            case session_log.SessionDeleted():
                self.deleted_s = event.at_s
            case session_log.SessionRestored():
                self.deleted_s = None
            case session_log.SessionBegun():
                pass  # it has
