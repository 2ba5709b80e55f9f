"""Bodies are bounded all together, and a place in the queue is taken before one is read."""

from __future__ import annotations

import contextlib
import http.client
import json
import select
import threading
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from test_app import SESSION, capture_path, client_of, credential_of

from capture_uploads import SESSION_ID, capture_id, new_session, upload
from limited_server import connect, heard, limited_server
from patience import PATIENCE_S
from peaking.server.app import ServerOptions, create_app
from peaking.server.bodies import UPLOADS_AT_ONCE
from peaking.server.connections import ConnectionLimits
from peaking.server.devices import Devices
from peaking.server.fair_room import Busy
from peaking.server.generation import GenerationQueue
from peaking.server.sessions import SessionStore

LARGEST = 1_000_000
SHOWN = {"credential": ""}
"""Of the device that is paired with the server of the running test."""


@pytest.fixture
def port(tmp_path: Path) -> Generator[int, None, None]:
    devices = Devices(tmp_path / "sessions")
    SHOWN["credential"] = credential_of(devices)
    config = ServerOptions(devices=devices, client_dir=tmp_path, max_upload_bytes=LARGEST)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    with limited_server(app, ConnectionLimits()) as port:
        assert asked(port, "PUT", SESSION, json.dumps(new_session()).encode())[0] == 201
        yield port


def asked(port: int, method: str, path: str, body: bytes | Iterator[bytes]) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
    with contextlib.closing(connection):
        connection.request(
            method, path, body, headers={"Authorization": f"Bearer {SHOWN['credential']}"}
        )
        answer = connection.getresponse()
        return answer.status, answer.read()


def half_sent(path: str, length: str) -> bytes:
    shown = f"Authorization: Bearer {SHOWN['credential']}"
    head = f"PUT {path} HTTP/1.1\r\nHost: x\r\n{shown}\r\n{length}\r\n\r\n"
    return head.encode()


@pytest.mark.parametrize("chunked", [False, True])
def test_half_sent_uploads_are_bounded_and_give_their_room_back(port: int, chunked: bool) -> None:
    length = "Transfer-Encoding: chunked" if chunked else f"Content-Length: {LARGEST}"
    begin = f"{LARGEST - 1:x}\r\n".encode() if chunked else b""
    half = [
        connect(port, half_sent(capture_path(n), length) + begin + b"x" * (LARGEST - 10))
        for n in range(2, 2 + 2 * UPLOADS_AT_ONCE)
    ]
    unanswered = list(half)
    while len(unanswered) > UPLOADS_AT_ONCE:
        answered, _, _ = select.select(unanswered, [], [], PATIENCE_S)
        assert [connection.recv(12) for connection in answered] == [b"HTTP/1.1 503"] * len(answered)
        assert answered
        unanswered = [connection for connection in unanswered if connection not in answered]
    for connection in half:
        connection.close()
    for number in range(20, 40):  # the room comes back, and with it the places
        while (status := asked(port, "PUT", capture_path(number), upload(1))[0]) == 503:
            pass
        assert status == 201


def test_what_is_there_already_is_not_read_again(port: int) -> None:
    assert asked(port, "PUT", capture_path(1), upload(1))[0] == 201
    again = connect(port, half_sent(capture_path(1), "Content-Length: 500000"))
    answer = again.recv(12)
    again.close()
    assert answer == b"HTTP/1.1 200"


def test_strangers_take_no_room(port: int) -> None:
    strange = half_sent(capture_path(1), f"Content-Length: {LARGEST}").replace(
        b"Authorization: ", b"X-Nothing: "
    )
    strangers = [connect(port, strange + b"x" * 1000) for _ in range(20)]
    assert [c.recv(12) for c in strangers] == [b"HTTP/1.1 401"] * 20
    assert asked(port, "PUT", capture_path(1), upload(1))[0] == 201
    for connection in strangers:
        connection.close()


def test_a_full_queue_is_said_before_the_body_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise Busy(5)

    def read(*_: object) -> None:
        raise AssertionError("the body was read")

    monkeypatch.setattr(GenerationQueue, "reserve", full)
    monkeypatch.setattr("peaking.server.app.read_body", read)
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        answer = client.put(capture_path(1), content=upload(1))
        assert client.get(SESSION).json()["captures"] == []
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    assert answer.json()["type"] == "urn:peaking:problem:busy"


@pytest.mark.parametrize("body", [b"nonsense", upload(1)[:-10], upload(1)])
def test_places_are_given_back_on_every_way_out(tmp_path: Path, body: bytes) -> None:
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        for _ in range(100):  # a session has 51 places
            assert client.put(capture_path(1), content=body).status_code != 503


def test_one_session_that_floods_has_few_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()

    def wait(_: GenerationQueue) -> None:
        goes_on.wait(PATIENCE_S)

    monkeypatch.setattr(GenerationQueue, "_work", wait)
    other = SESSION.replace(SESSION_ID, "5e551011-0000-4000-8000-000000000002")
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        client.put(other, json=new_session())
        statuses = [client.put(capture_path(n), content=upload(1)).status_code for n in range(60)]
        assert statuses == [201] * 51 + [503] * 9
        late = client.put(f"{other}/captures/{capture_id(1)}", content=upload(1))
        assert late.status_code == 201
        goes_on.set()


def test_hanging_up_is_no_fault_of_the_server(port: int, caplog: pytest.LogCaptureFixture) -> None:
    path = capture_path(3)
    connect(port, half_sent(path, "Content-Length: 500000") + b"x" * 1000).close()
    slow = connect(port, half_sent(path, "Content-Length: 50") + b"x" * 50)
    assert slow.recv(12) == b"HTTP/1.1 400"
    slow.close()
    assert heard(connect(port, b"\r\n\r\nHELLO\r\n\r\n")).startswith(b"HTTP/1.1 400")
    assert caplog.text == ""
