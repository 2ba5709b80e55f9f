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
import threading
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import msgspec

from peaking.datasets.depth_files import read_depth
from peaking.datasets.point_cloud import encode_points, read_points
from peaking.datasets.stored_images import read_picture
from peaking.errors import PeakingError, RecordingError
from peaking.frame import Frame
from peaking.output import encode_png, flush, write_atomically, write_new
from peaking.server import peaked_samples, session_log, wire
from peaking.server.dataset import depth_name, frame_json, photo_name, points_name, transforms_json
from peaking.server.disk_full import DiskFull, room_explained
from peaking.server.mending import mend
from peaking.server.peaked_samples import PeakedSamples
from peaking.server.session_files import TRANSFORMS, SessionFiles, is_lost
from peaking.server.session_log import SessionLog
from peaking.server.session_state import FAST, SessionState, UnknownCapture
from peaking.server.told import without_paths
from peaking.server.upload import BadUpload, Upload, camera_of_wire

ERASED = "The session was erased, for good."
DELETED = (
    "The session was deleted. For 30 days it can be restored: open the list of sessions on the "
    "server."
)
SET_ASIDE_BYTES = 2_000_000_000
"""Of a session's photos that the program set aside; beyond it, those longest aside are deleted."""

_log = logging.getLogger("peaking.server")


class SessionGone(PeakingError):
    """The session was deleted (`final` false) or erased: nothing is taken in or given out."""

    def __init__(self, *, final: bool) -> None:
        """Say which of the two."""
        super().__init__(ERASED if final else DELETED)
        self.final = final


