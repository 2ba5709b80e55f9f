"""One session on disk: a folder that is a data set, and nothing acknowledged is ever lost.

A capture exists from the moment its line is in the session's log; by then its photo, depth and
points are on the disk. transforms.json, thumbnails and MPIs follow from that and are made again
when missing. An undo moves files to `removed/`; nothing is deleted.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from peaking.datasets.point_cloud import encode_points, read_points
from peaking.datasets.stored_images import read_depth, read_picture
from peaking.errors import PeakingError, RecordingError
from peaking.event_log import append
from peaking.frame import Frame
from peaking.mpi_file import is_current
from peaking.options import GeneratorName
from peaking.output import encode_png, write_atomically
from peaking.server import session_log, wire
from peaking.server.dataset import (
    depth_name,
    frame_json,
    photo_name,
    points_name,
    transforms_json,
)
from peaking.server.disk_full import DiskFull, room_explained
from peaking.server.session_log import SessionLog
from peaking.server.upload import Upload, camera_of_wire

TRANSFORMS = "transforms.json"
FAST: GeneratorName = "layered"
"""The generator whose MPIs are made at once."""

ERASED = "The session was erased."
KEPT = ("images", "depth", "points")
"""Folders of what was sent."""

FOLDERS = (*KEPT, "mpi", *(f"removed/{name}" for name in KEPT))
_log = logging.getLogger("peaking.server")


class UnknownSession(PeakingError):
    """There is no session of this id."""


class UnknownCapture(PeakingError):
    """There is no capture of this id in the session."""


class OpenSession:
    """One session and its folder. May be used from several threads."""

    def __init__(self, folder: Path, *, clock: Callable[[], float]) -> None:
        """Open the session in `folder`, and mend what a crash left.

        Raises:
            RecordingError: The log is damaged.
        """
        self.folder = folder
        self.peaked_share: float | None = None
        self._peaked_s: set[float] = set()
        self._clock = clock
        self._lock = threading.RLock()
        self._log = SessionLog(folder / session_log.FILE_NAME)
        self._captures: dict[str, wire.Capture] = {}
        self._files: dict[str, list[str]] = {}
        self._entries: dict[str, str] = {}
        self._number = 0
        self._erased = False
        self._finished = False
        events = self._log.read()
        begun = next(events, None)
        if not isinstance(begun, session_log.SessionBegun):
            raise RecordingError(
                self._log.path, "does not begin with SessionBegun", remedy="move the folder away"
            )
        if begun.version != session_log.VERSION:
            raise RecordingError(
                self._log.path,
                f"is of version {begun.version}, this peaking reads {session_log.VERSION}",
                field="version",
                remedy="open it with the peaking that wrote it",
            )
        self.id, self.name = begun.session.id, begun.session.name
        self._begun = begun
        for event in events:
            self._replay(event)
        self._mend()

    # Reading

    @property
    def captures(self) -> list[wire.Capture]:
        """All captures in the order they arrived, removed ones too."""
        with self._lock:
            return list(self._captures.values())

    def capture(self, capture_id: str) -> wire.Capture:
        """Return one capture.

        Raises:
            UnknownCapture: It is not here.
        """
        with self._lock:
            if capture_id not in self._captures:
                raise UnknownCapture("There is no such capture in this session.")
            return self._captures[capture_id]

    def summary(self, *, live: bool = False) -> wire.SessionSummary:
        """Return the line of the list of sessions."""
        with self._lock:
            kept = [capture for capture in self._captures.values() if not capture.removed]
            return wire.SessionSummary(
                id=self.id,
                name=self.name,
                folder=self.folder.name,
                source=self._begun.session.source,
                device=self._begun.session.device,
                created_s=self._begun.at_s,
                finished=self._finished,
                captures=len(kept),
                ready=sum(capture.state == "ready" for capture in kept),
                peaked_share=self.peaked_share,
                live=live,
            )

    def session(self, *, live: bool = False) -> wire.Session:
        """Return the whole state."""
        with self._lock:
            return wire.Session(self.summary(live=live), self.captures)

    def unfinished(self, generator: str) -> list[str]:
        """Return the ids of captures whose MPI, or the better one, is still to be made."""
        return [
            c.id
            for c in self.captures
            if not c.removed
            and (c.state == "queued" or (c.generator == FAST and c.generator != generator))
        ]

    def frame_of(self, capture_id: str) -> Frame:
        """Read a capture back as it was photographed.

        Raises:
            UnknownCapture: It is not here.
            RecordingError: Its files cannot be read.
        """
        capture = self.capture(capture_id)
        files = self._files[capture_id]
        depth_m = points_m = None
        if (name := depth_name(capture.number)) in files:
            depth_m = read_depth(self._path(capture, name), 0.001)
        if (name := points_name(capture.number)) in files:
            points_m = read_points(self._path(capture, name))
        return Frame(
            name=f"{capture.number:06d}",
            rgb=read_picture(self.photo_path(capture_id)),
            camera=camera_of_wire(capture.camera),
            depth_m=depth_m,
            timestamp_s=float(capture.time_s),
            points_m=points_m,
        )

    def photo_path(self, capture_id: str) -> Path:
        """Return where the photo lies."""
        capture = self.capture(capture_id)
        return self._path(capture, photo_name(capture.number))

    def mpi_path(self, capture_id: str, version: int = 1) -> Path:
        """Return where a version of the MPI lies, or will."""
        suffix = "mpi" if version == 1 else f"{version}.mpi"
        return self.folder / "mpi" / f"{self.capture(capture_id).number:06d}.{suffix}"

    def dataset_files(self) -> list[tuple[str, Path | bytes]]:
        """Return names and contents of the data set, without what was undone."""
        with self._lock:
            files: list[tuple[str, Path | bytes]] = [(TRANSFORMS, self._transforms())]
            for capture in self._captures.values():
                if capture.removed:
                    continue
                files += [(name, self._path(capture, name)) for name in self._files[capture.id]]
            return files

    def peaked(self) -> list[wire.PeakedSample]:
        """Return all that phones told about peaked shares."""
        with self._lock, contextlib.suppress(FileNotFoundError):
            lines = (self.folder / "peaked.jsonl").read_bytes().split(b"\n")[:-1]
            return [msgspec.json.decode(line, type=wire.PeakedSample) for line in lines]
        return []

    # Changing

    def store_capture(self, capture_id: str, upload: Upload) -> tuple[wire.Capture, bool]:
        """Keep a capture; return it, and whether it is new. On the disk when this returns.

        Raises:
            DiskFull: There is no room.
            OSError: The disk fails in another way.
        """
        with self._lock:
            if capture_id in self._captures:
                return self._captures[capture_id], False
            number = self._number + 1
            header = upload.header
            stored = session_log.CaptureStored(
                at_s=self._clock(),
                id=capture_id,
                number=number,
                camera=header.camera,
                time_s=header.time_s,
                depth=upload.depth_mm is not None,
                points=upload.points_m is not None,
            )
            files = {photo_name(number): upload.photo}
            if upload.depth_mm is not None:
                files[depth_name(number)] = encode_png(upload.depth_mm)
            if upload.points_m is not None:
                files[points_name(number)] = encode_points(upload.points_m)
            try:
                with room_explained():
                    for name, data in files.items():
                        write_atomically(self.folder / name, data)
                    self._log.append(stored)
            except DiskFull:
                for name in files:
                    (self.folder / name).unlink(missing_ok=True)
                raise
            self._replay(stored)
            return self._captures[capture_id], True

    def remove_capture(self, capture_id: str) -> wire.Capture:
        """Undo a capture; again does nothing.

        Raises:
            UnknownCapture: It is not here.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            capture = self.capture(capture_id)
            if not capture.removed:
                event = session_log.CaptureRemoved(at_s=self._clock(), id=capture_id)
                with room_explained():
                    self._log.append(event)
                self._replay(event)
                self._move_aside(self._captures[capture_id])
            return self._captures[capture_id]

    def mark_ready(
        self, capture_id: str, mpi: bytes, *, generator: str, guessed: bool = False
    ) -> wire.Capture:
        """Keep an MPI of a capture; it is the newest from now on.

        Raises:
            DiskFull: There is no room for it.
        """
        with self._lock, room_explained():
            if self._erased:
                return self.mark_failed(capture_id, ERASED)
            version = self.capture(capture_id).mpi_version + 1
            write_atomically(self.mpi_path(capture_id, version), mpi)
            made = session_log.MpiMade(
                at_s=self._clock(),
                id=capture_id,
                version=version,
                generator=generator,
                guessed=guessed,
            )
            self._log.append(made)
            self._replay(made)
            return self._change(capture_id, state="ready", mpi_bytes=len(mpi), problem=None)

    def mark_not_better(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why no better MPI was made; the one that is there stays."""
        return self._change(capture_id, problem=problem)

    def mark_failed(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why there is no MPI of a capture; it is tried again after a restart."""
        return self._change(capture_id, state="failed", problem=problem)

    def rename(self, name: str) -> None:
        """Give the session another name."""
        with self._lock:
            event = session_log.SessionNamed(at_s=self._clock(), name=name)
            with room_explained():
                self._log.append(event)
            self._replay(event)

    def finish(self, finished: bool) -> None:
        """Say that it is finished, or that it goes on."""
        with self._lock:
            event = session_log.SessionFinished(at_s=self._clock(), finished=finished)
            with room_explained():
                self._log.append(event)
            self._replay(event)

    def add_peaked(self, samples: Sequence[wire.PeakedSample]) -> None:
        """Append what a phone told, each sample once; not waited for until it is on the disk.

        Raises:
            DiskFull: There is no room; none of it was kept.
        """
        with self._lock:
            new = {s.time_s: s for s in samples if s.time_s not in self._peaked_s}
            if not new:
                return
            lines = b"".join(msgspec.json.encode(sample) + b"\n" for sample in new.values())
            with room_explained():
                append(self.folder / "peaked.jsonl", lines, durably=False)
            self._peaked_s.update(new)
            self.peaked_share = samples[-1].peaked_share

    def refresh_dataset(self) -> None:
        """Write transforms.json anew when it is not what it should be.

        On a full disk the old one stays until the next time: it follows from the log.
        """
        with self._lock:
            path, wanted = self.folder / TRANSFORMS, self._transforms()
            if self._erased or (path.is_file() and path.read_bytes() == wanted):
                return
            try:
                with room_explained():
                    write_atomically(path, wanted)
            except DiskFull:
                _log.warning("%s is not up to date: the disk is full", path)

    def erase(self) -> None:
        """Delete the folder; what is still being made of it is thrown away."""
        with self._lock:
            self._erased = True
            hidden = self.folder.with_name(f".{self.folder.name}.erased")
            with contextlib.suppress(FileNotFoundError):
                self.folder.rename(hidden)
            shutil.rmtree(hidden, ignore_errors=True)

    # Inside

    def _replay(self, event: session_log.AnyEvent) -> None:
        match event:
            case session_log.CaptureStored():
                self._number = max(self._number, event.number)
                self._captures[event.id] = wire.Capture(
                    id=event.id,
                    number=event.number,
                    camera=event.camera,
                    time_s=event.time_s,
                    state="queued",
                )
                sent = ((photo_name, True), (depth_name, event.depth), (points_name, event.points))
                self._files[event.id] = [name_of(event.number) for name_of, there in sent if there]
            case session_log.CaptureRemoved():
                self._change(event.id, removed=True)
            case session_log.MpiMade():
                self._change(
                    event.id,
                    mpi_version=event.version,
                    generator=event.generator,
                    guessed=event.guessed,
                )
            case session_log.SessionNamed():
                self.name = event.name
            case session_log.SessionFinished():
                self._finished = event.finished
            case session_log.SessionBegun():
                raise RecordingError(
                    self._log.path, "begins twice", remedy="split it into two folders by hand"
                )

    def _change(self, capture_id: str, **fields: object) -> wire.Capture:
        with self._lock:
            changed = msgspec.structs.replace(self.capture(capture_id), **fields)
            self._captures[capture_id] = changed
            return changed

    def _mend(self) -> None:
        """Finish interrupted undos, find the MPIs that are there, drop half-written files."""
        for folder in FOLDERS:
            (self.folder / folder).mkdir(parents=True, exist_ok=True)
            for leftover in (self.folder / folder).glob(".*.partial*"):
                leftover.unlink()
        for capture in self.captures:
            if capture.removed:
                self._move_aside(capture)
            self._find_mpi(capture)
        self._drop_torn_sample()
        samples = self.peaked()
        self.peaked_share = samples[-1].peaked_share if samples else None
        self._peaked_s = {sample.time_s for sample in samples}
        self.refresh_dataset()

    def _find_mpi(self, capture: wire.Capture) -> None:
        """Take the newest MPI on the disk; when it is gone, or of an old format, it is made again.

        Its version stays what it was, so that an address never means something else.
        """
        mpi = self.mpi_path(capture.id, max(capture.mpi_version, 1))
        if is_current(mpi):
            self._change(
                capture.id,
                state="ready",
                mpi_bytes=mpi.stat().st_size,
                mpi_version=max(capture.mpi_version, 1),
                generator=capture.generator or FAST,
            )

    def _drop_torn_sample(self) -> None:
        with contextlib.suppress(FileNotFoundError):
            path = self.folder / "peaked.jsonl"
            data = path.read_bytes()
            whole = data.rfind(b"\n") + 1
            if whole < len(data):
                os.truncate(path, whole)

    def _move_aside(self, capture: wire.Capture) -> None:
        for name in self._files[capture.id]:
            with contextlib.suppress(FileNotFoundError):
                (self.folder / name).rename(self.folder / "removed" / name)

    def _path(self, capture: wire.Capture, name: str) -> Path:
        return self.folder / "removed" / name if capture.removed else self.folder / name

    def _transforms(self) -> bytes:
        kept = [c for c in self._captures.values() if not c.removed]
        for capture in kept:
            if capture.id not in self._entries:
                self._entries[capture.id] = frame_json(capture, self._files[capture.id])
        return transforms_json(self._entries[capture.id] for capture in kept)
