"""Strangers have little time and a room of their own; whoever is paired stays served."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import math
import socket
import ssl
import threading
from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from limited_server import connect, heard, limited_server
from patience import PATIENCE_S
from peaking.server.certificates import open_authority
from peaking.server.connections import (
    Connection,
    ConnectionLimits,
    Connections,
    Phase,
    limits_of_files,
)
from peaking.server.http_connection import (
    MAX_HEAD_BYTES,
    MAX_HEADERS,
    MAX_URL_BYTES,
    MAX_WAITING_REQUESTS,
)
from peaking.server.requests import mark_paired
from peaking.server.responses import event_stream
from peaking.server.server_certificate import ServerCertificate

FOR_EVER = math.inf
PATIENT = ConnectionLimits(
    opening_s=FOR_EVER,
    request_s=FOR_EVER,
    stranger_idle_s=FOR_EVER,
    paired_idle_s=FOR_EVER,
    body_grace_s=FOR_EVER,
    unread_s=FOR_EVER,
)
LIMITS = ConnectionLimits(strangers=3, paired=4)


@dataclass
class Held:
    """Connections without a network."""

    connections: Connections = field(default_factory=lambda: Connections(LIMITS))
    ended: list[tuple[str, Phase | None]] = field(default_factory=list[tuple[str, Phase | None]])

    def came(self, name: str, address: str = "a", phase: Phase = "head") -> Connection:
        def end(waited_for: Phase | None) -> None:
            self.ended.append((name, waited_for))
            self.connections.remove(connection)

        connection = Connection(address, end, 0.0, phase)
        self.connections.admit(connection)
        return connection


def test_the_oldest_of_whoever_has_most_goes() -> None:
    held = Held()
    held.came("a1", "a")
    held.came("b1", "b")
    held.came("a2", "a")
    held.came("c1", "c")
    assert held.ended == [("a1", None)]
    assert held.connections.strangers == 3


def test_who_is_being_answered_stays() -> None:
    held = Held()
    held.came("1", phase="answer")
    for name in "234":
        held.came(name)
    assert held.ended == [("2", None)]


def test_there_is_always_room_for_one_more() -> None:
    held = Held()
    for name in "123":
        held.came(name, phase="answer")
    held.came("4", phase="answer")
    assert held.ended == [("1", None)]


def test_a_paired_connection_takes_no_room_of_strangers() -> None:
    held = Held()
    phone = held.came("phone")
    held.connections.pair(phone, None)
    for number in range(50):
        held.came(str(number))
    assert "phone" not in [name for name, _ in held.ended]
    assert (held.connections.strangers, held.connections.paired) == (3, 1)


def test_a_paired_device_takes_no_room_of_another() -> None:
    held = Held()
    one = held.came("one")
    held.connections.pair(one, "device 1")
    for number in range(20):
        held.connections.pair(held.came(str(number)), "device 2")
    assert held.connections.paired == 4
    assert [name for name, _ in held.ended] == [str(n) for n in range(17)]


def test_counts_are_those_of_the_connections() -> None:
    held = Held()
    one, two = held.came("one"), held.came("two")
    held.connections.pair(one, "device")
    held.connections.pair(one, "device")
    held.connections.remove(two)
    held.connections.remove(two)
    assert (held.connections.strangers, held.connections.paired) == (0, 1)
    assert list(held.connections) == [one]
    held.connections.remove(one)
    assert (held.connections.strangers, held.connections.paired) == (0, 0)
    held.connections.make_room()
    assert held.ended == []


@pytest.mark.parametrize(
    ("phase", "paired", "limit_s"),
    [
        ("handshake", False, LIMITS.opening_s),
        ("head", False, LIMITS.opening_s),
        ("head", True, LIMITS.opening_s),
        ("body", True, LIMITS.body_grace_s),
        ("body", False, LIMITS.body_grace_s),
        ("idle", False, LIMITS.stranger_idle_s),
        ("idle", True, LIMITS.paired_idle_s),
        ("closing", True, LIMITS.closing_s),
    ],
)
def test_time_is_over_in_time(phase: Phase, paired: bool, limit_s: float) -> None:
    held = Held()
    connection = held.came("x")
    if paired:
        held.connections.pair(connection, None)
    connection.enter(phase, 100.0)
    held.connections.sweep(100.0 + limit_s)
    assert held.ended == []
    held.connections.sweep(100.1 + limit_s)
    assert held.ended == [("x", phase)]


def test_a_body_that_comes_fast_enough_has_time() -> None:
    held = Held()
    phone, stranger = held.came("phone"), held.came("stranger")
    held.connections.pair(phone, None)
    for connection in (phone, stranger):
        connection.enter("body", 0.0)
        connection.body_bytes = 4_000_000
    held.connections.sweep(900.0)
    assert held.ended == [("stranger", "body")]
    held.connections.sweep(1021.0)
    assert held.ended[1:] == [("phone", "body")]


def test_a_body_that_we_do_not_read_is_not_slow() -> None:
    held = Held()
    phone = held.came("phone")
    held.connections.pair(phone, None)
    phone.enter("body", 0.0)
    phone.body_waits = lambda: True
    for second in range(100):
        held.connections.sweep(float(second))
    assert held.ended == []


def test_an_answer_that_is_not_taken_is_given_up() -> None:
    held = Held()
    held.came("x", phase="answer").unread_since_s = 10.0
    held.came("y", phase="answer")
    held.connections.sweep(10.0 + LIMITS.unread_s)
    assert held.ended == []
    held.connections.sweep(10.1 + LIMITS.unread_s)
    assert held.ended == [("x", "answer")]


@pytest.mark.parametrize("phase", ["head", "body", "answer", "idle"])
def test_that_is_so_whatever_else_is_waited_for(phase: Phase) -> None:
    """A request may be on its way behind the one that is answered."""
    held = Held()
    connection = held.came("x", phase=phase)
    held.connections.pair(connection, None)
    connection.body_waits = lambda: True
    connection.unread_since_s = 0.0
    for second in range(33):
        connection.enter(phase, float(second))
        held.connections.sweep(float(second))
    assert set(held.ended) == {("x", phase)}


def test_one_that_cannot_be_ended_keeps_no_other(caplog: pytest.LogCaptureFixture) -> None:
    def fails(_: object) -> None:
        raise ValueError("no")

    held = Held()
    held.connections.admit(Connection("b", fails, 0.0, "head"))
    held.came("x")
    held.connections.sweep(1000.0)
    held.connections.sweep(1001.0)
    assert held.ended == [("x", "head")]
    assert held.connections.strangers == 0
    assert "ended" in caplog.text


@pytest.mark.parametrize("files", [64, 256, 1024, 20_000, 10_000_000])
def test_connections_leave_room_for_files(files: int) -> None:
    limits = limits_of_files(files)
    assert 0 < limits.strangers < limits.paired
    assert limits.strangers + limits.paired <= files // 2 or (
        limits.strangers + limits.paired <= files - 256
    )


# Over a network


class Greeting:
    """Answers with what it was sent; whoever says `Authorization: yes` is paired."""

    def __init__(self) -> None:
        self.ranges: list[str | None] = []
        self.given_up = threading.Event()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        request = Request(scope, receive)
        self.ranges.append(request.headers.get("range"))
        if request.headers.get("authorization") == "yes":
            mark_paired(scope)
        if request.url.path == "/stream":
            await event_stream(request, self._stream())(scope, receive, send)
            return
        if request.url.path == "/early":
            await Response("no", 503)(scope, receive, send)
            return
        try:
            body = await request.body()
        except ClientDisconnect:
            self.given_up.set()
            return
        await Response(b"got " + body)(scope, receive, send)

    async def _stream(self) -> AsyncGenerator[bytes]:
        try:
            while True:
                yield b"x" * 100_000
                await asyncio.sleep(0)
        finally:
            self.given_up.set()


GREET = b"GET / HTTP/1.1\r\nHost: localhost\r\nAuthorization: yes\r\n\r\n"


def is_greeted(connection: socket.socket) -> bool:
    """Return whether the next answer on a connection is a greeting."""
    answer = b""
    while not answer.endswith(b"got ") and (part := connection.recv(1000)):
        answer += part
    return answer.startswith(b"HTTP/1.1 200")


def greets(port: int, context: ssl.SSLContext | None = None) -> bool:
    """Return whether somebody who is paired is answered."""
    kind = http.client.HTTPConnection if context is None else http.client.HTTPSConnection
    options = {} if context is None else {"context": context}
    connection = kind("localhost", port, timeout=PATIENCE_S, **options)  # pyright: ignore[reportArgumentType, reportCallIssue]
    with contextlib.closing(connection):
        connection.request("GET", "/", headers={"Authorization": "yes"})
        return connection.getresponse().read() == b"got "


def test_idle_strangers_lock_nobody_out() -> None:
    limits = replace(PATIENT, strangers=5)
    with limited_server(Greeting(), limits) as port:
        phone = connect(port, GREET)
        assert is_greeted(phone)
        idle = [connect(port) for _ in range(40)]
        assert greets(port)
        assert [heard(connection) for connection in idle[:30]] == [b""] * 30
        phone.sendall(GREET)  # it is still connected
        assert is_greeted(phone)
        for connection in (phone, *idle):
            connection.close()


def test_strangers_that_do_not_get_through_with_tls_lock_nobody_out(tmp_path: Path) -> None:
    context = ServerCertificate(open_authority(tmp_path)).context
    trusts = ssl.create_default_context(cafile=str(tmp_path / "peaking-ca.pem"))
    with limited_server(Greeting(), replace(PATIENT, strangers=5), context=context) as port:
        idle = [connect(port, b"\x16\x03\x01\x02"[: n % 5]) for n in range(40)]
        assert greets(port, trusts)
        assert [heard(connection) for connection in idle[:30]] == [b""] * 30
        assert greets(port, trusts)
        for connection in idle:
            connection.close()


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        (b"GET / HTTP/1.1\r\nHost: 192.168.1.5:8443", b"location: https://192.168.1.5:8443/\r\n"),
        (b"GET /a%20b?c=%23&d HTTP/1.1\r\nHost: [::1]:9", b"location: https://[::1]:9/a%20b?c=%23&d\r\n"),
        (b"PUT //x/ HTTP/1.1\r\nContent-Length: 5\r\nHost: a.local", b"location: https://a.local//x/\r\n"),
        (b"GET / HTTP/1.1\r\nHost: a/b@c", b"HTTP/1.1 400"),
        (b"GET / HTTP/1.1", b"HTTP/1.1 400"),
        (b"what is this?", b"HTTP/1.1 400"),
    ],
)  # fmt: skip
def test_plain_http_is_sent_on_to_https(tmp_path: Path, asked: bytes, expected: bytes) -> None:
    context = ServerCertificate(open_authority(tmp_path)).context
    trusts = ssl.create_default_context(cafile=str(tmp_path / "peaking-ca.pem"))
    greeting = Greeting()
    with limited_server(greeting, PATIENT, context=context) as port:
        for byte_by_byte in (False, True):
            connection = connect(port)
            whole = asked + b"\r\nConnection: close\r\n\r\n"
            for part in [whole[i : i + 1] for i in range(len(whole))] if byte_by_byte else [whole]:
                with contextlib.suppress(OSError):  # it was answered before all was sent
                    connection.sendall(part)
            answer = heard(connection)
            assert expected in answer
            assert (b" 307 " in answer) == (b" 400" not in expected)
        assert greeting.ranges == []  # nothing of it came to what is served
        assert greets(port, trusts)


def test_who_says_nothing_to_a_port_of_https_is_hung_up_on(tmp_path: Path) -> None:
    context = ServerCertificate(open_authority(tmp_path)).context
    limits = replace(PATIENT, opening_s=0.1)
    with limited_server(Greeting(), limits, context=context) as port:
        assert heard(connect(port)) == b""


@pytest.mark.parametrize(
    ("parts", "status"),
    [
        ([b"GET /" + b"x" * MAX_URL_BYTES + b" HTTP/1.1\r\n\r\n"], 414),
        ([b"GET /", *[b"x" * 1000] * 20], 414),
        ([b"GET / HTTP/1.1\r\nA: ", *[b"x" * 1000] * 40], 431),
        ([b"GET / HTTP/1.1\r\nA: " + b"x" * MAX_HEAD_BYTES + b"\r\n\r\n"], 431),
        ([b"GET / HTTP/1.1\r\n", *[b"x" * 1000] * 40], 431),
        ([b"GET / HTTP/1.1\r\n", b"A: b\r\n" * (MAX_HEADERS + 1), b"\r\n"], 431),
        ([b"GET / HTTP/1.1\r\n", *[b"Cookie: " + b"x" * 3000 + b"\r\n"] * 12], 431),
        ([b"\r\n" * 30_000], 431),
        ([b"\x16\x03\x01 what is this"], 400),
        ([b"GET \xff HTTP/1.1\r\n\r\n"], 400),
    ],
)
def test_what_is_too_much_is_refused_before_it_is_parsed(
    parts: Sequence[bytes], status: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with limited_server(Greeting(), PATIENT) as port:
        connection = connect(port)
        with contextlib.suppress(ConnectionError):
            for part in parts:
                connection.sendall(part)
        answer = heard(connection)
        assert greets(port)
    assert answer.startswith(b"HTTP/1.1 %d " % status) or answer == b""
    if len(parts) == 1:  # otherwise hanging up may have been faster than the answer
        assert b"application/problem+json" in answer
    assert capfd.readouterr().err == ""


CHUNKED = b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize(
    "after",
    [
        b"1\r\nx\r\n0\r\nA: " + b"x" * 1_000_000,
        b"1\r\nx\r\n0\r\n" + b"A: b\r\n" * 2 * MAX_HEADERS,
        b"1;" + b"x" * 1_000_000,
    ],
    ids=["a trailer without end", "trailers without end", "an extension without end"],
)
def test_what_follows_a_body_is_bounded_too(after: bytes) -> None:
    app = Greeting()
    with limited_server(app, PATIENT) as port:
        connection = connect(port, CHUNKED)
        with contextlib.suppress(ConnectionError):
            connection.sendall(after)
        assert b" 200 " not in heard(connection)
        assert app.given_up.wait(PATIENCE_S)


def test_requests_do_not_pile_up() -> None:
    with limited_server(Greeting(), PATIENT) as port:
        connection = connect(port, GREET * (MAX_WAITING_REQUESTS + 1))
        answers = b""
        while answers.count(b" 200 ") < MAX_WAITING_REQUESTS + 1:
            answers += connection.recv(65_536)
        connection.close()
        many = connect(port, b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\nab")
        with contextlib.suppress(ConnectionError):
            many.sendall(b"cde" + GREET * 1000)
        assert heard(many).count(b" 200 ") <= MAX_WAITING_REQUESTS + 1
        assert greets(port)


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        (b"", b""),
        (b"GET / HT", b"HTTP/1.1 408"),
        (b"GET / HTTP/1.1\r\nA: b\r\n", b"HTTP/1.1 408"),
        (b"POST / HTTP/1.1\r\nContent-Length: 10\r\n\r\nslow", b"HTTP/1.1 408"),
        (CHUNKED + b"5\r\nab", b"HTTP/1.1 408"),
        (GREET, b"HTTP/1.1 200"),
    ],
)
def test_who_takes_too_long_is_sent_away(sent: bytes, expected: bytes) -> None:
    limits = ConnectionLimits(
        opening_s=0.1, request_s=0.1, body_grace_s=0.1, stranger_idle_s=0.1, paired_idle_s=0.1
    )
    with limited_server(Greeting(), limits) as port:
        assert heard(connect(port, sent))[: len(expected) or None] == expected


def test_a_slow_body_is_given_up_inside_too() -> None:
    app = Greeting()
    with limited_server(app, replace(PATIENT, body_grace_s=0.1, request_s=0.1)) as port:
        connection = connect(port, b"POST / HTTP/1.1\r\nContent-Length: 10\r\n\r\nslow")
        assert app.given_up.wait(PATIENCE_S)
        assert b"urn:" not in heard(connection)


def test_a_stream_that_nobody_reads_ends() -> None:
    app = Greeting()
    with limited_server(app, replace(PATIENT, unread_s=0.1)) as port:
        connection = connect(port, GREET.replace(b"/ ", b"/stream ", 1))
        assert app.given_up.wait(PATIENCE_S)
        connection.close()


STREAM = GREET.replace(b"/ ", b"/stream ", 1)


def test_a_stream_ends_with_its_connection_although_requests_wait_behind_it() -> None:
    app = Greeting()
    with limited_server(app, PATIENT) as port:
        connection = connect(port, STREAM + GREET * 2)
        assert connection.recv(8) == b"HTTP/1.1"
        connection.close()
        assert app.given_up.wait(PATIENCE_S)


@pytest.mark.parametrize("after", [b"nonsense\r\n\r\n", GREET + b"nonsense\r\n\r\n", GREET * 50])
def test_no_problem_is_said_within_another_answer(after: bytes) -> None:
    app = Greeting()
    with limited_server(app, PATIENT) as port:
        connection = connect(port, STREAM)
        assert connection.recv(8) == b"HTTP/1.1"
        connection.sendall(after)
        assert b"HTTP/1.1" not in heard(connection)
        assert app.given_up.wait(PATIENCE_S)


@pytest.mark.parametrize("name", ["sweep", "admit", "make_room"])
def test_whatever_goes_wrong_once_the_server_goes_on(
    name: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    real, failed = getattr(Connections, name), threading.Event()

    def fails_once(self: Connections, *args: object) -> None:
        if not failed.is_set():
            failed.set()
            raise ValueError("no")
        real(self, *args)

    monkeypatch.setattr(Connections, name, fails_once)
    limits = replace(ConnectionLimits(), strangers=1, opening_s=0.1)
    with limited_server(Greeting(), limits) as port:
        for _ in range(3):
            connect(port).close()
        assert failed.wait(PATIENCE_S)
        assert greets(port)
        assert heard(connect(port)) == b""  # limits of time hold
    assert "ValueError" in capfd.readouterr().err


def test_an_answer_before_the_end_of_the_body_is_heard() -> None:
    """Browsers listen only when they have sent all."""
    with limited_server(Greeting(), PATIENT) as port:
        connection = http.client.HTTPConnection("localhost", port, timeout=PATIENCE_S)
        for _ in range(2):  # and the connection goes on
            connection.request("POST", "/early", body=b"x" * 5_000_000)
            answer = connection.getresponse()
            assert (answer.status, answer.read()) == (503, b"no")
        connection.close()


def test_ranges_are_not_passed_on() -> None:
    app = Greeting()
    with limited_server(app, PATIENT) as port:
        connection = connect(port, GREET.replace(b"\r\n", b"\r\nRange: bytes=0-1\r\n", 1))
        assert is_greeted(connection)
        connection.close()
    assert app.ranges == [None]


def test_it_ends_although_streams_are_not_read(capfd: pytest.CaptureFixture[str]) -> None:
    stream = GREET.replace(b"/ ", b"/stream ", 1)
    with limited_server(Greeting(), PATIENT) as port:
        listening = [connect(port, stream) for _ in range(50)]
        assert [c.recv(8, socket.MSG_WAITALL) for c in listening] == [b"HTTP/1.1"] * 50
    for connection in listening:
        connection.close()
    assert capfd.readouterr().err == ""
