"""Who may talk to the server: a token, or nobody but this machine."""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from peaking.server.requests import cookie_of, mark_paired
from peaking.server.responses import problem

COOKIE = "peaking_token"
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]", "::1"})
API = "/api/"
CONTENT_POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; media-src 'self' blob:; "
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


@dataclass(frozen=True)
class Guard:
    """Lets requests through that carry the token; without a token, those addressed to loopback.

    It also refuses changes that a page of another origin asks for, and adds security headers to
    every answer.
    """

    app: ASGIApp
    token: str | None
    cookie: str = COOKIE

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or answer with a refusal."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        refusal = self._refusal(scope)
        await (refusal or self.app)(scope, receive, send_guarded)

    def _refusal(self, scope: Scope) -> ASGIApp | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if self.token is None and _name(host) not in LOOPBACK_NAMES:
            return problem(403, "This server answers only requests to localhost.")
        if not scope["path"].startswith(API):
            return None
        if self.token is not None and not self._knows_token(scope, headers):
            sentence = "Pair this device first: open the link that the server printed."
            return problem(401, sentence, kind="not-paired")
        origin = headers.get("origin")
        changes = scope["method"] not in ("GET", "HEAD", "OPTIONS")
        if changes and origin is not None and urlsplit(origin).netloc != host:
            return problem(403, "Requests from pages of another origin are rejected.")
        mark_paired(scope)
        return None

    def _knows_token(self, scope: Scope, headers: Headers) -> bool:
        assert self.token is not None
        scheme, _, bearer = headers.get("authorization", "").partition(" ")
        shown = [bearer.strip()] if scheme.lower() == "bearer" else []
        cookie = cookie_of(scope, self.cookie)
        if cookie is not None:
            shown.append(cookie)
        return any(hmac.compare_digest(s.encode(), self.token.encode()) for s in shown)


def _name(host: str) -> str:
    """Return the host of a Host header, without its port."""
    return host if host.endswith("]") else host.rpartition(":")[0] or host
