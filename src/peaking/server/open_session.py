"""One session on disk: a folder that is a data set, and nothing acknowledged is ever lost.

A capture exists from the moment its line is in the session's log; by then its photo, depth and
points are on the disk. transforms.json, thumbnails and MPIs follow from that and are made again
when missing. What is undone or set aside is moved to `removed/`; docs/protocol.md tells the four
endings of a photo apart.

Reading takes no lock: the captures are a mapping that is replaced, never changed.
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import msgspec

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.point_cloud import encode_points, read_points
from peaking.datasets.stored_images import read_depth, read_picture
from peaking.errors import PeakingError, RecordingError
from peaking.event_log import append
from peaking.frame import Frame
from peaking.mpi_file import is_current, is_sound
from peaking.options import GeneratorName
from peaking.output import encode_png, flush, write_atomically, write_new
from peaking.server import session_log, wire
from peaking.server.dataset import (
    depth_name,
    frame_json,
    photo_name,
    points_name,
    transforms_json,
)
from peaking.server.disk_full import DiskFull, room_explained
from peaking.server.recovery import recovered_captures
from peaking.server.session_log import SessionLog
from peaking.server.told import without_paths
from peaking.server.upload import Upload, camera_of_wire

TRANSFORMS = "transforms.json"
PEAKED = "peaked.jsonl"
FAST: GeneratorName = "layered"
"""The generator whose MPIs are made at once."""

ERASED = "The session was erased, for good."
DELETED = (
    "The session was deleted. For 30 days it can be restored: open the list of sessions on the "
    "server."
)
SET_ASIDE_BYTES = 2_000_000_000
"""Of a session's photos that the program set aside; beyond it, those longest aside are deleted."""
KEPT = ("images", "depth", "points")
"""Folders of what was sent."""

FOLDERS = (*KEPT, "mpi", "removed", *(f"removed/{name}" for name in KEPT))
_log = logging.getLogger("peaking.server")


class UnknownSession(PeakingError):
    """There is no session of this id."""


class UnknownCapture(PeakingError):
    """There is no capture of this id in the session."""


class SessionGone(PeakingError):
    """The session was deleted (`final` false) or erased: nothing is taken in or given out."""

    def __init__(self, *, final: bool) -> None:
        """Say which of the two."""
        super().__init__(ERASED if final else DELETED)
        self.final = final


class NotRestorable(PeakingError):
    """The files of a capture are deleted."""


