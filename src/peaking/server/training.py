"""Trains 3D Gaussians of sessions, one after the other, each in a process that comes last.

What comes out lies in the session's folder, below `training/`: it is no part of the data set. A
training that was stopped, or whose server stopped, can go on.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from peaking.errors import PeakingError
from peaking.output import write_atomically
from peaking.server import training_process as process
from peaking.server import wire
from peaking.server.open_session import OpenSession
from peaking.server.told import cause_of, without_paths
from peaking.server.upload import BadUpload

FOLDER = "training"
STATUS = "status.json"
STEPS = 2000
PIXELS = 57280
"""As `peaking splat`: 179×320."""
WATCH_S = 0.1
"""So often it is looked at whether there is something better to do."""
ENDING_S = 20.0
"""So long the process has to write down where it stands."""

NOTHING = wire.Training(
    state="none",
    step=0,
    steps=0,
    gaussians=0,
    views=0,
    held_out=0,
    psnr_db=None,
    elapsed_s=0.0,
    remaining_s=None,
    splat_version=0,
    splat_format="spz",
    splat_bytes=0,
    worst=[],
    outdated=False,
    problem=None,
)
ENDING = "Something of this session is being deleted; train it in a moment."
ENDED_EARLY = "The training ended unexpectedly; it can be begun again."

_log = logging.getLogger("peaking.server")


class _Status(msgspec.Struct, frozen=True):
    """What is kept of a training on the disk."""

    training: wire.Training
    captures: list[str]
    """Ids of the views that it began with."""


@dataclass
class _Record:
    """What is known of a session's training."""

    training: wire.Training
    captures: frozenset[str] = frozenset()
    goes_on: bool = False


@dataclass
class _Running:
    """The training that runs now."""

    session: OpenSession
    stop: threading.Event = field(default_factory=threading.Event)
    forgotten: bool = False


