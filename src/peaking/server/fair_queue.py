"""A queue in which everybody has the same turn, however much one of them puts in."""

from __future__ import annotations

import queue
import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class FairQueue(Generic[T]):
    """Devices take turns, and the sessions of a device take turns within those.

    Whoever begins sessions by the dozen gains nothing. May be used from several threads.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._changed = threading.Condition()
        self._lines: dict[str, dict[str, deque[T]]] = {}
        """By device and session, in the order of their turns."""
        self._closed = False

    @property
    def empty(self) -> bool:
        """Whether nothing waits."""
        return not self._lines

    def put(self, item: T, device: str, session: str) -> None:
        """Put something in; never waits for room."""
        with self._changed:
            self._lines.setdefault(device, {}).setdefault(session, deque()).append(item)
            self._changed.notify()

    def get(self, timeout_s: float | None = None) -> T | None:
        """Wait for whatever has its turn next; None when the queue was closed.

        Raises:
            queue.Empty: The time is over.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._closed or self._lines, timeout_s):
                raise queue.Empty
            if self._closed:
                return None
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

    def close(self) -> None:
        """Let everybody who waits go; what is still in it stays."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
