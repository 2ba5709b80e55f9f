"""Bodies of requests, bounded all together: room is taken before one of them is read."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from peaking.server.fair_room import Busy, FairRoom
from peaking.server.requests import declared_bytes, device_of
from peaking.server.responses import busy

UPLOADS_AT_ONCE = 4
"""Of the largest size."""


@dataclass(frozen=True)
class BoundedBodies:
    """Lets a request through when there is room for its body, and gives the room back after it.

    It stands behind the guard, so that strangers take no room.

    Attributes:
        app: What answers.
        largest_bytes: A body that says it is larger takes none: it is refused without being read.
        room: For the bodies that are being read or worked on.
    """

    app: ASGIApp
    largest_bytes: int
    room: FairRoom = field(init=False)

    def __post_init__(self) -> None:
        """Begin with nothing taken."""
        object.__setattr__(self, "room", FairRoom(UPLOADS_AT_ONCE * self.largest_bytes))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or ask to come again."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self.app(scope, receive, send)
            return
        request = Request(scope)
        device = device_of(request)
        declared = min(declared_bytes(request), self.largest_bytes)
        with contextlib.ExitStack() as shares:
            try:
                shares.callback(self.room.take(declared, device).give_back)
            except Busy as error:
                await busy(error)(scope, receive, send)
                return
            came = taken = 0

            async def receive_counted() -> Message:
                nonlocal came, taken
                message = await receive()
                came += len(message.get("body", b""))
                beyond = min(came, self.largest_bytes) - declared - taken
                if beyond > 0:  # of bodies that do not say how long they are
                    shares.callback(self.room.take(beyond, device).give_back)
                    taken += beyond
                return message

            await self.app(scope, receive_counted, send)
