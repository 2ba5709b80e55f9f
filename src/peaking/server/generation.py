"""Where MPIs are made: off the event loop, in turn, with bounded waiting."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from peaking.depth.registry import create_estimator
from peaking.errors import MpiFileError, PeakingError, RecordingError
from peaking.frame import Frame
from peaking.metric_depth import CapturedView, views_to_ask
from peaking.mpi_file import encode, read_mpi
from peaking.options import Options
from peaking.server import wire
from peaking.server.attempts import Attempts
from peaking.server.disk_full import DiskFull
from peaking.server.fair_queue import FairQueue
from peaking.server.fair_room import FairRoom, Share
from peaking.server.open_session import OpenSession
from peaking.server.session_state import FAST
from peaking.server.told import cause_of
from peaking.server.upload import camera_of_wire
from peaking.server.warm_up import WarmUp
from peaking.view_builder import ViewBuilder

CAPACITY = 512
"""Captures that may wait or be on their way; one device alone may have half of them."""

ROOM_AGAIN_S = 5.0
"""So long after the disk was full it is tried again, where there is nothing else to do."""
NO_ROOM = "The server's disk is full. The photo is saved and is processed when there is room."
_log = logging.getLogger("peaking.server")

Done = Callable[[OpenSession, wire.Capture], None]


@dataclass(frozen=True)
class Waiting:
    """A capture that waits for its MPI, and whose turn it is."""

    session: OpenSession
    capture_id: str
    place: Share | None = None

    @property
    def device(self) -> str:
        """Who sent it; "" where the server itself wants it."""
        return "" if self.place is None else self.place.device


class GenerationQueue:
    """A queue of captures in which devices take turns, and threads that make their MPIs.

    `layered` MPIs are made at once. When the options name another generator, a thread of its own
    makes the better ones after that, and each takes the place of the first.

    numba's kernels, the JPEG codec and PyTorch let go of the interpreter while they work.
    """

    def __init__(
        self,
        options: Options,
        *,
        on_done: Done,
        warm_up: WarmUp,
        workers: int = 1,
        capacity: int = CAPACITY,
    ) -> None:
        """Start the threads.

        Args:
            options: How MPIs are made.
            on_done: Called from a worker when an MPI is ready or has failed.
            warm_up: What a worker does first.
            workers: Threads that make MPIs at once.
            capacity: Captures that may wait or be on their way.

        Raises:
            BackendUnavailable: PyTorch is asked for by the options, and is not there.
            CheckpointError: A checkpoint is missing or cannot be used.
        """
        self._on_done = on_done
        self.room = FairRoom(capacity)
        self._waiting: FairQueue[Waiting] = FairQueue()
        self._better: FairQueue[Waiting] = FairQueue()
        self._short_of_room: queue.SimpleQueue[Waiting] = queue.SimpleQueue()
        self._disk_full = False
        self._serving: set[int] = set()
        self._attempts = Attempts()
        self._warm_up = warm_up
        self._fast = replace(options, generator=FAST)
        self._estimator = None
        if options.depth_model is not None:
            self._estimator = create_estimator(
                options.depth_model, device=options.device, runtime=options.depth_runtime
            )
        self._threads = [
            threading.Thread(target=self._work, name=f"mpi-{number}", daemon=True)
            for number in range(workers)
        ]
        self._improves = options.generator != FAST
        if self._improves:
            better = ViewBuilder(options, estimator=self._estimator)
            self._threads.append(
                threading.Thread(
                    target=self._improve, args=(better,), name="mpi-better", daemon=True
                )
            )
        for thread in self._threads:
            thread.start()

    @property
    def idle(self) -> bool:
        """Whether nothing waits."""
        return self._waiting.empty

    @property
    def at_rest(self) -> bool:
        """Whether no capture is on its way, waits or has its MPI made at once."""
        return self.room.taken == 0 and self.idle and not self._serving

    def reserve(self, device: str, session: OpenSession) -> Share:
        """Take a place for a capture that is on its way; for the thread of the event loop.

        Raises:
            Busy: There is none for this device, or for this session of it.
        """
        return self.room.take(1, device, session.id)

    def put(self, session: OpenSession, capture_id: str, place: Share | None = None) -> None:
        """Have the MPI of a stored capture made; never refuses what is on the disk already.

        The place of a capture is given back when it has its turn.
        """
        waiting = Waiting(session, capture_id, place)
        self._waiting.put(waiting, waiting.device, session.id)

    def make_again(self, session: OpenSession, capture: wire.Capture) -> bool:
        """Have the newest MPI of a capture made again, which is damaged; False when it is not it.

        For a thread.
        """
        if not session.mark_damaged(capture.id, capture.mpi_version):
            return False
        self._on_done(session, session.capture(capture.id))
        self.put(session, capture.id)
        return True

    def close(self) -> None:
        """Let the threads finish what they do; what waits is done at the next start."""
        self._waiting.close()
        self._better.close()
        for thread in self._threads:
            thread.join(10)
        self._attempts.forget()

    # At once

    def _work(self) -> None:
        builder = ViewBuilder(self._fast, estimator=self._estimator)
        self._warm_up.run(builder)
        this = threading.get_ident()

        def serve(item: Waiting) -> None:
            self._serving.add(this)
            try:
                self._serve(builder, item)
            finally:
                self._serving.discard(this)

        _serve_all(self._next, serve)

    def _next(self) -> Waiting | None:
        """Wait for a capture; when none comes, take one that the disk had no room for."""
        while True:
            try:
                waits_s = ROOM_AGAIN_S if self._disk_full else 0.0
                waits_s = None if self._short_of_room.empty() else waits_s
                item = self._waiting.get(waits_s)
                if item is not None and item.place is not None:
                    item.place.give_back()
                return item
            except queue.Empty:
                with contextlib.suppress(queue.Empty):  # another thread may have taken it
                    return self._short_of_room.get_nowait()

    def _serve(self, builder: ViewBuilder, item: Waiting) -> None:
        session, before = item.session, item.session.capture(item.capture_id)
        after = self._make(builder, session, before)
        self._on_done(session, after)
        if after.state != "ready" or after.removed or after.guessed:
            return
        if after.mpi_version > before.mpi_version:
            self._ask_again(session, after.id)
        if self._improves:
            self._better.put(item, item.device, session.id)

    def _make(
        self, builder: ViewBuilder, session: OpenSession, capture: wire.Capture
    ) -> wire.Capture:
        if capture.removed or (capture.state == "ready" and not capture.guessed):
            return capture
        try:
            with self._attempt(session, capture, "first"):
                frame = session.frame_of(capture.id)
                others = self._others(builder, session, capture, frame)
                if capture.state == "ready":
                    made = builder.rebuild_guessed(frame, others)
                else:
                    made = builder.build(frame, others)
            if made is None:
                return capture  # as much of a guess as before
            ready = _kept(session, capture, made)
            self._disk_full = False
            return ready
        except DiskFull as error:
            if capture.state == "ready":  # the guess stays
                return session.mark_not_better(capture.id, str(error))
            self._disk_full = True
            self._short_of_room.put(Waiting(session, capture.id))
            return session.mark_failed(capture.id, NO_ROOM)
        except PeakingError as error:
            if capture.state == "ready":
                return session.mark_not_better(capture.id, str(error))
            return session.mark_failed(capture.id, str(error))
        except Exception as error:  # whatever it is, the next capture must be served
            _log.exception("making the MPI of capture %s failed", capture.id)
            problem = (
                f"The MPI could not be generated ({cause_of(error)}). The server's log has more."
            )
            return session.mark_failed(capture.id, problem)

    def _ask_again(self, session: OpenSession, capture_id: str) -> None:
        """A view came into its place: those whose scale is a guess may be told it now."""
        for other in session.captures:
            if other.guessed and not other.removed and other.id != capture_id:
                self.put(session, other.id)

    # Better ones, later

    def _improve(self, builder: ViewBuilder) -> None:
        _serve_all(self._better.get, lambda item: self._improve_one(builder, item))

    def _improve_one(self, builder: ViewBuilder, item: Waiting) -> None:
        session, capture_id = item.session, item.capture_id
        capture = session.capture(capture_id)
        if capture.removed or capture.guessed or capture.generator == builder.options.generator:
            return
        try:
            with self._attempt(session, capture, "better"):
                frame = session.frame_of(capture_id)
                made = builder.build(frame, self._others(builder, session, capture, frame))
            if not made.metric:
                return
            after = _kept(session, capture, made)
        except PeakingError as error:
            after = session.mark_not_better(capture_id, str(error))
        except Exception as error:  # the first MPI stays
            _log.exception("making a better MPI of capture %s failed", capture_id)
            problem = f"No better MPI was made ({cause_of(error)}). The server's log has more."
            after = session.mark_not_better(capture_id, problem)
        self._on_done(session, after)

    # Neighbours

    def _others(
        self, builder: ViewBuilder, session: OpenSession, capture: wire.Capture, frame: Frame
    ) -> list[CapturedView]:
        """Return the views around a capture without depth, which may tell its scale."""
        if self._estimator is None or frame.depth_m is not None:
            return []
        around = [
            other
            for other in session.captures
            if other.id != capture.id and not other.removed and other.state == "ready"
        ]
        cameras = [camera_of_wire(other.camera) for other in around]
        views: list[CapturedView] = []
        for other in (around[number] for number in views_to_ask(cameras, frame.camera)):
            try:
                mpi = read_mpi(session.mpi_path(other.id, other.mpi_version))
                there = builder.prepare(session.frame_of(other.id))
            except MpiFileError:
                self.make_again(session, other)
            except RecordingError:  # its photo is damaged
                continue
            else:
                views.append(CapturedView(there, mpi, metric=not other.guessed))
        return views

    # Inside

    def _attempt(
        self, session: OpenSession, capture: wire.Capture, which: str
    ) -> contextlib.AbstractContextManager[None]:
        def marker() -> Path:
            return session.folder / "mpi" / f".{capture.number:06d}.{which}.begun"

        return self._attempts.counted(marker, session.photo_path(capture))


def _serve_all(take: Callable[[], Waiting | None], serve: Callable[[Waiting], None]) -> None:
    """Serve what waits, one after the other, until there will be nothing more."""
    while (item := take()) is not None:
        try:
            serve(item)
        except Exception:  # whatever it is, the next capture must be served
            _log.exception("capture %s was not served to the end", item.capture_id)


def _kept(session: OpenSession, capture: wire.Capture, made: CapturedView) -> wire.Capture:
    kept = session.mark_ready(
        capture.id, encode(made.mpi), generator=made.mpi.generator, guessed=not made.metric
    )
    _log.info(
        "capture %d: MPI %d by %s%s",
        kept.number,
        kept.mpi_version,
        kept.generator,
        ", of a guessed scale" if kept.guessed else "",
    )
    return kept
