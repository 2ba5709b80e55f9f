"""A real server whose disk is really full; `full_disks.py` says how."""

from __future__ import annotations

import http.client
import json
import shutil
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from full_disks import FullDisk, SmallDisk, SmallFiles, small_disk
from live_server import LiveServer
from patience import PATIENCE_S
from peaking.server.sessions import SessionStore

SESSION = f"/api/v1/sessions/{SESSION_ID}"
MAX_PAGES = 40
"""Free pages that are tried: more than a capture, its MPI, transforms.json and folders take."""


class Client:
    """Talks to the server as a phone does."""

    def __init__(self, server: LiveServer) -> None:
        self._connection = http.client.HTTPConnection("localhost", server.port, timeout=PATIENCE_S)

    def ask(self, method: str, path: str, body: bytes | dict[str, Any] = b"") -> tuple[int, Any]:
        sent = json.dumps(body) if isinstance(body, dict) else body
        self._connection.request(method, path, sent)
        answer = self._connection.getresponse()
        data = answer.read()
        is_json = answer.headers.get("content-type", "").endswith("json")
        return answer.status, json.loads(data) if is_json else data

    def send(self, number: int) -> tuple[int, Any]:
        return self.ask("PUT", f"{SESSION}/captures/{capture_id(number)}", upload(number))

    def captures(self) -> list[dict[str, Any]]:
        status, session = self.ask("GET", SESSION)
        assert status == 200
        return session["captures"]

    def wait_until_ready(self, numbers: list[int]) -> None:
        until_s = time.monotonic() + PATIENCE_S
        wanted = [(capture_id(number), "ready") for number in numbers]
        while [(c["id"], c["state"]) for c in self.captures()] != wanted:
            assert time.monotonic() < until_s, self.captures()
            time.sleep(0.05)

    def close(self) -> None:
        self._connection.close()


@pytest.fixture(params=["small disk", "small files"])
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> FullDisk:
    return small_disk(tmp_path) if request.param == "small disk" else SmallFiles()


@pytest.fixture
def server(disk: FullDisk, tmp_path: Path) -> Generator[LiveServer, None, None]:
    sessions = tmp_path / "sessions"
    server = LiveServer(sessions, wrapped_in=disk.wrap(sessions)).start()
    yield server
    server.stop()


@pytest.fixture
def client(server: LiveServer) -> Generator[Client, None, None]:
    client = Client(server)
    assert client.ask("PUT", SESSION, new_session())[0] == 201
    yield client
    client.close()


def files_of(folder: Path) -> dict[str, bytes]:
    """Return all files of the sessions but what fills the disk."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "filler"
    }


def test_a_capture_is_refused_and_nothing_of_it_is_kept(
    disk: FullDisk, server: LiveServer, client: Client
) -> None:
    assert client.send(1)[0] == 201
    client.wait_until_ready([1])
    before = settled(lambda: files_of(disk.sessions(server)))

    disk.fill(server)
    status, answer = client.send(2)
    assert status == 507
    assert "phone holds the capture" in answer["detail"]
    assert files_of(disk.sessions(server)) == before
    assert [c["id"] for c in client.captures()] == [capture_id(1)]
    assert client.ask("GET", f"{SESSION}/captures/{capture_id(1)}/photo") == (200, photo(1))

    disk.free(server)
    assert client.send(2)[0] == 201
    client.wait_until_ready([1, 2])
    check_that_it_opens(disk, server, [1, 2])


@pytest.mark.parametrize("disk", ["small disk"], indirect=True)
def test_a_session_is_not_begun_by_halves(
    disk: FullDisk, server: LiveServer, client: Client
) -> None:
    before = settled(lambda: files_of(disk.sessions(server)))
    folders = sorted(disk.sessions(server).iterdir())
    other = "/api/v1/sessions/5e551011-0000-4000-8000-000000000002"
    disk.fill(server)
    for _ in range(3):
        status, answer = client.ask("PUT", other, new_session())
        assert (status, "disk is full" in answer["detail"]) == (507, True)
    disk.free(server)
    assert sorted(disk.sessions(server).iterdir()) == folders
    assert files_of(disk.sessions(server)) == before
    assert client.ask("PUT", other, new_session())[0] == 201
    assert client.ask("GET", other)[0] == client.ask("GET", SESSION)[0] == 200


@pytest.mark.parametrize("disk", ["small disk"], indirect=True)
def test_whatever_room_there_is_what_is_acknowledged_is_there(
    disk: FullDisk, server: LiveServer, client: Client
) -> None:
    """From no free page to enough for all: each write of a capture is once the one that fails."""
    assert isinstance(disk, SmallDisk)
    kept: list[int] = []
    refused = 0
    for pages in range(MAX_PAGES):
        disk.fill(server, free_pages=pages)
        status, _ = client.send(pages)
        assert status in (201, 507)
        kept += [pages] if status == 201 else []
        refused += status == 507
        if kept:
            # None of these may break the server, whether there is room for them or not.
            batch = f"{SESSION}/peaked/{capture_id(pages)}"
            assert client.ask("PUT", batch, peaked(pages))[0] in (204, 507)
            assert client.ask("GET", f"{SESSION}/peaked")[0] == 200
            assert client.ask("PATCH", SESSION, {"name": "x" * 80})[0] in (200, 507)
        assert [c["id"] for c in client.captures()] == [capture_id(number) for number in kept]
        disk.free(server)
    assert refused >= 3
    assert len(kept) > MAX_PAGES / 2
    client.wait_until_ready(kept)
    check_that_it_opens(disk, server, kept)


def peaked(number: int) -> dict[str, Any]:
    """Return a second of what a phone tells, in many samples."""
    sample = {
        "time_s": 1_700_000_000.0 + number,
        "peaked_share": 0.25,
        "unseen_share": 0.125,
        "views": 1,
        "world_from_cam": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
    }
    return {"samples": [sample] * 50}


def settled(read: Callable[[], dict[str, bytes]]) -> dict[str, bytes]:
    """Wait until the server has written what may come later (transforms.json)."""
    until_s = time.monotonic() + PATIENCE_S
    before = read()
    while True:
        time.sleep(0.3)
        now = read()
        if now == before and not any(".partial" in name for name in now):
            return now
        assert time.monotonic() < until_s
        before = now


def check_that_it_opens(disk: FullDisk, server: LiveServer, numbers: list[int]) -> None:
    """Read the folder as a server that starts there does."""
    copy = server.sessions.parent / "copy"
    settled(lambda: files_of(disk.sessions(server)))
    shutil.copytree(disk.sessions(server), copy)
    (session,) = SessionStore(copy).sessions()
    assert [c.id for c in session.captures] == [capture_id(number) for number in numbers]
    for number in numbers:
        assert session.photo_path(session.capture(capture_id(number))).read_bytes() == photo(number)
        assert session.frame_of(capture_id(number)).depth_m is not None
    assert session.unfinished("layered") == []
