"""What arrives without its end is not acknowledged, so that it is sent again."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from capture_uploads import (
    SESSION_ID,
    body_of,
    capture_id,
    depth_mm,
    header,
    new_session,
    photo,
    points_m,
    upload,
)
from foreign_pictures import jpeg
from live_server import LiveServer
from patience import PATIENCE_S
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore

SESSION = f"/api/v1/sessions/{SESSION_ID}"
CAPTURE = f"{SESSION}/captures/{capture_id(1)}"

PHOTO = photo()
FIELDS = header(points=len(points_m()))
WHOLE = body_of(FIELDS, PHOTO + depth_mm().tobytes() + points_m().tobytes())
JSON_ENDS = len(body_of(FIELDS, b""))
PHOTO_ENDS = JSON_ENDS + len(PHOTO)
DEPTH_ENDS = PHOTO_ENDS + depth_mm().nbytes


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Generator[TestClient, None, None]:
    root = tmp_path_factory.mktemp("cut off")
    app = create_app(
        store=SessionStore(root / "sessions"), config=ServerOptions(devices=None, client_dir=root)
    )
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        yield client


def assert_is_to_be_sent_again(client: TestClient, body: bytes) -> None:
    answer = client.put(CAPTURE, content=body)
    assert (answer.status_code, answer.json()["type"]) == (400, "urn:peaking:problem:cut-off")
    assert client.get(SESSION).json()["captures"] == []


@pytest.mark.parametrize(
    "length",
    [
        *(0, 3, 4, 5, JSON_ENDS - 1, JSON_ENDS, JSON_ENDS + 1),
        *((JSON_ENDS + PHOTO_ENDS) // 2, PHOTO_ENDS - 1, PHOTO_ENDS, PHOTO_ENDS + 1),
        *(DEPTH_ENDS - 1, DEPTH_ENDS, DEPTH_ENDS + 1, len(WHOLE) - 1),
    ],
)
def test_a_body_without_its_end(client: TestClient, length: int) -> None:
    assert_is_to_be_sent_again(client, WHOLE[:length])


@pytest.mark.parametrize("kind", ["ordinary", "progressive"])
@pytest.mark.parametrize("at", ["start", "header", "scan", "half", "end"])
def test_a_photo_without_its_end(client: TestClient, kind: str, at: str) -> None:
    whole = jpeg(60, 128, progressive=kind == "progressive")
    scan = whole.index(b"\xff\xda")
    kept = {"start": 2, "header": 30, "scan": scan + 5, "half": (scan + len(whole)) // 2}
    for cut in (whole[: kept.get(at, -1)], whole[: kept.get(at, -2)]):
        fields = header(photo_bytes=len(cut), depth=None)
        assert_is_to_be_sent_again(client, body_of(fields, cut))
        zeros = cut + bytes(len(whole) - len(cut))  # of a disk that lost its end
        fields = header(photo_bytes=len(zeros), depth=None)
        assert_is_to_be_sent_again(client, body_of(fields, zeros))


def test_more_than_was_said_is_no_cut(client: TestClient) -> None:
    answer = client.put(CAPTURE, content=WHOLE + b"!")
    assert (answer.status_code, answer.json()["type"]) == (400, "urn:peaking:problem:invalid")


def declared(body: bytes) -> tuple[bytes, bytes]:
    return f"Content-Length: {len(body)}\r\n".encode(), body


def in_pieces(body: bytes) -> tuple[bytes, bytes]:
    return b"Transfer-Encoding: chunked\r\n", f"{len(body):x}\r\n".encode() + body + b"\r\n"


@pytest.mark.parametrize("sent_as", [declared, in_pieces])
def test_a_connection_that_breaks(
    tmp_path: Path, sent_as: Callable[[bytes], tuple[bytes, bytes]]
) -> None:
    server = LiveServer(tmp_path / "sessions").start()
    try:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE_S)

        def ask(method: str, address: str, body: bytes | None = None) -> tuple[int, dict[str, Any]]:
            connection.request(method, address, body, {"Host": "localhost"})
            answer = connection.getresponse()
            return answer.status, json.loads(answer.read())

        assert ask("PUT", SESSION, json.dumps(new_session()).encode())[0] == 201
        length, sent = sent_as(upload(1))
        for end in (len(sent) // 3, len(sent) - 1 if sent_as is declared else len(sent)):
            with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE_S) as broken:
                head = f"PUT {CAPTURE} HTTP/1.1\r\nHost: localhost\r\n".encode() + length
                broken.sendall(head + b"\r\n" + sent[:end])
                broken.shutdown(socket.SHUT_WR)
                while broken.recv(1000):
                    pass  # until the server has hung up
        assert ask("GET", SESSION)[1]["captures"] == []
        assert ask("PUT", CAPTURE, upload(1))[0] == 201
        connection.close()
    finally:
        server.stop()
