"""A connection that speaks HTTP: uvicorn's, with a bound on everything that a stranger can send."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from typing import Any

import httptools
from uvicorn._types import ASGI3Application
from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import (
    STATUS_LINE,
    HttpToolsProtocol,
    RequestResponseCycle,
)
from uvicorn.server import ServerState

from peaking.server.connections import Connection, Connections, Phase
from peaking.server.requests import PAIRED
from peaking.server.responses import PROBLEM_JSON

MAX_URL_BYTES = 8_000
MAX_HEAD_BYTES = 32_000
MAX_HEADERS = 100
MAX_WAITING_REQUESTS = 4
"""Requests that were sent before the answer to the first: browsers do not."""

WRITE_BUFFER_BYTES = 65_536
NOT_PASSED_ON = frozenset({b"range", b"if-range"})
"""Headers that nothing here needs, and that take long to understand."""

SENTENCES: Mapping[int, str] = {
    400: "This is not a request that can be understood.",
    408: "The request came too slowly and was given up.",
    414: f"The address has more than {MAX_URL_BYTES:,} bytes.",
    431: f"The headers have more than {MAX_HEAD_BYTES:,} bytes, or are more than {MAX_HEADERS}. "
    "Delete the cookies of this host.",
}


class _TooMuch(Exception):
    """A bound was reached; `status` says which."""

    def __init__(self, status: int) -> None:
        super().__init__(SENTENCES[status])
        self.status = status


class HttpConnection(HttpToolsProtocol):
    """Tells its `Connection` what it waits for, and refuses what is too much, before it parses it.

    Bytes are counted as they come, whatever they will turn out to be.
    """

    def __init__(
        self,
        connection: Connection,
        connections: Connections,
        *,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
    ) -> None:
        """Take a connection that was admitted."""
        super().__init__(config, server_state, app_state)
        self._connection = connection
        self._all = connections
        self._parsed_bytes = 0
        self._unfinished_bytes = 0
        self._refused: int | None = None
        self._answered: RequestResponseCycle | None = None
        """The request that is being answered or was last; those after it wait in `pipeline`."""

    # What asyncio tells

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(WRITE_BUFFER_BYTES)
        self._connection.end = self._end
        self._connection.body_waits = lambda: self.flow.read_paused
        self._connection.enter("head", self.loop.time())

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it, and tell whoever answers, also where other requests wait behind that."""
        self._all.remove(self._connection)
        self._give_up()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Parse what came, and refuse what is too much of it."""
        if self.transport.is_closing():
            return
        self._unset_keepalive_if_required()
        if self._connection.phase == "idle":
            self._connection.enter("head", self.loop.time())
        self._unfinished_bytes += len(data)
        try:
            self.parser.feed_data(data)  # pyright: ignore[reportOptionalMemberAccess]
        except httptools.HttpParserUpgrade:
            pass  # it is answered as if it had not asked for it
        except httptools.HttpParserError:
            self._refuse(self._refused or 400)
            return
        if self._unfinished_bytes > MAX_HEAD_BYTES:  # of headers, or of what may follow a body
            self._refuse(431)

    def pause_writing(self) -> None:
        """Remember since when nobody takes what we send."""
        super().pause_writing()
        self._connection.unread_since_s = self.loop.time()

    def resume_writing(self) -> None:
        """Somebody takes it."""
        super().resume_writing()
        self._connection.unread_since_s = None

    # What the parser tells

    def on_message_begin(self) -> None:
        """Begin a request."""
        super().on_message_begin()
        self.scope["extensions"] = {PAIRED: self._paired}  # type: ignore[typeddict-item]
        self._parsed_bytes = 0  # of this request's headers

    def on_url(self, url: bytes) -> None:
        """Take a part of the address."""
        if len(self.url) + len(url) > MAX_URL_BYTES:
            raise self._too_much(414)
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header, or what comes in the place of one after a body."""
        self._parsed_bytes += len(name) + len(value)
        if self._parsed_bytes > MAX_HEAD_BYTES or len(self.headers) >= MAX_HEADERS:
            raise self._too_much(431)
        if name.lower() not in NOT_PASSED_ON:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Have the request answered."""
        if len(self.pipeline) >= MAX_WAITING_REQUESTS:
            raise self._too_much(400)
        self._unfinished_bytes = 0
        self._connection.body_bytes = 0
        self._connection.enter("body", self.loop.time())
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Take a part of the body."""
        self._unfinished_bytes = 0
        self._connection.body_bytes += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """The request is here; whether it was answered already or not."""
        super().on_message_complete()
        self._unfinished_bytes = 0
        answered = self.cycle.response_complete
        self._connection.enter("idle" if answered else "answer", self.loop.time())

    def on_response_complete(self) -> None:
        """The answer is complete; what is left of the request's body is read and thrown away."""
        super().on_response_complete()
        now_s = self.loop.time()
        if self.transport.is_closing():
            self._connection.enter("closing", now_s)
        elif self._connection.phase == "answer" and self.cycle.response_complete:
            self._connection.enter("idle", now_s)
        elif self._connection.phase == "body" and self.expect_100_continue:
            self._close()  # a body that was not asked for may come or not

    # Inside

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        self._answered = cycle
        super()._start_asgi_task(cycle, app)

    def _paired(self, device: str | None) -> None:
        self._all.pair(self._connection, device)

    def _too_much(self, status: int) -> _TooMuch:
        self._refused = status
        return _TooMuch(status)

    def _end(self, waited_for: Phase | None) -> None:
        """End it, and say so where somebody waits for an answer."""
        if waited_for == "idle" or (waited_for == "head" and not self._unfinished_bytes):
            self._close()
        elif waited_for in ("head", "body"):
            self._refuse(408)
        else:
            self._give_up()
            self.transport.abort()

    def _refuse(self, status: int) -> None:
        """Answer with a problem, unless another answer is on its way, and hang up."""
        answered = self._answered
        if answered is None or answered.response_complete or not answered.response_started:
            self.transport.write(_problem(status))
        self._give_up()
        self._close()

    def _close(self) -> None:
        self._connection.enter("closing", self.loop.time())
        self.transport.close()

    def _give_up(self) -> None:
        """Tell whoever answers that nobody listens."""
        self.pipeline.clear()
        if self._answered is not None and not self._answered.response_complete:
            self._answered.disconnected = True
            self._answered.message_event.set()
            self.flow.resume_writing()


def _problem(status: int) -> bytes:
    title = STATUS_LINE[status].decode().partition(f"{status} ")[2].strip()
    problem = {"type": "about:blank", "title": title, "status": status, "detail": SENTENCES[status]}
    body = json.dumps(problem).encode()
    head = (
        f"content-type: {PROBLEM_JSON}\r\ncontent-length: {len(body)}\r\n"
        "cache-control: no-store\r\nconnection: close\r\n\r\n"
    )
    return STATUS_LINE[status] + head.encode() + body
