"""Answers, sent no faster than they are read, and bounded all together while they wait for that."""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass, field

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from peaking.server.fair_room import Busy, FairRoom, Share
from peaking.server.requests import device_of
from peaking.server.responses import busy

PART_BYTES = 65_536
"""More is not handed to the connection at once: it keeps what is not read yet, and encrypts it."""

ROOM_BYTES = 256_000_000
"""For answers that are in memory as a whole, those of one part left aside."""


@dataclass(frozen=True)
class BoundedAnswers:
    """Passes large answers on in parts, each when the one before is on its way.

    An answer that is in memory as a whole takes room until its last part has been handed on; where
    there is none the device is asked to come again.

    Attributes:
        app: What answers.
        room: For those answers.
    """

    app: ASGIApp
    room: FairRoom = field(default_factory=lambda: FairRoom(ROOM_BYTES))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        answer = _Answer(scope, receive, send, self.room)
        with contextlib.closing(answer):
            await self.app(scope, receive, answer.send)


class _Answer:
    """One answer on its way."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, room: FairRoom) -> None:
        self._scope, self._receive, self._send, self._room = scope, receive, send, room
        self._start: Message | None = None
        self._share: Share | None = None
        self._refused = False

    async def send(self, message: Message) -> None:
        """Pass a message on, unless there is no room for what it brings."""
        if self._refused:
            return
        if message["type"] == "http.response.start":
            self._start = message  # until it is known whether there is room for the rest
            return
        body: bytes = message.get("body", b"")
        large = len(body) > PART_BYTES and self._scope["method"] != "HEAD"
        if large and self._start is not None and not message.get("more_body", False):
            try:
                amount = min(len(body), ROOM_BYTES // 2)
                self._share = self._room.take(amount, device_of(Request(self._scope)))
            except Busy as error:
                self._refused = True
                await busy(error)(self._scope, self._receive, self._send)
                return
        if self._start is not None:
            start, self._start = self._start, None
            await self._send(start)
        if large:
            await self._send_in_parts(body)
            message = {**message, "body": b""}
        await self._send(message)

    def close(self) -> None:
        """Give the room back."""
        if self._share is not None:
            self._share.give_back()

    async def _send_in_parts(self, body: bytes) -> None:
        view = memoryview(body)
        for start in range(0, len(body), PART_BYTES):
            part = bytes(view[start : start + PART_BYTES])  # a view would keep all of it
            await self._send({"type": "http.response.body", "body": part, "more_body": True})
            await asyncio.sleep(0)  # whoever reads fast keeps nobody waiting
