"""News for phones and dashboards: server-sent events."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter, deque
from collections.abc import AsyncGenerator, Callable

import msgspec
from starlette.concurrency import run_in_threadpool

from peaking.server import wire

WAITING_BYTES = 4_000_000
"""So much may wait for one listener; one that is slower is cut off and comes again."""

MAX_STREAMS = 1_000
"""When there are more, whoever has most loses the oldest."""

SERVER = ""
"""The topic of the list of sessions; every other topic is a session's id."""


PING = b": ping\n\n"


class _Listener:
    """What waits for one stream."""

    def __init__(self) -> None:
        self._came = asyncio.Event()
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._ended = False

    def put(self, message: bytes, *, replaces: bool) -> None:
        if replaces:
            self._waiting.clear()
            self._bytes = 0
        self._waiting.append(message)
        self._bytes += len(message)
        if self._bytes > WAITING_BYTES and len(self._waiting) > 1:
            self.end()
        self._came.set()

    def end(self) -> None:
        """End the stream, without what still waits."""
        self._waiting.clear()
        self._ended = True
        self._came.set()

    async def next(self) -> bytes | None:
        """Return what comes next, a comment when nothing comes for long; None at the end."""
        if not self._waiting and not self._ended:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._came.wait(), wire.PING_S)
        self._came.clear()
        if self._ended:
            return None
        if not self._waiting:
            return PING
        message = self._waiting.popleft()
        self._bytes -= len(message)
        return message


class Hub:
    """Passes events from any thread to the streams that listen."""

    def __init__(self) -> None:
        """Begin without listeners."""
        self._listeners: dict[str, dict[_Listener, None]] = {}
        self._of_devices: dict[str, dict[_Listener, None]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._live: Counter[str] = Counter()
        self.closed = False

    def is_live(self, session_id: str) -> bool:
        """Return whether a phone that captures listens to this session."""
        return self._live[session_id] > 0

    def send(self, topic: str, event: msgspec.Struct, *, replaces: bool = False) -> None:
        """Tell all who listen to a topic; from any thread, never waits.

        An event that replaces all before it takes the place of those that still wait.
        """
        message = _message(event)
        self._soon(lambda: self._deliver(topic, message, replaces))

    def end(self, topic: str) -> None:
        """End the streams of a topic; from any thread."""
        self._soon(lambda: self._end(topic))

    def close(self) -> None:
        """End all streams, so that the server can stop."""
        self.closed = True
        for topic in self._listeners:
            self._end(topic)

    async def stream(
        self,
        topic: str,
        state: Callable[[], msgspec.Struct],
        *,
        live: bool = False,
        changed: Callable[[], None] = lambda: None,
        device: str = "",
    ) -> AsyncGenerator[bytes, None]:
        """Yield the state, then every event, for as long as somebody reads.

        Nothing is lost in between: the state is looked at after events are queued.

        Args:
            topic: What is listened to.
            state: Returns the first event; called in a thread.
            live: The listener is a phone that captures, not somebody who watches.
            changed: Called when the listener came and when it went.
            device: Who listens.
        """
        self._loop = asyncio.get_running_loop()
        listener = _Listener()
        self._listeners.setdefault(topic, {})[listener] = None
        self._of_devices.setdefault(device, {})[listener] = None
        self._live[topic] += live
        try:
            self._make_room()
            changed()
            yield await run_in_threadpool(lambda: _message(state()))
            while not self.closed and (message := await listener.next()) is not None:
                yield message
        finally:
            _forget(self._listeners, topic, listener)
            _forget(self._of_devices, device, listener)
            self._live[topic] -= live
            if not self._live[topic]:
                del self._live[topic]
            changed()

    def _make_room(self) -> None:
        if sum(map(len, self._of_devices.values())) > MAX_STREAMS:
            device, held = max(self._of_devices.items(), key=lambda item: len(item[1]))
            oldest = next(iter(held))
            _forget(self._of_devices, device, oldest)
            oldest.end()

    def _soon(self, do: Callable[[], None]) -> None:
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        with contextlib.suppress(RuntimeError):  # closed meanwhile
            loop.call_soon_threadsafe(do)

    def _end(self, topic: str) -> None:
        for listener in self._listeners.get(topic, ()):
            listener.end()

    def _deliver(self, topic: str, message: bytes, replaces: bool) -> None:
        for listener in self._listeners.get(topic, ()):
            listener.put(message, replaces=replaces)


def _forget(holders: dict[str, dict[_Listener, None]], holder: str, listener: _Listener) -> None:
    held = holders.get(holder, {})
    held.pop(listener, None)
    if not held:
        holders.pop(holder, None)


def _message(event: msgspec.Struct) -> bytes:
    return b"data: " + msgspec.json.encode(event) + b"\n\n"
