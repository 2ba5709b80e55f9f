"""Run the server until somebody stops it."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
import ssl
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.config import STARTUP_FAILURE

from peaking.errors import OutputError
from peaking.server.app import ServerOptions, create_app
from peaking.server.bounded_answers import BoundedAnswers
from peaking.server.connections import (
    Connection,
    ConnectionLimits,
    Connections,
    limits_of_this_process,
)
from peaking.server.events import Hub
from peaking.server.http_connection import HttpConnection
from peaking.server.plain_http import begins_tls, send_to_https
from peaking.server.sessions import SessionStore
from peaking.server.warm_up import WarmUp
from peaking.terminal import LOGGING

CLIENT_DIR = Path(__file__).parent / "client"
PORTS_TO_TRY = 20
BACKLOG = 1024
IDLE_S = round(ConnectionLimits.paired_idle_s)
SWEEP_S = 0.5
ENDING_S = 2.0
"""Answers that are being given have so long when the server stops, and as long to be given up."""

NO_FILES = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
ACCEPT_PAUSE_S = 0.05
UNSENT_BYTES = 65_536
"""Of an answer that the system takes beyond what is on its way already."""

_log = logging.getLogger("peaking.server")


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
            listener.listen(BACKLOG)
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
    warm_up: WarmUp | None = None,
) -> None:
    """Serve until Ctrl-C.

    Args:
        listener: Where.
        sessions: Folder of the sessions.
        config: What is served, and to whom.
        context: For https.
        started: Called when requests are answered.
        told: Hears of sessions that cannot be opened.
        warm_up: What is done first; tells how far it is.
    """
    with listener:
        store = SessionStore(sessions)
        for problem in store.problems:
            told(problem)
        hub = Hub()
        app = create_app(store=store, config=config, hub=hub, warm_up=warm_up)
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
    server = Server(app, context=context, started=started, stopping=stopping)
    server.run(sockets=[listener])


class Server(uvicorn.Server):
    """Accepts connections one by one, within limits, and ends them quietly.

    asyncio's own server knows of a connection only when TLS has been agreed on; thousands that
    never get there would use up the files that this process may open. Whoever speaks plain http to
    a port of https is sent on.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        context: ssl.SSLContext | None = None,
        started: Callable[[], None] = lambda: None,
        stopping: Callable[[], None] = lambda: None,
        limits: ConnectionLimits | None = None,
    ) -> None:
        """Take what is served; see `run`. By default the limits are those of this process."""
        config = _config(BoundedAnswers(app))
        super().__init__(config)
        self._context = context
        self._of_plain_http = config if context is None else _config(send_to_https)
        self._when_started = started
        self._when_stopping = stopping
        self._connections = Connections(limits or limits_of_this_process())
        self._running: set[asyncio.Task[None]] = set()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to accept connections."""
        await self.lifespan.startup()
        if self.lifespan.should_exit:
            sys.exit(STARTUP_FAILURE)
        for listener in sockets or []:
            listener.setblocking(False)
            self._start(self._accept(listener))
        self._start(self._sweep())
        self.started = True
        self._when_started()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept no more, let answers be given for a moment, and hang up."""
        self._when_stopping()
        for task in self._running:
            task.cancel()
        for listener in sockets or []:
            listener.close()
        for connection in list(self.server_state.connections):
            connection.shutdown()
        await self._ended(within_s=ENDING_S)
        for connection in self._connections:
            connection.end(None)
        await self._ended(within_s=ENDING_S)
        await self.lifespan.shutdown()

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._running.add(task)
        task.add_done_callback(self._running.discard)

    async def _accept(self, listener: socket.socket) -> None:
        """Take whoever comes; whatever goes wrong with one, the next one is taken."""
        while True:
            try:
                pause_s = await self._accept_one(listener)
            except Exception:
                _log.exception("a connection was not taken")
                pause_s = ACCEPT_PAUSE_S
            await asyncio.sleep(pause_s)

    async def _accept_one(self, listener: socket.socket) -> float:
        """Take one, and return how long those who are connected go first."""
        try:
            accepted, address = await asyncio.get_running_loop().sock_accept(listener)
        except OSError as error:
            if error.errno not in NO_FILES:
                return 0.0  # it has gone again
            self._connections.make_room()
            return ACCEPT_PAUSE_S
        self._start(self._connect(accepted, str(address[0])))
        return 0.0

    async def _connect(self, accepted: socket.socket, address: str) -> None:
        loop = asyncio.get_running_loop()

        def end(_: object) -> None:
            with contextlib.suppress(OSError):
                accepted.shutdown(socket.SHUT_RDWR)

        _keep_little_unsent(accepted)
        connection = Connection(address, end, loop.time())

        def protocol() -> HttpConnection:
            return HttpConnection(
                connection,
                self._connections,
                config=self._of_plain_http if context is None else self.config,
                server_state=self.server_state,
                app_state=self.lifespan.state,
            )

        context = self._context
        try:
            self._connections.admit(connection)
            if context is not None and not await begins_tls(accepted):
                context = None
            await loop.connect_accepted_socket(protocol, accepted, ssl=context)
        except OSError:  # no TLS was agreed on, or the caller has gone
            self._connections.remove(connection)
        except Exception:
            self._connections.remove(connection)
            accepted.close()
            _log.exception("a connection was not taken")

    async def _sweep(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                self._connections.sweep(loop.time())
            except Exception:  # whatever it is, the limits hold
                _log.exception("the limits of connections were not looked after")
            await asyncio.sleep(SWEEP_S)

    async def _ended(self, *, within_s: float) -> None:
        """Wait until all connections have ended and all answers are given, or the time is over."""
        state, pause_s = self.server_state, 0.02
        for _ in range(round(within_s / pause_s)):
            if not state.connections and not state.tasks:
                return
            await asyncio.sleep(pause_s)


def _config(app: ASGIApp) -> uvicorn.Config:
    config = uvicorn.Config(
        app,
        http="httptools",
        ws="none",
        log_config=LOGGING,
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,  # who is on this machine could name any address
        timeout_keep_alive=IDLE_S,
    )
    config.load()
    return config


def _keep_little_unsent(accepted: socket.socket) -> None:
    """Let a connection say early that it can take more, so that slow readers are seen to read.

    Otherwise the system takes megabytes at once, and nothing more until a third of them is read.
    """
    with contextlib.suppress(OSError, AttributeError):  # not on every system
        accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