class OpenSession:
    """One session and its folder. May be used from several threads."""

    def __init__(self, folder: Path, *, clock: Callable[[], float]) -> None:
        """Open the session in `folder`, and mend what a crash left.

        Records that cannot be read are left out; `problems` has a sentence for each.

        Raises:
            RecordingError: The beginning of the log is damaged.
        """
        self.folder = folder
        self.peaked_share: float | None = None
        self.problems: list[str] = []
        self.deleted_s: float | None = None
        self._peaked_s: set[float] = set()
        self._clock = clock
        self._lock = threading.RLock()
        self._log = SessionLog(folder / session_log.FILE_NAME)
        self._captures: Mapping[str, wire.Capture] = {}
        self._files: dict[str, list[str]] = {}
        self._entries: dict[str, str] = {}
        self._set_aside: list[str] = []
        self._number = 0
        self._erased = False
        self._finished = False
        events, problems = self._log.read()
        begun = events[0] if events else None
        if not isinstance(begun, session_log.SessionBegun):
            raise RecordingError(
                self._log.path,
                "does not begin with SessionBegun" + "".join(f" ({p})" for p in problems[:1]),
                remedy="the session is set aside and its photos are untouched; open the folder as "
                "a recording, or move it away",
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
        self.problems += problems
        for event in events[1:]:
            try:
                self._replay(event)
            except (PeakingError, ValueError) as error:
                kind = type(event).__name__
                self.problems.append(f"{self._log.path}: {kind} was left out: {error}")
        self._mend()

    # Reading

    @property
    def captures(self) -> list[wire.Capture]:
        """All captures in the order they arrived, removed ones too."""
        return list(self._captures.values())

    @property
    def owner(self) -> str | None:
        """The participant of a study who was granted this session."""
        return self._begun.session.owner

    def capture(self, capture_id: str) -> wire.Capture:
        """Return one capture.

        Raises:
            UnknownCapture: It is not here.
        """
        found = self._captures.get(capture_id)
        if found is None:
            raise UnknownCapture("There is no such capture in this session.")
        return found

    def shown_capture(self, capture_id: str) -> wire.Capture:
        """Return one capture whose pictures may be seen: not one that was undone.

        Raises:
            UnknownCapture: It is not here, or was undone, or its files are deleted.
        """
        capture = self.capture(capture_id)
        if capture.removed and not (capture.ending == "set_aside" and capture.restorable):
            raise UnknownCapture("This capture was taken back.")
        return capture

    def summary(self, *, live: bool = False) -> wire.SessionSummary:
        """Return the line of the list of sessions."""
        kept = [capture for capture in self.captures if not capture.removed]
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
            deleted_s=self.deleted_s,
            damaged=len(self.problems),
        )

    def session(self, *, live: bool = False) -> wire.Session:
        """Return the whole state."""
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
            depth_m = read_depth(self._path(capture, name), 0.001, within=self.folder)
        if (name := points_name(capture.number)) in files:
            points_m = read_points(self._path(capture, name), within=self.folder)
        return Frame(
            name=f"{capture.number:06d}",
            rgb=read_picture(self.photo_path(capture_id), within=self.folder),
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

    def mpi_bytes(self, capture_id: str, version: int) -> bytes | None:
        """Return a version of an MPI; None where the file is gone or damaged.

        Raises:
            UnknownCapture: The capture is not here, or was undone.
        """
        self.shown_capture(capture_id)
        try:
            data = read_bytes(self.mpi_path(capture_id, version), within=self.folder)
        except RecordingError:
            return None
        return data if is_sound(data) else None

    def kept_thumbnail(self, capture_id: str) -> bytes | None:
        """Return a capture's thumbnail; None where there is none yet, or it is damaged.

        Raises:
            UnknownCapture: The capture is not here, or was undone.
        """
        number = self.shown_capture(capture_id).number
        for path in (self.folder / "mpi").glob(f"{number:06d}.thumbnail.*.jpg"):
            with contextlib.suppress(RecordingError):
                data = read_bytes(path, within=self.folder)
                if path.name == _thumbnail_name(number, data):
                    return data
        return None

    def keep_thumbnail(self, capture_id: str, data: bytes) -> None:
        """Keep a capture's thumbnail, unless the disk is full or the capture gone meanwhile."""
        with self._lock:
            capture = self.capture(capture_id)
            if self._erased or self.deleted_s is not None or _is_lost(capture):
                return
            for damaged in (self.folder / "mpi").glob(f"{capture.number:06d}.thumbnail.*"):
                damaged.unlink(missing_ok=True)
            path = self.folder / "mpi" / _thumbnail_name(capture.number, data)
            with contextlib.suppress(DiskFull), room_explained():
                write_atomically(path, data)

    def dataset_files(self) -> list[tuple[str, Path | bytes]]:
        """Return names and contents of the data set, without what was undone or set aside.

        Raises:
            SessionGone: The session is deleted.
        """
        with self._lock:
            self._refuse_gone()
            files: list[tuple[str, Path | bytes]] = [(TRANSFORMS, self._transforms())]
            for capture in self._captures.values():
                if capture.removed:
                    continue
                files += [(name, self._path(capture, name)) for name in self._files[capture.id]]
            return files

    def peaked(self) -> list[wire.PeakedSample]:
        """Return all that phones told about peaked shares, without damaged samples."""
        return self._read_samples()[0]

    # Changing

    def store_capture(self, capture_id: str, upload: Upload) -> tuple[wire.Capture, bool]:
        """Keep a capture; return it, and whether it is new. On the disk when this returns.

        Raises:
            SessionGone: The session is deleted.
            DiskFull: There is no room.
            OSError: The disk fails in another way.
        """
        with self._lock:
            self._refuse_gone()
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
            written: list[Path] = []
            try:
                with room_explained():
                    for name, data in files.items():
                        write_new(self.folder / name, data)
                        written.append(self.folder / name)
                    self._log.append(stored)
            except DiskFull:
                for path in written:
                    path.unlink(missing_ok=True)
                raise
            except BaseException:
                self._number = number  # what was written may be there still: nothing replaces it
                raise
            self._replay(stored)
            return self._captures[capture_id], True

    def remove_capture(self, capture_id: str) -> wire.Capture:
        """Undo a capture; again does nothing. It can be restored until the session is finished.

        Raises:
            SessionGone: The session is deleted.
            UnknownCapture: It is not here.
            DiskFull: There is no room to note it.
        """
        return self._end(capture_id, session_log.CaptureRemoved(self._clock(), id=capture_id))

    def set_aside(self, capture_id: str) -> wire.Capture:
        """Take a capture out of the data set, on behalf of the program; again does nothing.

        It can be restored while the session's photos that are set aside have no more than
        `SET_ASIDE_BYTES`; beyond it, those longest aside are deleted.

        Raises:
            SessionGone: The session is deleted.
            UnknownCapture: It is not here.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            ended = session_log.CaptureSetAside(self._clock(), id=capture_id)
            self._end(capture_id, ended)
            self._drop_longest_aside()
            return self.capture(capture_id)

    def restore_capture(self, capture_id: str) -> wire.Capture:
        """Take a capture that was undone or set aside into the data set again.

        Raises:
            SessionGone: The session is deleted.
            UnknownCapture: It is not here.
            NotRestorable: Its files are deleted.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            self._refuse_gone()
            capture = self.capture(capture_id)
            if not capture.removed:
                return capture
            if not capture.restorable:
                raise NotRestorable(_why_not_restorable(capture))
            # The files first: a photo in removed/ was taken back, whatever the log says.
            restored = session_log.CaptureRestored(self._clock(), id=capture_id)
            self._put_files_where_they_belong(msgspec.structs.replace(capture, removed=False))
            self._note(restored)
            return self.capture(capture_id)

    def erase_capture(self, capture_id: str) -> wire.Capture:
        """Delete a capture's files and all that was made of them, for ever; again does nothing.

        Raises:
            SessionGone: The session is deleted.
            UnknownCapture: It is not here.
            DiskFull: There is no room to note it.
        """
        with self._lock:
            self._refuse_gone()
            if self.capture(capture_id).ending != "erased":
                self._note(session_log.CaptureErased(self._clock(), id=capture_id))
            self._put_files_where_they_belong(self.capture(capture_id))
            return self.capture(capture_id)

    def mark_ready(
        self, capture_id: str, mpi: bytes, *, generator: str, guessed: bool = False
    ) -> wire.Capture:
        """Keep an MPI of a capture; it is the newest from now on.

        Raises:
            DiskFull: There is no room for it.
        """
        with self._lock, room_explained():
            gone = self._erased or self.deleted_s is not None
            if gone or _is_lost(self.capture(capture_id)):
                return self.mark_failed(capture_id, ERASED if self._erased else DELETED)
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

    def mark_damaged(self, capture_id: str, version: int) -> bool:
        """Have an MPI made again whose file is gone or damaged; False when that is due already."""
        with self._lock:
            capture = self.capture(capture_id)
            if capture.state != "ready" or capture.mpi_version != version:
                return False
            self._change(capture_id, state="queued", mpi_bytes=None)
            return True

    def mark_not_better(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why no better MPI was made; the one that is there stays."""
        return self._change(capture_id, problem=without_paths(problem, self.folder))

    def mark_failed(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why there is no MPI of a capture; it is tried again after a restart."""
        problem = without_paths(problem, self.folder)
        return self._change(capture_id, state="failed", problem=problem)

    def rename(self, name: str) -> None:
        """Give the session another name."""
        with self._lock:
            self._refuse_gone()
            if name != self.name:
                self._note(session_log.SessionNamed(at_s=self._clock(), name=name))

    def finish(self, finished: bool) -> None:
        """Say that it is finished, or that it goes on; again does nothing.

        Finishing deletes the files of what was undone.
        """
        with self._lock:
            self._refuse_gone()
            if finished == self._finished:
                return
            self._note(session_log.SessionFinished(at_s=self._clock(), finished=finished))
            for capture in self.captures:
                self._put_files_where_they_belong(capture)

    def delete(self) -> None:
        """Note that the whole session is deleted; again does nothing."""
        with self._lock:
            if self.deleted_s is None:
                self._note(session_log.SessionDeleted(at_s=self._clock()))

    def restore(self) -> None:
        """Note that it is not deleted any more; again does nothing."""
        with self._lock:
            if self.deleted_s is not None:
                self._note(session_log.SessionRestored(at_s=self._clock()))

    def move(self, folder: Path) -> None:
        """Move the session's folder; does nothing where it is there already."""
        with self._lock:
            if folder != self.folder:
                self.folder.rename(folder)
                self.folder = folder
                self._log = SessionLog(folder / session_log.FILE_NAME)
                flush(folder.parent)

    def add_peaked(self, samples: Sequence[wire.PeakedSample]) -> None:
        """Append what a phone told, each sample once; not waited for until it is on the disk.

        Raises:
            DiskFull: There is no room; none of it was kept.
        """
        with self._lock:
            self._refuse_gone()
            new = {s.time_s: s for s in samples if s.time_s not in self._peaked_s}
            if not new:
                return
            lines = b"".join(msgspec.json.encode(sample) + b"\n" for sample in new.values())
            with room_explained():
                append(self.folder / PEAKED, lines, durably=False)
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

    def close_for_ever(self) -> None:
        """Take in and give out nothing more: the session is erased."""
        with self._lock:
            self._erased = True

    # Inside

    def _replay(self, event: session_log.AnyEvent) -> None:
        match event:
            case session_log.CaptureStored():
                camera_of_wire(event.camera)
                if event.number < 1 or event.number in (c.number for c in self.captures):
                    raise ValueError(f"there are two captures of number {event.number}")
                self._number = max(self._number, event.number)
                capture = wire.Capture(
                    id=msgspec.convert(event.id, wire.Id),
                    number=event.number,
                    camera=event.camera,
                    time_s=event.time_s,
                    state="queued",
                )
                self._captures = {**self._captures, event.id: capture}
                sent = ((photo_name, True), (depth_name, event.depth), (points_name, event.points))
                self._files[event.id] = [name_of(event.number) for name_of, there in sent if there]
            case session_log.CaptureRemoved():
                self._change(event.id, removed=True, ending="undone", restorable=True)
            case session_log.CaptureSetAside():
                self._change(event.id, removed=True, ending="set_aside", restorable=True)
                self._set_aside.append(event.id)
            case session_log.CaptureRestored():
                self._change(event.id, removed=False, ending=None, restorable=False)
            case session_log.CaptureDropped():
                self._change(event.id, restorable=False)
            case session_log.CaptureErased():
                self._change(event.id, removed=True, ending="erased", restorable=False)
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
                undone = [c.id for c in self.captures if c.ending == "undone"]
                for capture_id in undone if event.finished else ():
                    self._change(capture_id, restorable=False)
            case session_log.SessionDeleted():
                self.deleted_s = event.at_s
            case session_log.SessionRestored():
                self.deleted_s = None
            case session_log.SessionBegun():
                raise RecordingError(
                    self._log.path, "begins twice", remedy="split it into two folders by hand"
                )

    def _change(self, capture_id: str, **fields: object) -> wire.Capture:
        with self._lock:
            changed = msgspec.structs.replace(self.capture(capture_id), **fields)
            self._captures = {**self._captures, capture_id: changed}
            return changed

    def _note(self, event: session_log.AnyEvent) -> None:
        """Let something have happened: first on the disk, then here."""
        with room_explained():
            self._log.append(event)
        self._replay(event)

    def _refuse_gone(self) -> None:
        if self._erased or self.deleted_s is not None:
            raise SessionGone(final=self._erased)

    def _end(
        self, capture_id: str, event: session_log.CaptureRemoved | session_log.CaptureSetAside
    ) -> wire.Capture:
        with self._lock:
            self._refuse_gone()
            if not self.capture(capture_id).removed:
                self._note(event)
                self._put_files_where_they_belong(self.capture(capture_id))
            return self.capture(capture_id)

    def _drop_longest_aside(self) -> None:
        ids = dict.fromkeys(reversed(self._set_aside))  # the last time that each was set aside
        aside = [self.capture(capture_id) for capture_id in reversed(ids)]
        aside = [c for c in aside if c.ending == "set_aside" and c.restorable]
        sizes = {c.id: sum(_size(self._path(c, name)) for name in self._files[c.id]) for c in aside}
        while aside and sum(sizes[c.id] for c in aside) > SET_ASIDE_BYTES:
            longest = aside.pop(0)
            self._note(session_log.CaptureDropped(self._clock(), id=longest.id))
            self._put_files_where_they_belong(self.capture(longest.id))

    def _mend(self) -> None:
        """Finish what was interrupted, find the MPIs that are there, drop half-written files."""
        for folder in FOLDERS:
            (self.folder / folder).mkdir(parents=True, exist_ok=True)
            for leftover in (self.folder / folder).glob(".*.partial*"):
                leftover.unlink()
        self._number = max(self._number, *map(self._highest_number, (*KEPT, "removed/images")))
        self._recover_captures()
        for capture in self.captures:
            self._recover_undo(capture)
            self._put_files_where_they_belong(self.capture(capture.id))
            self._find_mpi(self.capture(capture.id))
        samples, damaged = self._read_samples()
        if damaged:
            path = self.folder / PEAKED
            self.problems.append(f"{path}: {damaged} samples cannot be read; they were left out")
        self._drop_torn_sample()
        self.peaked_share = samples[-1].peaked_share if samples else None
        self._peaked_s = {sample.time_s for sample in samples}
        self.refresh_dataset()

    def _highest_number(self, folder: str) -> int:
        """Return the highest number of a file: it is never given again, whatever the log lost."""
        numbers = [path.stem for path in (self.folder / folder).iterdir()]
        return max((int(n) for n in numbers if n.isascii() and n.isdigit()), default=0)

    def _recover_captures(self) -> None:
        """Note captures again whose line in the log is lost, as transforms.json still has them."""
        if not self.problems and self._number == len(self._captures):
            return
        for stored in recovered_captures(self.folder / TRANSFORMS, at_s=self._clock()):
            photo = self.folder / photo_name(stored.number)
            if stored.id in self._captures or not photo.exists():
                continue
            with contextlib.suppress(PeakingError, ValueError):
                self._replay(stored)
                self._log.append(stored)
        self._drop_sent_again()

    def _drop_sent_again(self) -> None:
        """Delete photos that no capture has and that are another's to the byte.

        They were written before a crash, nobody was told, and the phone sent them again.
        """
        known = {photo_name(capture.number): capture for capture in self.captures}
        photos = [self._path(capture, name) for name, capture in known.items()]
        for path in (self.folder / "images").iterdir():
            if f"images/{path.name}" in known:
                continue
            size = _size(path)
            again = any(_size(p) == size and p.read_bytes() == path.read_bytes() for p in photos)
            if size and again:
                path.unlink()
                for name in (depth_name(int(path.stem)), points_name(int(path.stem))):
                    (self.folder / name).unlink(missing_ok=True)

    def _recover_undo(self, capture: wire.Capture) -> None:
        """Believe the photo's place where the line about it is lost."""
        name = photo_name(capture.number)
        there, aside = (self.folder / name).exists(), (self.folder / "removed" / name).exists()
        if capture.removed or there:
            self._change(capture.id, restorable=capture.restorable and (there or aside))
        elif aside:
            self._note(session_log.CaptureRemoved(self._clock(), id=capture.id))
        else:
            self.problems.append(f"{self.folder / name}: is missing")
            self._change(capture.id, removed=True, ending="erased", restorable=False)

    def _find_mpi(self, capture: wire.Capture) -> None:
        """Take the newest MPI on the disk; when it is gone, or of an old format, it is made again.

        Its version stays what it was, so that an address never means something else.
        """
        mpi = self.mpi_path(capture.id, max(capture.mpi_version, 1))
        if capture.ending != "erased" and is_current(mpi):
            self._change(
                capture.id,
                state="ready",
                mpi_bytes=mpi.stat().st_size,
                mpi_version=max(capture.mpi_version, 1),
                generator=capture.generator or FAST,
            )

    def _read_samples(self) -> tuple[list[wire.PeakedSample], int]:
        """Return the samples, and how many lines are damaged."""
        try:
            lines = (self.folder / PEAKED).read_bytes().split(b"\n")[:-1]
        except FileNotFoundError:
            return [], 0
        samples: list[wire.PeakedSample] = []
        for line in lines:
            with contextlib.suppress(msgspec.DecodeError, UnicodeDecodeError):
                samples.append(msgspec.json.decode(line, type=wire.PeakedSample))
        return samples, len(lines) - len(samples)

    def _drop_torn_sample(self) -> None:
        with contextlib.suppress(FileNotFoundError):
            path = self.folder / PEAKED
            data = path.read_bytes()
            whole = data.rfind(b"\n") + 1
            if whole < len(data):
                os.truncate(path, whole)

    def _put_files_where_they_belong(self, capture: wire.Capture) -> None:
        """Move a capture's files to or from `removed/`; delete them when it cannot be restored."""
        for name in self._files[capture.id]:
            kept, aside = self.folder / name, self.folder / "removed" / name
            if capture.removed and not capture.restorable:
                kept.unlink(missing_ok=True)
                aside.unlink(missing_ok=True)
                continue
            source, target = (kept, aside) if capture.removed else (aside, kept)
            if source.exists() and not target.exists():
                source.rename(target)
        if capture.removed and not capture.restorable:
            for made in (self.folder / "mpi").glob(f"{capture.number:06d}.*"):
                made.unlink(missing_ok=True)

    def _path(self, capture: wire.Capture, name: str) -> Path:
        return self.folder / "removed" / name if capture.removed else self.folder / name

    def _transforms(self) -> bytes:
        kept = [c for c in self._captures.values() if not c.removed]
        for capture in kept:
            if capture.id not in self._entries:
                self._entries[capture.id] = frame_json(capture, self._files[capture.id])
        return transforms_json(self._entries[capture.id] for capture in kept)


def _why_not_restorable(capture: wire.Capture) -> str:
    match capture.ending:
        case "erased":
            return "This photo was erased, for good."
        case "set_aside":
            return "This photo was set aside long ago, and deleted to make room."
        case _:
            return "This photo was undone and the session finished since then: it is deleted."


def _is_lost(capture: wire.Capture) -> bool:
    """Return whether the files of a capture are deleted, and must not be made again."""
    return capture.removed and not capture.restorable


def _thumbnail_name(number: int, data: bytes) -> str:
    return f"{number:06d}.thumbnail.{zlib.crc32(data):08x}.jpg"


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
