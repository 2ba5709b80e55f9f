"""Plain http that comes to a port of https: it is sent on, rather than hung up on."""

from __future__ import annotations

import asyncio
import re
import socket
from urllib.parse import quote

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from peaking.server.responses import problem

TLS_BEGINS = b"\x16"
"""The first byte of a TLS hello (RFC 8446, 5.1: a record of a handshake); no request begins so."""

_HOST = re.compile(r"[A-Za-z0-9.\-_]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?")


async def begins_tls(accepted: socket.socket) -> bool:
    """Wait for the first byte, which stays unread, and return whether TLS begins with it.

    Raises:
        OSError: The caller has gone; the socket is closed.
    """
    loop, came = asyncio.get_running_loop(), asyncio.Event()
    loop.add_reader(accepted, came.set)
    try:
        await came.wait()
        first = accepted.recv(1, socket.MSG_PEEK)
        if not first:
            raise ConnectionResetError
        return first == TLS_BEGINS
    except BaseException:
        accepted.close()
        raise
    finally:
        loop.remove_reader(accepted)


async def send_to_https(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer every request with the same address, by https.

    The answer is not kept: another day there may be no https at this port (`--adb`).
    """
    if scope["type"] != "http":
        return
    host = Headers(scope=scope).get("host", "")
    if not _HOST.fullmatch(host):
        await problem(400, "Open this address with https://.")(scope, receive, send)
        return
    path = quote(scope["raw_path"], safe="/%:@!$&'()*+,;=~")
    query = quote(scope["query_string"], safe="/?%:@!$&'()*+,;=~")
    address = f"https://{host}{path}{'?' if query else ''}{query}"
    headers = {"Location": address, "Cache-Control": "no-store"}
    await Response(f"{address}\n", 307, headers, "text/plain")(scope, receive, send)
