"""A queue in which everybody has the same turn, however much one of them puts in."""

from __future__ import annotations

import queue
import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class FairQueue(Generic[T]):
    """Devices take turns, and the sessions of a device take turns within those.

    Whoever begins sessions by the dozen gains nothing. May be used from several threads, and
    putting something in never waits, so that the thread of the event loop may do it.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._came: deque[tuple[T, str, str]] = deque()
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()
        """Something for each item that waits, in `_came` or `_lines`."""
        self._taking = threading.Lock()
        self._lines: dict[str, dict[str, deque[T]]] = {}
        """By device and session, in the order of their turns."""
        self._closed = False

    @property
    def empty(self) -> bool:
        """Whether nothing waits."""
        return self._wake.empty()

    def put(self, item: T, device: str, session: str) -> None:
        """Put something in; never waits."""
        self._came.append((item, device, session))
        self._wake.put(None)

    def get(self, timeout_s: float | None = None) -> T | None:
        """Wait for whatever has its turn next; None when the queue was closed.

        Raises:
            queue.Empty: The time is over.
        """
        self._wake.get(timeout=timeout_s)
        if self._closed:
            self._wake.put(None)  # for the next who waits
            return None
        with self._taking:
            while self._came:
                item, device, session = self._came.popleft()
                self._lines.setdefault(device, {}).setdefault(session, deque()).append(item)
            return self._next()

    def close(self) -> None:
        """Let everybody who waits go; what is still in it stays."""
        self._closed = True
        self._wake.put(None)

    def _next(self) -> T:
        device, sessions = next(iter(self._lines.items()))
        session, line = next(iter(sessions.items()))
        item = line.popleft()
        del sessions[session]
        if line:
            sessions[session] = line
        del self._lines[device]
        if sessions:
            self._lines[device] = sessions
        return item
