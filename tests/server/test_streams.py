"""Streams: how many, how much waits for one, and what `HEAD` gets."""

from __future__ import annotations

import asyncio
import signal
import socket
from collections.abc import AsyncGenerator
from pathlib import Path

import msgspec
import pytest
from starlette.requests import Request
from starlette.types import Message, Scope
from test_app import SESSION, client_of

from capture_uploads import new_session
from live_server import LiveServer
from patience import PATIENCE_S
from peaking.server import events
from peaking.server.events import Hub
from peaking.server.responses import event_stream


class News(msgspec.Struct, tag=True):
    """An event."""

    text: str


def stream_of(hub: Hub, topic: str, device: str = "") -> AsyncGenerator[bytes, None]:
    return hub.stream(topic, lambda: News("state"), device=device)


def test_whoever_has_most_streams_loses_the_oldest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "MAX_STREAMS", 3)

    async def listen() -> None:
        hub = Hub()
        phone = stream_of(hub, "a", "phone")
        many = [stream_of(hub, "a", "many") for _ in range(5)]
        await anext(phone)
        for stream in many:
            await anext(stream)
        hub.send("a", News("x"))
        assert b'"x"' in await anext(phone)
        for gone in many[:3]:
            assert [message async for message in gone] == []
        for kept in many[3:]:
            assert b'"x"' in await anext(kept)
        for stream in (phone, *many):
            await stream.aclose()

    asyncio.run(listen())


def test_what_replaces_all_before_takes_its_place() -> None:
    async def listen() -> None:
        hub = Hub()
        stream = stream_of(hub, "a")
        await anext(stream)
        for number in range(1000):
            hub.send("a", News(f"{number} " + "x" * 100_000), replaces=True)
        await asyncio.sleep(0)
        assert b'"999 ' in await anext(stream)
        await stream.aclose()

    asyncio.run(listen())


def test_a_listener_gets_even_one_event_that_is_larger_than_may_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(events, "WAITING_BYTES", 10)

    async def listen() -> None:
        hub = Hub()
        stream = stream_of(hub, "a")
        await anext(stream)
        for text in ("one", "two"):
            hub.send("a", News(text))
            await asyncio.sleep(0)
            assert text.encode() in await anext(stream)
        await stream.aclose()

    asyncio.run(listen())


def test_nothing_is_kept_of_a_stream_that_has_ended() -> None:
    async def listen() -> Hub:
        hub = Hub()
        for number in range(100):
            stream = hub.stream(str(number), lambda: News("state"), live=True, device=str(number))
            await anext(stream)
            assert hub.is_live(str(number))
            await stream.aclose()
            assert not hub.is_live(str(number))
        return hub

    state = vars(asyncio.run(listen()))
    assert [name for name, held in state.items() if isinstance(held, dict) and held] == []


def test_a_stream_that_is_cut_off_while_it_is_sent_is_closed() -> None:
    """Before, it was when Python happened to collect it."""
    closed: list[bool] = []

    async def stream() -> AsyncGenerator[bytes]:
        try:
            while True:
                yield b"news"
        finally:
            closed.append(True)

    async def listen() -> None:
        waits = asyncio.Event()

        async def send(message: Message) -> None:
            if message["type"] == "http.response.body":
                waits.set()
                await asyncio.Event().wait()

        async def receive() -> Message:
            await waits.wait()
            return {"type": "http.disconnect"}

        scope: Scope = {"type": "http", "method": "GET", "path": "/", "headers": []}
        events = stream()
        await event_stream(Request(scope), events)(scope, receive, send)
        assert closed == [True]
        await events.aclose()

    asyncio.run(listen())


@pytest.mark.parametrize("path", ["/api/v1/events", f"{SESSION}/events", f"{SESSION}/dataset.zip"])
def test_head_of_what_has_no_end_ends(tmp_path: Path, path: str) -> None:
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        answer = client.head(path)
        assert (answer.status_code, answer.content) == (200, b"")
        assert not client.get(SESSION).json()["summary"]["live"]


def test_ctrl_c_with_streams_that_nobody_reads_is_quiet(tmp_path: Path) -> None:
    server = LiveServer(tmp_path / "sessions").start()
    request = b"GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n"
    listening: list[socket.socket] = []
    for _ in range(100):
        connection = socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE_S)
        connection.sendall(request)
        assert connection.recv(8, socket.MSG_WAITALL) == b"HTTP/1.1"
        listening.append(connection)
    before = len(server.said)
    server.process.send_signal(signal.SIGINT)
    assert server.process.wait(PATIENCE_S) is not None
    server.stop()
    for connection in listening:
        connection.close()
    said = "".join(server.said[before:])
    for word in ("Traceback", "Error", "ERROR", "Cancel", "Exception"):
        assert word not in said