class SessionClosed(PeakingError):
    """The session is finished, and a photo was taken after that."""

    def __init__(self) -> None:
        """Say what to do."""
        super().__init__(
            "The session is finished and takes no photo that was taken after that. Choose "
            '"Take more views" in it, then send this one again.'
        )


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
        self._clock = clock
        self._lock = threading.RLock()
        self._erased = False
        self._entries: dict[str, str] = {}
        self._files = SessionFiles(folder)
        self._log = SessionLog(folder / session_log.FILE_NAME)
        events, self.problems = self._log.read()
        self._state = SessionState(self._beginning(events))
        for event in events[1:]:
            try:
                self._state.check(event)
                self._state.apply(event)
            except (PeakingError, ValueError) as error:
                kind = type(event).__name__
                self.problems.append(f"{self._log.path}: {kind} was left out: {error}")
        self.problems += mend(
            self._files, self._state, self._log, at_s=clock(), damaged=bool(self.problems)
        )
        self._samples = PeakedSamples(folder / peaked_samples.FILE_NAME)
        if self._samples.damaged:
            count = self._samples.damaged
            self.problems.append(
                f"{self._samples.path}: {count} samples cannot be read; they were left out"
            )
        self.refresh_dataset()

    # Reading

    @property
    def id(self) -> str:
        """Its id, made by the client."""
        return self._state.begun.session.id

    @property
    def owner(self) -> str | None:
        """The participant of a study who was granted this session."""
        return self._state.begun.session.owner

    @property
    def name(self) -> str:
        """Its name."""
        return self._state.name

    @property
    def deleted_s(self) -> float | None:
        """When it was deleted, seconds since 1970; None while it is not."""
        return self._state.deleted_s

    @property
    def now_s(self) -> float:
        """The time of its clock, seconds since 1970."""
        return self._clock()

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self._files.folder

    @property
    def captures(self) -> list[wire.Capture]:
        """All captures in the order they arrived, removed ones too."""
        return list(self._state.captures.values())

    def capture(self, capture_id: str) -> wire.Capture:
        """Return one capture.

        Raises:
            UnknownCapture: It is not here.
        """
        return self._state.capture(capture_id)

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
        begun = self._state.begun
        kept = self._kept()
        return wire.SessionSummary(
            id=self.id,
            name=self.name,
            folder=self.folder.name,
            source=begun.session.source,
            device=begun.session.device,
            created_s=begun.at_s,
            finished=self._state.finished_s is not None,
            captures=len(kept),
            ready=sum(capture.state == "ready" for capture in kept),
            peaked_share=self._samples.last,
            live=live,
            deleted_s=self.deleted_s,
            damaged=len(self.problems),
            restorable=sum(capture.restorable for capture in self.captures),
            thumbnails=[capture.id for capture in _spread(kept, wire.MAX_THUMBNAILS)],
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
        files = self._state.files(capture)
        depth_m = points_m = None
        if (name := depth_name(capture.number)) in files:
            depth_m = read_depth(self._files.path(capture, name), 0.001, within=self.folder)
        if (name := points_name(capture.number)) in files:
            points_m = read_points(self._files.path(capture, name), within=self.folder)
        return Frame(
            name=f"{capture.number:06d}",
            rgb=read_picture(self.photo_path(capture), within=self.folder),
            camera=camera_of_wire(capture.camera),
            depth_m=depth_m,
            timestamp_s=float(capture.time_s),
            points_m=points_m,
        )

    def photo_path(self, capture: wire.Capture) -> Path:
        """Return where the photo of a capture lies; it is not looked for where it was moved to."""
        return self._files.photo(capture)

    def mpi_path(self, capture_id: str, version: int = 1) -> Path:
        """Return where a version of the MPI lies, or will."""
        return self._files.mpi(self.capture(capture_id), version)

    def kept_thumbnail(self, capture_id: str) -> bytes | None:
        """Return a capture's thumbnail; None where there is none yet, or it is damaged.

        Raises:
            UnknownCapture: The capture is not here, or was undone.
        """
        return self._files.thumbnail(self.shown_capture(capture_id))

    def keep_thumbnail(self, capture_id: str, data: bytes) -> None:
        """Keep a capture's thumbnail, unless the disk is full or the capture gone meanwhile."""
        with self._lock:
            capture = self.capture(capture_id)
            if self._erased or self.deleted_s is not None or is_lost(capture):
                return
            with contextlib.suppress(DiskFull), room_explained():
                self._files.keep_thumbnail(capture, data)

    def dataset_files(
        self, *, only: Collection[str] | None = None
    ) -> list[tuple[str, Path | bytes]]:
        """Return names and contents of the data set, without what was undone or set aside.

        Args:
            only: Ids of the captures that are to be in it; all without it.

        Raises:
            SessionGone: The session is deleted.
        """
        with self._lock:
            self._refuse_gone()
            kept = [c for c in self._kept() if only is None or c.id in only]
            files: list[tuple[str, Path | bytes]] = [(TRANSFORMS, self._transforms(kept))]
            for capture in kept:
                names = self._state.files(capture)
                files += [(name, self._files.path(capture, name)) for name in names]
            return files

    def peaked(self) -> list[wire.PeakedSample]:
        """Return all that phones told about peaked shares, without damaged samples."""
        return self._samples.read()

    # Changing

    def store_capture(
        self, capture_id: str, upload: Upload, *, arrived_s: float | None = None
    ) -> tuple[wire.Capture, bool]:
        """Keep a capture; return it, and whether it is new. On the disk when this returns.

        Args:
            capture_id: Made by the client.
            upload: What it sent.
            arrived_s: When that began to arrive, by the clock of this session; now without it.

        Raises:
            SessionGone: The session is deleted.
            SessionClosed: The session is finished, and this was taken later.
            BadUpload: It was taken back before, and more is not known of it.
            DiskFull: There is no room.
            OSError: The disk fails in another way.
        """
        with self._lock:
            self._refuse_gone()
            with contextlib.suppress(UnknownCapture):
                return self.capture(capture_id), False
            if capture_id in self._state.taken_ids:
                raise BadUpload("This photo was taken back before.")
            taken_s = upload.taken_s(self._clock() if arrived_s is None else arrived_s)
            if self._state.finished_s is not None and taken_s > self._state.finished_s:
                raise SessionClosed
            number = self._state.number + 1
            header = upload.header
            stored = session_log.CaptureStored(
                at_s=self._clock(),
                id=capture_id,
                number=number,
                camera=header.camera,
                time_s=header.time_s,
                depth=upload.depth_mm is not None,
                points=upload.points_m is not None,
                corrected_world_from_cam=header.corrected_world_from_cam,
                automatic=header.automatic,
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
                # What was written may be there still: nothing replaces it.
                self._state.number = number
                raise
            self._state.apply(stored)
            return self.capture(capture_id), True

    def remove_capture(self, capture_id: str) -> wire.Capture:
        """Undo a capture, also one that is set aside; again does nothing.

        It can be restored until the session is finished.

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
            self._place(msgspec.structs.replace(capture, removed=False))
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
            self._place(self.capture(capture_id))
            return self.capture(capture_id)

    def mark_ready(
        self, capture_id: str, mpi: bytes, *, generator: str, guessed: bool = False
    ) -> wire.Capture:
        """Keep an MPI of a capture; it is the newest from now on.

        Of what is deleted meanwhile none is kept: it is made again when that is restored.

        Raises:
            DiskFull: There is no room for it.
        """
        with self._lock, room_explained():
            capture = self.capture(capture_id)
            if self._erased or self.deleted_s is not None or is_lost(capture):
                return capture
            version = capture.mpi_version + 1
            write_atomically(self._files.mpi(capture, version), mpi)
            made = session_log.MpiMade(
                at_s=self._clock(),
                id=capture_id,
                version=version,
                generator=generator,
                guessed=guessed,
            )
            self._log.append(made)
            self._state.apply(made)
            return self._state.change(capture_id, state="ready", mpi_bytes=len(mpi), problem=None)

    def mark_damaged(self, capture_id: str, version: int) -> bool:
        """Have an MPI made again whose file is gone or damaged; False when that is due already."""
        with self._lock:
            capture = self.capture(capture_id)
            if capture.state != "ready" or capture.mpi_version != version:
                return False
            self._state.change(capture_id, state="queued", mpi_bytes=None)
            return True

    def mark_not_better(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why no better MPI was made; the one that is there stays."""
        return self._change(capture_id, problem=without_paths(problem, self.folder))

    def mark_failed(self, capture_id: str, problem: str) -> wire.Capture:
        """Remember why there is no MPI of a capture; it is tried again when the server starts."""
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
            if finished == (self._state.finished_s is not None):
                return
            self._note(session_log.SessionFinished(at_s=self._clock(), finished=finished))
            for capture in self.captures:
                self._place(capture)
            if finished:
                self._files.drop_removed(self._state.longest_aside())

    def delete(self, *, at_s: float | None = None) -> None:
        """Note that the whole session is deleted, now or at a time; again does nothing."""
        with self._lock:
            if self.deleted_s is None:
                at_s = self._clock() if at_s is None else at_s
                self._note(session_log.SessionDeleted(at_s=at_s))

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
                self._files = SessionFiles(folder)
                self._samples.path = folder / peaked_samples.FILE_NAME
                self._log = SessionLog(folder / session_log.FILE_NAME)
                flush(folder.parent)

    def add_peaked(self, samples: Sequence[wire.PeakedSample]) -> None:
        """Append what a phone told, each sample once; not waited for until it is on the disk.

        Beyond `peaked_samples.MAX_SAMPLES` nothing more is kept.

        Raises:
            DiskFull: There is no room; none of it was kept.
        """
        with self._lock:
            self._refuse_gone()
            with room_explained():
                self._samples.add(samples)

    def refresh_dataset(self) -> None:
        """Write transforms.json anew when it is not what it should be.

        On a full disk the old one stays until the next time: it follows from the log.
        """
        with self._lock:
            path, wanted = self.folder / TRANSFORMS, self._transforms(self._kept())
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

    def _beginning(self, events: Sequence[session_log.AnyEvent]) -> session_log.SessionBegun:
        begun = events[0] if events else None
        if not isinstance(begun, session_log.SessionBegun):
            raise RecordingError(
                self._log.path,
                "does not begin with SessionBegun" + "".join(f" ({p})" for p in self.problems[:1]),
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
        return begun

    def _change(self, capture_id: str, **fields: object) -> wire.Capture:
        with self._lock:
            return self._state.change(capture_id, **fields)

    def _note(self, event: session_log.AnyEvent) -> None:
        """Let something have happened: first on the disk, then here."""
        with room_explained():
            self._log.append(event)
        self._state.apply(event)

    def _refuse_gone(self) -> None:
        if self._erased or self.deleted_s is not None:
            raise SessionGone(final=self._erased)

    def _end(
        self, capture_id: str, event: session_log.CaptureRemoved | session_log.CaptureSetAside
    ) -> wire.Capture:
        with self._lock:
            self._refuse_gone()
            capture = self.capture(capture_id)
            undone = isinstance(event, session_log.CaptureRemoved)
            if not capture.removed or (undone and capture.ending == "set_aside"):
                self._note(event)
                self._place(self.capture(capture_id))
            return self.capture(capture_id)

    def _drop_longest_aside(self) -> None:
        aside = self._state.longest_aside()
        sizes = {c.id: self._files.bytes_of(c, self._state.files(c)) for c in aside}
        while aside and sum(sizes[c.id] for c in aside) > SET_ASIDE_BYTES:
            longest = aside.pop(0)
            self._note(session_log.CaptureDropped(self._clock(), id=longest.id))
            self._place(self.capture(longest.id))

    def _place(self, capture: wire.Capture) -> None:
        self._files.place(capture, self._state.files(capture))

    def _kept(self) -> list[wire.Capture]:
        return [capture for capture in self.captures if not capture.removed]

    def _transforms(self, captures: Sequence[wire.Capture]) -> bytes:
        for capture in captures:
            if capture.id not in self._entries:
                self._entries[capture.id] = frame_json(capture, self._state.files(capture))
        return transforms_json(self._entries[capture.id] for capture in captures)


def _spread(captures: Sequence[wire.Capture], count: int) -> list[wire.Capture]:
    """Return so many of them, or all, from the first to the last."""
    last = len(captures) - 1
    return [
        captures[i]
        for i in sorted({round(k * last / (count - 1)) for k in range(count)})
        if captures
    ]


def _why_not_restorable(capture: wire.Capture) -> str:
    match capture.ending:
        case "erased":
            return "This photo was erased, for good."
        case "set_aside":
            return "This photo was set aside long ago, and deleted to make room."
        case _:
            return "This photo was undone and the session finished since then: it is deleted."