class Trainings:
    """The trainings of all sessions, and the thread that looks after the one that runs."""

    def __init__(
        self,
        *,
        on_change: Callable[[OpenSession, wire.Training], None],
        is_busy: Callable[[], bool],
        steps: int = STEPS,
        pixels: int = PIXELS,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start the thread.

        Args:
            on_change: Told of a session and its training, in any thread.
            is_busy: Whether there is something better to do.
            steps: Of a training.
            pixels: Size in pixels to which photos are shrunk.
            clock: Seconds since any moment.
        """
        self._clock = clock
        self._on_change = on_change
        self._is_busy = is_busy
        self._steps = steps
        self._pixels = pixels
        self._lock = threading.Lock()
        self._records: dict[str, _Record] = {}
        self._waiting: queue.SimpleQueue[OpenSession | None] = queue.SimpleQueue()
        self._running: _Running | None = None
        self._closing = False
        self._refused: set[str] = set()
        """Ids of sessions that are being deleted, or are deleted or erased."""
        self._thread = threading.Thread(target=self._work, name="training", daemon=True)
        self._thread.start()

    def of(self, session: OpenSession) -> wire.Training:
        """Return how far the training of a session is; for a thread."""
        with self._lock:
            return _told(self._record(session), session)

    def run(self, session: OpenSession) -> wire.Training:
        """Begin a training, or go on with one; does nothing where it is under way. For a thread.

        Raises:
            BadUpload: There are too few views, or something of it is being deleted.
            DiskFull: There is no room for the data set's list of photos.
        """
        captures = _ids(session)
        if len(captures) < process.LEAST_VIEWS:
            raise BadUpload(f"Take at least {process.LEAST_VIEWS} views, then train.", status=409)
        with self._lock:
            if session.id in self._refused:
                raise BadUpload(ENDING, status=409)
            record = self._record(session)
            before = record.training
            if before.state not in ("waiting", "running"):
                snapshot = session.folder / FOLDER / process.SNAPSHOT
                ended_early = before.state in ("stopped", "failed") and snapshot.is_file()
                goes_on = ended_early and captures == record.captures
                changes = {} if goes_on else {"step": 0, "elapsed_s": 0.0, "gaussians": 0}
                training = msgspec.structs.replace(
                    before, state="waiting", steps=self._steps, problem=None, psnr_db=None,
                    worst=[], remaining_s=None, **changes,
                )  # fmt: skip
                self._records[session.id] = _Record(training, captures, goes_on)
                self._waiting.put(session)
        self._tell(session)
        return self.of(session)

    def stop(self, session: OpenSession) -> wire.Training:
        """Stop a training, which can go on later; does nothing where none is under way."""
        with self._lock:
            record = self._record(session)
            if self._running is not None and self._running.session.id == session.id:
                self._running.stop.set()  # the process says when it has
            elif record.training.state == "waiting":
                record.training = msgspec.structs.replace(record.training, state="stopped")
        self._tell(session)
        return self.of(session)

    def changed(self, session: OpenSession) -> None:
        """Tell of a training that views came or went since it began.

        For the thread of the event loop too: it waits for no lock, because a record is replaced or
        changed in one step.
        """
        record = self._records.get(session.id)
        if record is not None and record.training.state != "none":
            self._on_change(session, _told(record, session))

    def splat(self, session: OpenSession, version: int) -> Path | None:
        """Return the file of Gaussians; None where it is gone, or never was."""
        for ending in ("spz", "ply"):
            path = session.folder / FOLDER / f"splat-{version}.{ending}"
            if path.is_file():
                return path
        return None

    def forget(self, session: OpenSession) -> None:
        """End and delete the training of a session of which something is erased. For a thread."""
        self.end(session.id)
        shutil.rmtree(session.folder / FOLDER, ignore_errors=True)
        with self._lock:
            self._records.pop(session.id, None)  # who asked meanwhile had it read again
        self.allow(session)
        self._tell(session)

    def allow(self, session: OpenSession) -> None:
        """Let a session be trained on again after `end`, where it is not deleted."""
        with self._lock:
            if session.deleted_s is None:
                self._refused.discard(session.id)

    def end(self, session_id: str) -> None:
        """End the training of a session, wait for that, and refuse others. For a thread."""
        with self._lock:
            self._refused.add(session_id)
            self._records.pop(session_id, None)
            running = self._running
            if running is not None and running.session.id == session_id:
                running.forgotten = True
                running.stop.set()
            else:
                running = None
        until_s = self._clock() + 2 * ENDING_S  # it is killed before that
        while running is not None and self._running is running and self._clock() < until_s:
            time.sleep(WATCH_S)

    def close(self) -> None:
        """Stop what runs, where it can go on later, and end the thread."""
        with self._lock:
            self._closing = True
            if self._running is not None:
                self._running.stop.set()
        self._waiting.put(None)
        self._thread.join(ENDING_S)

    # Inside

    def _record(self, session: OpenSession) -> _Record:
        """Return what is known; what another process of the server began has stopped."""
        record = self._records.get(session.id)
        if record is None:
            record = self._records[session.id] = _kept(session.folder / FOLDER / STATUS)
        return record

    def _work(self) -> None:
        while (session := self._waiting.get()) is not None:
            with self._lock:
                record = self._records.get(session.id)
                if self._closing or record is None or record.training.state != "waiting":
                    continue
                if session.id in self._refused or session.deleted_s is not None:
                    continue
                running = self._running = _Running(session)
            try:
                self._train(running, record)
            except Exception as error:  # whatever it is, the next one must have its turn
                _log.exception("training session %s failed", session.id)
                self._change(running, state="failed", problem=f"It failed: {cause_of(error)}.")
            finally:
                with self._lock:
                    self._running = None

    def _train(self, running: _Running, record: _Record) -> None:
        session = running.session
        folder = session.folder / FOLDER
        session.refresh_dataset()
        folder.mkdir(exist_ok=True)
        task = process.Task(
            folder=str(session.folder),
            out=str(folder),
            captures={c.number: c.id for c in session.captures if c.id in record.captures},
            version=max(record.training.splat_version, int(session.now_s)),
            goes_on=record.goes_on,
            steps=self._steps,
            pixels=self._pixels,
        )
        self._change(running, state="running")
        self._keep(running)
        child = subprocess.Popen(
            [sys.executable, "-m", process.__name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the server, which lets it write its snapshot
        )
        watcher = threading.Thread(target=self._watch, args=(running, child, task), daemon=True)
        watcher.start()
        try:
            self._listen(running, child)
        finally:
            watcher.join()
            self._ended(running)

    def _watch(self, running: _Running, child: subprocess.Popen[bytes], task: process.Task) -> None:
        """Tell the process what to do: to pause while there is something better to do."""
        assert child.stdin is not None
        paused = False
        with contextlib.suppress(OSError):  # it has ended meanwhile
            child.stdin.write(msgspec.json.encode(task) + b"\n")
            child.stdin.flush()
            while child.poll() is None and not running.stop.is_set():
                if self._is_busy() != paused:
                    paused = not paused
                    child.stdin.write(b"pause\n" if paused else b"go on\n")
                    child.stdin.flush()
                running.stop.wait(WATCH_S)
        with contextlib.suppress(OSError):
            child.stdin.close()
        try:
            child.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            child.kill()

    def _listen(self, running: _Running, child: subprocess.Popen[bytes]) -> None:
        assert child.stdout is not None
        decoder = msgspec.json.Decoder(process.Said)
        began_s, before_s = self._clock(), self._training(running).elapsed_s
        with child.stdout as lines:
            for line in lines:
                elapsed_s = before_s + self._clock() - began_s
                self._hear(running, decoder.decode(line), elapsed_s)
        child.wait()

    def _hear(self, running: _Running, said: process.Said, elapsed_s: float) -> None:
        match said:
            case process.Progressed():
                self._change(
                    running, step=said.step, gaussians=said.gaussians, views=said.views,
                    held_out=said.held_out, remaining_s=said.remaining_s, elapsed_s=elapsed_s,
                )  # fmt: skip
            case process.Shown():
                self._change(
                    running, splat_version=said.version, splat_format=said.format,
                    splat_bytes=said.bytes,
                )  # fmt: skip
                self._keep(running)
            case process.Finished():
                self._change(
                    running, state="done", psnr_db=said.psnr_db, worst=said.worst,
                    remaining_s=None,
                )  # fmt: skip
            case process.Stopped():
                self._change(running, state="stopped", remaining_s=None)
            case process.Failed():
                problem = without_paths(said.problem, running.session.folder)
                sentence = f"{problem[:1].upper()}{problem[1:].rstrip('.')}."
                self._change(running, state="failed", problem=sentence)

    def _ended(self, running: _Running) -> None:
        """Note how it ended; a process that said nothing of that was killed, or crashed."""
        if self._training(running).state == "running":
            if running.stop.is_set() or self._closing:
                self._change(running, state="stopped", remaining_s=None)
            else:
                self._change(running, state="failed", problem=ENDED_EARLY)
        self._keep(running)

    def _training(self, running: _Running) -> wire.Training:
        with self._lock:
            record = self._records.get(running.session.id)
            return NOTHING if record is None else record.training

    def _change(self, running: _Running, **fields: object) -> None:
        with self._lock:
            record = self._records.get(running.session.id)
            if record is None or running.forgotten:
                return
            record.training = msgspec.structs.replace(record.training, **fields)
        self._tell(running.session)

    def _tell(self, session: OpenSession) -> None:
        self._on_change(session, self.of(session))

    def _keep(self, running: _Running) -> None:
        """Write down how far it is, for a server that is started later."""
        with self._lock:
            record = self._records.get(running.session.id)
            if record is None or running.forgotten:
                return
            status = _Status(record.training, sorted(record.captures))
        folder = running.session.folder / FOLDER
        if not folder.is_dir():
            return  # erased meanwhile
        with contextlib.suppress(PeakingError):  # a full disk: it is only forgotten
            write_atomically(folder / STATUS, msgspec.json.encode(status))


def _told(record: _Record, session: OpenSession) -> wire.Training:
    training = record.training
    outdated = training.state != "none" and record.captures != _ids(session)
    return msgspec.structs.replace(training, outdated=outdated)


def _ids(session: OpenSession) -> frozenset[str]:
    return frozenset(capture.id for capture in session.captures if not capture.removed)


def _kept(path: Path) -> _Record:
    try:
        status = msgspec.json.decode(path.read_bytes(), type=_Status)
    except (OSError, msgspec.MsgspecError):
        return _Record(NOTHING)
    training = status.training
    if training.state in ("waiting", "running"):
        training = msgspec.structs.replace(training, state="stopped", remaining_s=None)
    return _Record(training, frozenset(status.captures))
