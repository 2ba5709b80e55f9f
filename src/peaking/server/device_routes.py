"""The addresses by which devices are paired, listed and revoked."""

from __future__ import annotations

import asyncio
import contextlib
import io
import logging
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from dataclasses import dataclass

import segno
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from peaking.errors import OutputError
from peaking.server import wire
from peaking.server.auth import KNOWN, PAIR, address_of, cookie_header, too_many
from peaking.server.devices import Devices
from peaking.server.guessing import TooManyGuesses
from peaking.server.pairing_codes import CODE_LASTS_S, CodeRefused, Grant
from peaking.server.requests import read_json
from peaking.server.responses import json_response, problem
from peaking.server.upload import check_protocol

LOOKED_AFTER_EVERY_S = 1.0
WRONG = (
    "This link does not fit this server. Scan the newest code that the server or a paired device "
    "shows."
)
_log = logging.getLogger("peaking.server")


@contextlib.asynccontextmanager
async def looked_after(devices: Devices | None) -> AsyncGenerator[None, None]:
    """While the block runs, take over every second what another process changed."""

    async def look() -> None:
        while devices is not None:
            await asyncio.sleep(LOOKED_AFTER_EVERY_S)
            try:
                await run_in_threadpool(devices.refresh)
            except (OutputError, OSError) as error:  # a full disk: tried again
                _log.warning("the list of devices could not be written: %s", error)

    looking = asyncio.ensure_future(look())
    try:
        yield
    finally:
        looking.cancel()
        if devices is not None:
            with contextlib.suppress(OutputError, OSError):
                await run_in_threadpool(devices.close)


def pairing_link(
    devices: Devices | None,
    pages: Sequence[str],
    grant: Grant,
    *,
    after: Callable[[], None] = lambda: None,
    clock: Callable[[], float] = time.time,
) -> wire.PairingLink:
    """Return links to pages, with a new code.

    Args:
        devices: Knows the code from now on; None where nothing is paired: links without a code.
        pages: Addresses of the page that is opened, the best first.
        grant: What the code pairs for.
        after: Called when the code is over, because somebody came with it.
        clock: Seconds since 1970.
    """
    secret = "" if devices is None else f"#code={devices.codes.give(grant, after=after)}"
    links = [page + secret for page in pages]
    picture = io.BytesIO()
    segno.make(links[0], error="m").save(
        picture, kind="svg", scale=5, border=3, dark="#0d0f12", light="#ffffff", xmldecl=False
    )
    return wire.PairingLink(links, picture.getvalue().decode(), clock() + CODE_LASTS_S)


@dataclass(frozen=True)
class DeviceHandlers:
    """The handlers, and what they need.

    Attributes:
        devices: None on a server for this machine only, which lets everybody there in.
        pages: What a device opens that is paired by another one.
    """

    devices: Devices | None
    pages: Sequence[str]

    def routes(self) -> list[Route]:
        """Return the addresses."""
        return [
            Route(PAIR, self.pair, methods=["POST"]),
            Route("/api/v1/devices", self.list, methods=["GET"]),
            Route("/api/v1/devices/codes", self.code, methods=["POST"]),
            Route("/api/v1/devices/{device}", self.revoke, methods=["DELETE"]),
        ]

    async def pair(self, request: Request) -> Response:
        """Give a device a credential of its own."""
        if self.devices is None:
            await _pairing(request)
            return json_response(wire.Paired("", "device", None))
        guesses, address = self.devices.guesses, address_of(request.scope)
        try:
            await guesses.before(address)
            asked = await _pairing(request)
            try:
                paired = await run_in_threadpool(
                    self.devices.pair, asked.code, device=asked.device, name=asked.name
                )
                sentence = WRONG
            except CodeRefused as error:
                paired, sentence = None, str(error)
            if paired is None:
                await guesses.failed(address)
                return problem(401, sentence, kind="not-paired")
        except TooManyGuesses as error:
            return too_many(error)
        device, credential = paired
        answer = wire.Paired(device.id, device.role, None if asked.cookie else credential)
        response = json_response(answer)
        if asked.cookie:
            cookie = cookie_header(request.scope, self.devices, credential)
            response.headers.append("Set-Cookie", cookie)
        return response

    async def list(self, request: Request) -> Response:
        """Name the devices that may use this server."""
        if self.devices is None:
            return json_response(wire.PairedDevices([], open=True))
        own = request.scope[KNOWN]
        devices = [
            wire.PairedDevice(
                id=one.id,
                name=one.name,
                role=one.role,
                participants=one.participants,
                paired_s=one.paired_s,
                seen_s=one.seen_s,
                this=one.id == own.id,
            )
            for one in self.devices.list()
        ]
        return json_response(wire.PairedDevices(devices, open=False))

    async def code(self, _: Request) -> Response:
        """Make a code for another device."""
        if self.devices is None:
            raise HTTPException(409, "This server serves its own computer only; nothing is paired.")
        link = await run_in_threadpool(pairing_link, self.devices, self.pages, self.devices.usual)
        return json_response(link)

    async def revoke(self, request: Request) -> Response:
        """Let a device in no more; one that is not there is not let in either."""
        if self.devices is not None:
            await run_in_threadpool(self.devices.revoke, request.path_params["device"])
        return Response(status_code=204)


async def _pairing(request: Request) -> wire.Pairing:
    asked = await read_json(request, wire.Pairing)
    check_protocol(asked.protocol, by="client")
    return asked
