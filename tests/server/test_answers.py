"""Large answers are sent as fast as they are read, and bounded all together."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from limited_server import connect, heard, limited_server
from patience import PATIENCE_S
from peaking.server import bounded_answers
from peaking.server.bounded_answers import PART_BYTES, BoundedAnswers
from peaking.server.connections import ConnectionLimits
from peaking.server.dataset import zip_stream
from peaking.server.fair_room import Busy, FairRoom
from peaking.server.file_answers import BoundedStream, FileAnswer, OpenFile
from peaking.server.http_connection import HttpConnection
from peaking.server.requests import mark_paired
from peaking.server.serving import UNSENT_BYTES

LARGE = bytes(range(256)) * 40_000


def asked_by(device: str, method: str = "GET") -> Scope:
    return {
        "type": "http",
        "method": method,
        "path": "/",
        "headers": [],
        "peaking.device": device,
        "asgi": {"spec_version": "2.3"},
    }


class Reader:
    """Takes an answer; one that is slow takes nothing before it goes on."""

    def __init__(self, *, slow: bool = False) -> None:
        self.messages: list[Message] = []
        self.goes_on = asyncio.Event()
        self.waits = asyncio.Event()
        if not slow:
            self.goes_on.set()

    async def send(self, message: Message) -> None:
        self.messages.append(message)
        if message["type"] == "http.response.body" and message.get("body"):
            self.waits.set()
            await self.goes_on.wait()

    async def receive(self) -> Message:
        await asyncio.Event().wait()
        raise AssertionError

    async def ask(self, app: ASGIApp, device: str, method: str = "GET") -> None:
        await app(asked_by(device, method), self.receive, self.send)

    @property
    def status(self) -> int:
        return self.messages[0]["status"]

    @property
    def parts(self) -> list[bytes]:
        return [m.get("body", b"") for m in self.messages if m["type"] == "http.response.body"]


def test_a_large_answer_is_sent_in_parts_that_hold_nothing_else() -> None:
    async def work() -> None:
        reader = Reader()
        await reader.ask(BoundedAnswers(Response(LARGE)), "a")
        assert b"".join(reader.parts) == LARGE
        assert max(map(len, reader.parts)) == PART_BYTES
        assert {type(part) for part in reader.parts} == {bytes}
        assert [m.get("more_body", False) for m in reader.messages[1:]][-2:] == [True, False]
        assert not reader.parts[-1]  # the end is said when the rest is on its way

    asyncio.run(work())


def test_large_answers_that_are_not_read_have_bounded_room(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bounded_answers, "ROOM_BYTES", 4 * len(LARGE))

    async def work() -> None:
        app = BoundedAnswers(Response(LARGE), FairRoom(4 * len(LARGE)))
        readers = [Reader(slow=True) for _ in range(2)]
        answers = [asyncio.ensure_future(reader.ask(app, "flooder")) for reader in readers]
        for reader in readers:
            await reader.waits.wait()
        late, other = Reader(), Reader()
        await late.ask(app, "flooder")
        assert (late.status, b"busy" in b"".join(late.parts)) == (503, True)
        await other.ask(app, "phone")
        assert (other.status, b"".join(other.parts)) == (200, LARGE)
        small = Reader()
        await small.ask(BoundedAnswers(Response(b"small"), app.room), "flooder")
        assert small.status == 200
        for reader in readers:
            reader.goes_on.set()
        await asyncio.gather(*answers)
        await asyncio.sleep(0)
        assert app.room.taken == 0

    asyncio.run(work())


def test_an_answer_lasts_until_it_is_read() -> None:
    sent = threading.Event()

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            mark_paired(scope)
            assert (await Request(scope, receive).body()) == b""
            await Response(LARGE * 10)(scope, receive, send)
            sent.set()

    with limited_server(app, ConnectionLimits()) as port:
        reader = connect(port, b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        assert reader.recv(8) == b"HTTP/1.1"
        assert not sent.wait(1.0)
        assert heard(reader).endswith(LARGE * 10)
        assert sent.wait(PATIENCE_S)


def open_files() -> Iterator[str]:
    """Yield what this process has open."""
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            yield str(descriptor.readlink())


@pytest.fixture
def path(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "file"
    path.write_bytes(LARGE)
    yield path
    assert str(path) not in open_files()


def file_answer(path: Path, room: FairRoom) -> FileAnswer:
    file = OpenFile(path, within=path.parent)
    return FileAnswer(file, room=room, media_type="image/jpeg", headers={})


def test_a_file_is_sent_as_it_was_and_closed(path: Path) -> None:
    async def work() -> None:
        reader, room = Reader(slow=True), FairRoom(10)
        answer = asyncio.ensure_future(reader.ask(file_answer(path, room), "a"))
        await reader.waits.wait()
        path.unlink()
        path.write_bytes(b"another")
        assert sum(map(len, reader.parts)) < len(LARGE) / 10  # the rest is on the disk
        reader.goes_on.set()
        await answer
        assert b"".join(reader.parts) == LARGE
        await asyncio.sleep(0)
        assert room.taken == 0

    asyncio.run(work())


def test_files_that_are_not_read_are_bounded(path: Path) -> None:
    async def work() -> None:
        room, slow = FairRoom(4), [Reader(slow=True), Reader(slow=True)]
        answers = [asyncio.ensure_future(r.ask(file_answer(path, room), "a")) for r in slow]
        for reader in slow:
            await reader.waits.wait()
        with pytest.raises(Busy):
            await Reader().ask(file_answer(path, room), "a")
        await Reader().ask(file_answer(path, room), "b")
        for answer in answers:
            answer.cancel()
        await asyncio.gather(*answers, return_exceptions=True)
        await asyncio.sleep(0)
        assert room.taken == 0

    asyncio.run(work())


def test_head_of_a_file_reads_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(_: object) -> Any:
        raise AssertionError("it was read")
        yield b""

    monkeypatch.setattr(OpenFile, "parts", read)

    async def work() -> None:
        reader = Reader()
        await reader.ask(file_answer(path, FairRoom(10)), "a", "HEAD")
        assert (reader.status, reader.parts) == (200, [b""])
        assert (b"content-length", b"%d" % len(LARGE)) in reader.messages[0]["headers"]

    asyncio.run(work())


def one_part() -> Generator[bytes]:
    yield LARGE


def test_a_stream_takes_a_place_for_as_long_as_it_is_sent() -> None:
    async def work() -> None:
        room, reader = FairRoom(2), Reader(slow=True)

        def stream() -> BoundedStream:
            return BoundedStream(one_part(), room=room, media_type="a/b", headers={})

        answer = asyncio.ensure_future(reader.ask(stream(), "a"))
        await reader.waits.wait()
        with pytest.raises(Busy):
            await Reader().ask(stream(), "a")
        reader.goes_on.set()
        await answer
        await asyncio.sleep(0)
        await Reader().ask(stream(), "a")

    asyncio.run(work())


def test_a_zip_that_nobody_reads_holds_no_whole_file(path: Path) -> None:
    zipped = zip_stream([("depth/1.png", path)], path.parent)
    assert len(next(zipped)) < len(LARGE) / 10
    assert len(b"".join(zipped)) > len(LARGE) * 9 / 10


def test_the_system_takes_little_that_is_not_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise whoever reads slowly is taken for somebody who does not read."""
    unsent: list[int] = []
    made = HttpConnection.connection_made

    def watched(self: HttpConnection, transport: asyncio.Transport) -> None:
        accepted = transport.get_extra_info("socket")
        unsent.append(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT))
        made(self, transport)

    monkeypatch.setattr(HttpConnection, "connection_made", watched)
    with limited_server(Response(b"x"), ConnectionLimits()) as port:
        request = b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"
        assert heard(connect(port, request)).endswith(b"x")
    assert unsent == [UNSENT_BYTES]
