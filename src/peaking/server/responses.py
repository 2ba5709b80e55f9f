"""Responses in the wire's words."""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncGenerator, Mapping
from http import HTTPStatus
from typing import Literal
from urllib.parse import quote

import msgspec
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from peaking.server import wire
from peaking.server.fair_room import Busy

ProblemKind = Literal[
    "busy",
    "cut-off",
    "deleted",
    "disk-full",
    "erased",
    "finished",
    "incomplete",
    "invalid",
    "not-admitted",
    "not-paired",
    "out-of-date",
    "protocol",
    "too-large",
]

TITLES: Mapping[ProblemKind, str] = {
    "busy": "The server is busy",
    "cut-off": "The upload was cut off",
    "deleted": "The session was deleted",
    "disk-full": "The server's disk is full",
    "erased": "The session was erased",
    "finished": "The session is finished",
    "incomplete": "The form is incomplete",
    "invalid": "The request is not valid",
    "not-admitted": "This is not allowed",
    "not-paired": "This device is not paired",
    "out-of-date": "The page is out of date",
    "protocol": "Client and server speak different versions of the protocol",
    "too-large": "The request is too large",
}
PROBLEM_JSON = "application/problem+json"
LASTING: Mapping[str, str] = {"Cache-Control": "private, max-age=31536000, immutable"}
"""Headers of what never changes."""


def json_response(value: object, *, status: int = 200) -> Response:
    """Return a struct of the wire as JSON."""
    return _json(value, status, "application/json", {})


def problem(
    status: int,
    detail: str,
    *,
    kind: ProblemKind | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """Return a refusal as RFC 9457 has it: `detail` says what is wrong and what to do."""
    described = wire.Problem(*type_and_title(status, kind), status=status, detail=detail)
    return problem_response(described, headers)


def type_and_title(status: int, kind: ProblemKind | None) -> tuple[str, str]:
    """Return how a problem is told apart: by a URI of its own, or by the status alone."""
    if kind is None:
        return "about:blank", HTTPStatus(status).phrase
    return f"urn:peaking:problem:{kind}", TITLES[kind]


def problem_response(described: wire.Problem, headers: Mapping[str, str] | None = None) -> Response:
    """Return a problem, or one with more fields."""
    return _json(described, described.status, PROBLEM_JSON, headers or {})


def attachment(name: str) -> Mapping[str, str]:
    """Return the headers that have a browser store the answer as a file of any name (RFC 6266).

    Clients that do not read `filename*` get a name in which `_` stands for what is not ASCII.
    """
    plain_name = re.sub(r"[^A-Za-z0-9 ._()-]", "_", name)
    exact = quote(name.encode("utf-8", errors="replace"), safe="")
    return {
        "Content-Disposition": f"attachment; filename=\"{plain_name}\"; filename*=UTF-8''{exact}"
    }


def busy(error: Busy) -> Response:
    """Return a refusal of something that is only to be sent again later."""
    return problem(503, str(error), kind="busy", headers={"Retry-After": str(error.retry_after_s)})


def event_stream(request: Request, events: AsyncGenerator[bytes]) -> Response:
    """Return server-sent events, for as long as somebody reads; nothing where nobody will."""
    media_type = "text/event-stream"
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    if request.method == "HEAD":
        return Response(media_type=media_type, headers=headers)
    return _EventStream(events, media_type=media_type, headers=headers)


class _EventStream(StreamingResponse):
    """Closes its events at the end, wherever it was cut off."""

    def __init__(
        self, events: AsyncGenerator[bytes], *, media_type: str, headers: Mapping[str, str]
    ) -> None:
        super().__init__(events, media_type=media_type, headers=headers)
        self._events = events

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async with contextlib.aclosing(self._events):
            await super().__call__(scope, receive, send)


def _json(value: object, status: int, media_type: str, headers: Mapping[str, str]) -> Response:
    return Response(
        msgspec.json.encode(value),
        status,
        {"Cache-Control": "no-store", **headers},
        media_type=media_type,
    )
