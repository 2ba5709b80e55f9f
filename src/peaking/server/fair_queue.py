"""A queue in which everybody has the same turn, however much one of them puts in."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Container
from typing import Generic, TypeVar

T = TypeVar("T")


class Lines(Generic[T]):
    """Who waits, in the order of their turns. For one thread at a time."""

    def __init__(self) -> None:
        """Begin empty."""
        self._lines: dict[str, dict[str, deque[T]]] = {}
        """By device and session."""

    def add(self, item: T, device: str, session: str) -> None:
        """Let something wait behind what its session has waiting already."""
        self._lines.setdefault(device, {}).setdefault(session, deque()).append(item)

    def next(self, *, but: Container[str] = ()) -> tuple[T, str] | None:
        """Take what has its turn, and return it with its session; None when nothing has.

        Args:
            but: Sessions that are passed over, and keep their turns.
        """
        for device, sessions in self._lines.items():
            for session, line in sessions.items():
                if session not in but:
                    item = line.popleft()
                    del sessions[session], self._lines[device]
                    if line:
                        sessions[session] = line
                    if sessions:
                        self._lines[device] = sessions
                    return item, session
        return None


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
        self._lines: Lines[T] = Lines()
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
                self._lines.add(*self._came.popleft())
            found = self._lines.next()
        return None if found is None else found[0]

    def close(self) -> None:
        """Let everybody who waits go; what is still in it stays."""
        self._closed = True
        self._wake.put(None)
