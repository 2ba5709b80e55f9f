"""Where MPIs are made: off the event loop, in order, with bounded waiting."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Callable

import numpy as np

from peaking.errors import PeakingError
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi_file import encode
from peaking.pipeline import LocalLightField
from peaking.presets import Options
from peaking.server import wire
from peaking.server.durable import DiskFull
from peaking.server.sessions import OpenSession

CAPACITY = 64
ROOM_AGAIN_S = 5.0
"""So long after the disk was full it is tried again, where there is nothing else to do."""
NO_ROOM = "The server's disk is full: the photo is safe there, but joins only when there is room."
_log = logging.getLogger("peaking.server")

Done = Callable[[OpenSession, wire.Capture], None]


class GenerationQueue:
    """A bounded queue of captures, and threads that make their MPIs.

    numba's kernels and the JPEG codec let go of the interpreter while they work.
    """

    def __init__(
        self, options: Options, *, on_done: Done, workers: int = 1, capacity: int = CAPACITY
    ) -> None:
        """Start the threads.

        Args:
            options: How MPIs are made.
            on_done: Called from a worker when an MPI is ready or has failed.
            workers: Threads.
            capacity: Captures that may wait.
        """
        self._options = options
        self._on_done = on_done
        self._capacity = capacity
        self._waiting: queue.SimpleQueue[tuple[OpenSession, str] | None] = queue.SimpleQueue()
        self._short_of_room: queue.SimpleQueue[tuple[OpenSession, str]] = queue.SimpleQueue()
        self._disk_full = False
        self._warm = threading.Event()
        self._threads = [
            threading.Thread(target=self._work, name=f"mpi-{number}", daemon=True)
            for number in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def room(self) -> bool:
        """Whether another capture may be put in."""
        return self._waiting.qsize() < self._capacity

    @property
    def idle(self) -> bool:
        """Whether nothing waits."""
        return self._waiting.empty()

    @property
    def warm(self) -> bool:
        """Whether all kernels are compiled."""
        return self._warm.is_set()

    def put(self, session: OpenSession, capture_id: str) -> None:
        """Have the MPI of a stored capture made; never refuses what is on the disk already."""
        self._waiting.put((session, capture_id))

    def close(self) -> None:
        """Let the threads finish what they do; what waits is done at the next start."""
        while not self._waiting.empty():
            try:
                self._waiting.get_nowait()
            except queue.Empty:
                break
        for _ in self._threads:
            self._waiting.put(None)
        for thread in self._threads:
            thread.join(10)

    def _work(self) -> None:
        field = LocalLightField(self._options)
        encode(field.mpi_of(_small_frame()))
        self._warm.set()
        while (item := self._next()) is not None:
            session, capture_id = item
            try:
                self._on_done(session, self._make(field, session, capture_id))
            except Exception:  # whatever it is, the next capture must be served
                _log.exception("capture %s was not served to the end", capture_id)

    def _next(self) -> tuple[OpenSession, str] | None:
        """Wait for a capture; when none comes, take one that the disk had no room for."""
        while True:
            try:
                waits_s = ROOM_AGAIN_S if self._disk_full else 0.0
                waits_s = None if self._short_of_room.empty() else waits_s
                return self._waiting.get(timeout=waits_s)
            except queue.Empty:
                with contextlib.suppress(queue.Empty):  # another thread may have taken it
                    return self._short_of_room.get_nowait()

    def _make(self, field: LocalLightField, session: OpenSession, capture_id: str) -> wire.Capture:
        try:
            capture = session.capture(capture_id)
            if capture.removed or capture.state == "ready":
                return capture
            mpi = encode(field.mpi_of(session.frame_of(capture_id)))
            ready = session.mark_ready(capture_id, mpi)
            self._disk_full = False
            return ready
        except DiskFull:
            self._disk_full = True
            self._short_of_room.put((session, capture_id))
            return session.mark_failed(capture_id, NO_ROOM)
        except PeakingError as error:
            return session.mark_failed(capture_id, str(error))
        except Exception:  # whatever it is, the next capture must be served
            _log.exception("making the MPI of capture %s failed", capture_id)
            return session.mark_failed(
                capture_id, "The MPI could not be made; the server's log says why."
            )


def _small_frame() -> Frame:
    """Return a frame that takes all kernels through their paces, and compiles them."""
    height, width = 64, 32
    y, x = np.mgrid[0:height, 0:width]
    rgb = np.stack([x * 7 % 256, y * 3 % 256, (x * y) % 256], axis=-1).astype(np.uint8)
    depth_m = np.where(x < width // 2, 1.0, 2.0).astype(np.float32)
    depth_m[:8] = 0.0
    pinhole = Pinhole(width, height, 40.0, 40.0, width / 2, height / 2)
    return Frame("warm-up", rgb, Camera(pinhole, Rigid.identity()), depth_m)
