"""Run the server until somebody stops it."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from peaking.errors import OutputError
from peaking.server.app import ServerOptions, create_app
from peaking.server.events import Hub
from peaking.server.sessions import SessionStore
from peaking.terminal import LOGGING

CLIENT_DIR = Path(__file__).parent / "client"
PORTS_TO_TRY = 20


def bind(host: str, port: int) -> socket.socket:
    """Return a socket that listens at a port, or at the next free one; 0 takes any.

    Raises:
        OutputError: None of them is free, or the host is not this machine's.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    problem: OSError | None = None
    for candidate in range(port, port + PORTS_TO_TRY if port else 1):
        # asyncio sends at once (TCP_NODELAY) only on sockets that say they are TCP. On others an
        # answer's body waits 40 ms, until the phone has acknowledged its head.
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, candidate))
            listener.listen(128)
        except OSError as error:
            listener.close()
            problem = error
            continue
        listener.set_inheritable(True)
        return listener
    reason = problem.strerror if problem else "no port"
    raise OutputError(f"{host}:{port}: cannot listen there ({reason}); give another --port")


def serve(
    listener: socket.socket,
    *,
    sessions: Path,
    config: ServerOptions,
    context: ssl.SSLContext | None = None,
    started: Callable[[], None],
    told: Callable[[str], None],
) -> None:
    """Serve until Ctrl-C.

    Args:
        listener: Where.
        sessions: Folder of the sessions.
        config: What is served, and to whom.
        context: For https.
        started: Called when requests are answered.
        told: Hears of sessions that cannot be opened.
    """
    store = SessionStore(sessions)
    for problem in store.problems:
        told(problem)
    hub = Hub()
    app = create_app(store=store, config=config, hub=hub)
    run(listener, app, context=context, started=started, stopping=hub.close)


def run(
    listener: socket.socket,
    app: ASGIApp,
    *,
    context: ssl.SSLContext | None = None,
    started: Callable[[], None],
    stopping: Callable[[], None] = lambda: None,
) -> None:
    """Serve an application until Ctrl-C.

    Args:
        listener: Where.
        app: What.
        context: For https.
        started: Called when requests are answered.
        stopping: Called first at the end: what ends responses that would never end by themselves.
    """
    settings = uvicorn.Config(
        app,
        http="httptools",
        ws="none",
        log_config=LOGGING,
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=3,
    )
    settings.load()
    settings.ssl = context
    server = _Server(settings, started, stopping)
    server.run(sockets=[listener])


class _Server(uvicorn.Server):
    """Says when it answers, and when it is about to wait for connections to end."""

    def __init__(
        self, config: uvicorn.Config, started: Callable[[], None], stopping: Callable[[], None]
    ) -> None:
        super().__init__(config)
        self._when_started = started
        self._when_stopping = stopping

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets=sockets)
        self._when_started()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._when_stopping()
        await super().shutdown(sockets=sockets)
