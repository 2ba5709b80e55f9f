"""Who may talk to the server: devices that are paired, or nobody but this machine."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from peaking.errors import OutputError
from peaking.server.devices import LASTS_S, Device, Devices
from peaking.server.guessing import TooManyGuesses
from peaking.server.requests import cookie_of, mark_paired
from peaking.server.responses import LASTING, problem

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]", "::1"})
API = "/api/"
PAIR = "/api/v1/pair"
CONSOLE = "/api/v1/study/console"
PARTICIPANTS = "/api/v1/study/participants/"
SESSIONS = "/api/v1/sessions/"
FOR_EVERYBODY = ("/api/v1/server", "/api/v1/openapi.json", "/api/v1/study/texts")
"""Participants' phones may ask for these, for what is theirs, and for nothing else.

Whose a session is, its handlers know.
"""
RENEWED = "Peaking-Credential"
"""Header of an answer: the credential that takes the place of the one that was sent."""
KNOWN = "peaking.known"
"""In the scope of a request: the device that sends it; None on a server for this machine only."""
GUARDED = "peaking.guarded"
CONTENT_POLICY = (
    # What draws 3D Gaussians is compiled for the browser, and allowed to run: no other code is.
    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; "
    "img-src 'self' blob: data:; media-src 'self' blob:; "
    "connect-src 'self' blob: data:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'"
)
HEADERS: Mapping[str, str] = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": CONTENT_POLICY,
}
_log = logging.getLogger("peaking.server")


@dataclass(frozen=True)
class _Shown:
    """A credential as it came."""

    credential: str
    in_cookie: bool


@dataclass(frozen=True)
class Guard:
    """Lets requests of paired devices through; without devices, those addressed to loopback.

    It also refuses changes that a page of another origin asks for, replaces credentials in time,
    ends the streams of a device that is revoked, and adds security headers to every answer.
    """

    app: ASGIApp
    devices: Devices | None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or answer with a refusal."""
        if scope["type"] != "http" or GUARDED in scope:  # another guard stands before this one
            await self.app(scope, receive, send)
            return
        scope[GUARDED] = True
        headers: dict[str, str] = dict(HEADERS)
        app = await self._admit(scope, headers)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                sent = MutableHeaders(scope=message)
                lasting = sent.get("cache-control") == LASTING["Cache-Control"]
                for name, value in headers.items():
                    if not (lasting and name in ("Set-Cookie", RENEWED)):
                        sent[name] = value
            await send(message)

        await app(scope, receive, send_guarded)

    async def _admit(self, scope: Scope, headers: dict[str, str]) -> ASGIApp:
        """Return what answers: the application, or a refusal; may add headers to the answer."""
        asked = Headers(scope=scope)
        host, path = asked.get("host", ""), scope["path"]
        if not path.isprintable():  # routes would pass over a newline at its end
            return problem(404, "There is nothing at this address.")
        if self.devices is None and _name(host) not in LOOPBACK_NAMES:
            return problem(403, "This server answers only requests to localhost.")
        if not path.startswith(API):
            return self.app
        origin = asked.get("origin")
        changes = scope["method"] not in ("GET", "HEAD", "OPTIONS")
        foreign = changes and origin is not None and origin.partition("://")[2] != host
        if self.devices is not None and not (path == PAIR and scope["method"] == "POST"):
            shown = _credentials(scope, asked, self.devices)
            found = next(
                ((s, k) for s in shown if (k := self.devices.known(s.credential)) is not None), None
            )
            if found is None:
                return await self._stranger(scope, self.devices, guessed=bool(shown))
            used, known = found
            refusal = _refusal_of_role(known.device, path)
            if refusal is not None:
                return refusal
            scope[KNOWN] = known.device
            mark_paired(scope, known.device.id)
            if known.renewal_due:
                await _renew(self.devices, used, scope, headers)
        elif self.devices is None:
            scope[KNOWN] = None
            mark_paired(scope)
        if foreign:
            return problem(403, "Requests from pages of another origin are rejected.")
        return self._until_revoked if path.endswith("/events") else self.app

    async def _stranger(self, scope: Scope, devices: Devices, *, guessed: bool) -> ASGIApp:
        if guessed:
            try:
                await devices.guesses.failed(address_of(scope))
            except TooManyGuesses as error:
                return too_many(error)
        sentence = "Pair this device first: open the link that the server printed."
        return problem(401, sentence, kind="not-paired")

    async def _until_revoked(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with a stream that ends when its device is revoked."""
        device: Device | None = scope.get(KNOWN)
        if device is None or self.devices is None:
            await self.app(scope, receive, send)
            return
        revoked, loop = asyncio.Event(), asyncio.get_running_loop()
        begun = False

        async def send_watched(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        def revoke() -> None:
            with contextlib.suppress(RuntimeError):  # the server ended meanwhile
                loop.call_soon_threadsafe(revoked.set)

        with self.devices.listening(device.id, revoke):
            answer = asyncio.ensure_future(self.app(scope, receive, send_watched))
            waiting = asyncio.ensure_future(revoked.wait())
            try:
                await asyncio.wait({answer, waiting}, return_when=asyncio.FIRST_COMPLETED)
                if answer.done():
                    answer.result()
            finally:
                waiting.cancel()
                if not answer.done():
                    answer.cancel()
                    with contextlib.suppress(asyncio.CancelledError):
                        await answer
            if revoked.is_set() and begun:
                await send({"type": "http.response.body", "body": b"", "more_body": False})


def cookie_name(scope: Scope, devices: Devices) -> str:
    """Return the cookie's name; over https one that no page without https can set."""
    return f"__Host-{devices.cookie}" if scope["scheme"] == "https" else devices.cookie


def cookie_header(scope: Scope, devices: Devices, credential: str) -> str:
    """Return a cookie as the header `Set-Cookie` has it."""
    secure = "; Secure" if scope["scheme"] == "https" else ""
    return (
        f"{cookie_name(scope, devices)}={credential}; Max-Age={LASTS_S:.0f}; Path=/; HttpOnly; "
        f"SameSite=Strict{secure}"
    )


def address_of(scope: Scope) -> str:
    """Return the address that a request comes from."""
    client = scope.get("client")
    return client[0] if client else ""


def too_many(error: TooManyGuesses) -> Response:
    """Return the answer to somebody who has guessed too often."""
    after = {"Retry-After": str(math.ceil(error.retry_after_s))}
    return problem(429, str(error), headers=after)


async def _renew(devices: Devices, used: _Shown, scope: Scope, headers: dict[str, str]) -> None:
    try:
        successor = await run_in_threadpool(devices.renew, used.credential)
    except (OutputError, OSError) as error:  # the old one is still good: tried again
        _log.warning("a credential could not be renewed: %s", error)
        return
    if successor is not None and used.in_cookie:
        headers["Set-Cookie"] = cookie_header(scope, devices, successor)
    elif successor is not None:
        headers[RENEWED] = successor


def _credentials(scope: Scope, headers: Headers, devices: Devices) -> list[_Shown]:
    scheme, _, bearer = headers.get("authorization", "").partition(" ")
    shown: list[_Shown] = []
    if scheme.lower() == "bearer" and bearer.strip():
        shown.append(_Shown(bearer.strip(), in_cookie=False))
    cookie = cookie_of(scope, cookie_name(scope, devices))
    if cookie:
        shown.append(_Shown(cookie, in_cookie=True))
    return shown


def _refusal_of_role(device: Device, path: str) -> ASGIApp | None:
    """Return why a device may not ask for this, though it is paired."""
    if path.startswith(CONSOLE) and device.role != "console":
        sentence = "Only the experimenter's browser may use the console."
        return problem(403, sentence, kind="not-admitted")
    if device.role != "participant" or path in FOR_EVERYBODY or path.startswith(SESSIONS):
        return None
    if not path.startswith(PARTICIPANTS):
        sentence = "A participant's phone may not see this."
        return problem(403, sentence, kind="not-admitted")
    if path.removeprefix(PARTICIPANTS).split("/")[0] not in device.participants:
        sentence = "This phone was paired for another participant. Scan this one's code."
        return problem(403, sentence, kind="not-admitted")
    return None


def _name(host: str) -> str:
    """Return the host of a Host header, without its port."""
    return host if host.endswith("]") else host.rpartition(":")[0] or host
