"""Answers in the wire's words."""

from __future__ import annotations

from collections.abc import AsyncIterable, Mapping

import msgspec
from starlette.responses import Response, StreamingResponse

from peaking.server import wire


def json_answer(value: object, *, status: int = 200) -> Response:
    """Return a struct of the wire as JSON."""
    return Response(
        msgspec.json.encode(value),
        status,
        {"Cache-Control": "no-store"},
        media_type="application/json",
    )


def problem(status: int, sentence: str, headers: Mapping[str, str] | None = None) -> Response:
    """Return a refusal: what is wrong and what to do."""
    return Response(
        msgspec.json.encode(wire.Problem(sentence)),
        status,
        {"Cache-Control": "no-store", **(headers or {})},
        media_type="application/json",
    )


def event_stream(events: AsyncIterable[bytes]) -> Response:
    """Return server-sent events, for as long as somebody reads."""
    return StreamingResponse(
        events,
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )
