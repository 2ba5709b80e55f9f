"""News for phones and dashboards: server-sent events."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import AsyncGenerator, Callable

import msgspec

from peaking.server import wire

WAITING = 1000
"""Events that may wait for one listener; one that is slower is cut off and comes again."""

SERVER = ""
"""The topic of the list of sessions; every other topic is a session's id."""


class Hub:
    """Passes events from any thread to the streams that listen."""

    def __init__(self) -> None:
        """Begin without listeners."""
        self._listeners: dict[str, set[asyncio.Queue[bytes | None]]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._live: Counter[str] = Counter()
        self.closed = False

    def is_live(self, session_id: str) -> bool:
        """Return whether a phone that captures listens to this session."""
        return self._live[session_id] > 0

    def send(self, topic: str, event: msgspec.Struct) -> None:
        """Tell all who listen to a topic; from any thread, never waits."""
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        with contextlib.suppress(RuntimeError):  # closed meanwhile
            loop.call_soon_threadsafe(self._deliver, topic, _message(event))

    def end(self, topic: str) -> None:
        """End the streams of a topic; from any thread."""
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # closed meanwhile
                loop.call_soon_threadsafe(self._end, topic)

    def close(self) -> None:
        """End all streams, so that the server can stop."""
        self.closed = True
        for queues in self._listeners.values():
            for queue in queues:
                with contextlib.suppress(asyncio.QueueFull):
                    queue.put_nowait(None)

    async def stream(
        self,
        topic: str,
        state: Callable[[], msgspec.Struct],
        *,
        live: bool = False,
        changed: Callable[[], None] = lambda: None,
    ) -> AsyncGenerator[bytes, None]:
        """Yield the state, then every event, for as long as somebody reads.

        Nothing is lost in between: the state is looked at after events are queued.

        Args:
            topic: What is listened to.
            state: Returns the first event.
            live: The listener is a phone that captures, not somebody who watches.
            changed: Called when the listener came and when it went.
        """
        self._loop = asyncio.get_running_loop()
        queue: asyncio.Queue[bytes | None] = asyncio.Queue(WAITING)
        self._listeners.setdefault(topic, set()).add(queue)
        self._live[topic] += live
        try:
            changed()
            yield _message(state())
            while not self.closed:
                try:
                    message = await asyncio.wait_for(queue.get(), wire.PING_S)
                except TimeoutError:
                    yield b": ping\n\n"
                    continue
                if message is None:
                    return
                yield message
        finally:
            self._listeners[topic].discard(queue)
            self._live[topic] -= live
            changed()

    def _end(self, topic: str) -> None:
        for queue in self._listeners.get(topic, ()):
            while not queue.empty():
                queue.get_nowait()
            queue.put_nowait(None)

    def _deliver(self, topic: str, message: bytes) -> None:
        for queue in self._listeners.get(topic, ()):
            try:
                queue.put_nowait(message)
            except asyncio.QueueFull:
                while not queue.empty():
                    queue.get_nowait()
                queue.put_nowait(None)


def _message(event: msgspec.Struct) -> bytes:
    return b"data: " + msgspec.json.encode(event) + b"\n\n"
