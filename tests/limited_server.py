"""A server in a thread of this process, with limits that a test can reach."""

from __future__ import annotations

import contextlib
import socket
import ssl
import threading
from collections.abc import Generator

from starlette.types import ASGIApp

from patience import PATIENCE_S
from peaking.server.connections import ConnectionLimits
from peaking.server.serving import Server, bind


@contextlib.contextmanager
def limited_server(
    app: ASGIApp, limits: ConnectionLimits, *, context: ssl.SSLContext | None = None
) -> Generator[int, None, None]:
    """Serve on loopback while the block runs; yield the port."""
    listener = bind("127.0.0.1", 0)
    port = listener.getsockname()[1]
    started = threading.Event()
    server = Server(app, context=context, started=started.set, limits=limits)
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        assert started.wait(PATIENCE_S)
        yield port
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def connect(port: int, sent: bytes = b"") -> socket.socket:
    """Open a connection and send something."""
    connection = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
    connection.sendall(sent)
    return connection


def heard(connection: socket.socket) -> bytes:
    """Return all that comes until the server hangs up."""
    parts: list[bytes] = []
    with contextlib.suppress(ConnectionResetError):
        while part := connection.recv(65_536):
            parts.append(part)
    connection.close()
    return b"".join(parts)
