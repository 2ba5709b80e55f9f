from __future__ import annotations

import errno
import logging
import threading
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from patience import PATIENCE_S
from peaking.datasets import open_recording
from peaking.mpi_file import decode
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.devices import Devices
from peaking.server.open_session import OpenSession
from peaking.server.openapi import OPERATIONS
from peaking.server.recordings import PlayedRecording
from peaking.server.sessions import SessionStore

SESSION = f"/api/v1/sessions/{SESSION_ID}"
DESK = Path(__file__).parents[2] / "scenes" / "desk"


def capture_path(number: int) -> str:
    return f"{SESSION}/captures/{capture_id(number)}"


def client_of(root: Path, *, paired: bool = True, **config: Any) -> TestClient:
    """Return a client of a server: that of a paired device, or of a server for loopback alone."""
    pages = root / "client"
    pages.mkdir(parents=True, exist_ok=True)
    for name in ("index", "check", "devices", "sessions", "view"):
        (pages / f"{name}.html").write_text(f"<p>{name}</p>")
    store = SessionStore(root / "sessions")
    devices = Devices(store.root) if paired else None
    app = create_app(store=store, config=ServerOptions(devices=devices, client_dir=pages, **config))
    headers = {} if devices is None else {"Authorization": f"Bearer {credential_of(devices)}"}
    return TestClient(
        app, base_url="http://localhost", headers=headers, raise_server_exceptions=False
    )


def credential_of(devices: Devices) -> str:
    """Pair a device, and return its credential."""
    code = devices.codes.give(devices.usual)
    paired = devices.pair(code, device=str(uuid4()), name="test")
    assert paired
    return paired[1]


@pytest.fixture
def client(tmp_path: Path) -> Generator[TestClient, None, None]:
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        yield client


def wait_until_made(client: TestClient, number: int) -> dict[str, Any]:
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        captures = client.get(SESSION).json()["captures"]
        (capture,) = [c for c in captures if c["id"] == capture_id(number)]
        if capture["state"] != "queued":
            return capture
        time.sleep(0.05)
    raise AssertionError("the MPI was not made")


def test_a_capture_becomes_an_mpi(client: TestClient) -> None:
    first = client.put(capture_path(1), content=upload(1))
    assert (first.status_code, first.json()["state"]) == (201, "queued")
    again = client.put(capture_path(1), content=upload(1))
    assert (again.status_code, again.json()["number"]) == (200, 1)
    made = wait_until_made(client, 1)
    assert made["state"] == "ready", made["problem"]
    answer = client.get(f"{capture_path(1)}/mpi")
    assert len(answer.content) == made["mpi_bytes"]
    assert "immutable" in answer.headers["cache-control"]
    assert len(decode(answer.content).plane_depths_m) == 32
    assert client.get(f"{capture_path(1)}/photo").content == photo(1)
    assert client.get(f"{capture_path(1)}/thumbnail").content[:2] == b"\xff\xd8"


def test_without_depth_it_is_kept_and_said(client: TestClient, tmp_path: Path) -> None:
    from capture_uploads import body_of, header

    body = body_of(header(1, depth=None), photo(1))
    assert client.put(capture_path(1), content=body).status_code == 201
    made = wait_until_made(client, 1)
    assert made["state"] == "failed"
    assert "depth" in made["problem"]
    assert client.get(f"{capture_path(1)}/mpi").status_code == 404


def test_an_undo(client: TestClient) -> None:
    client.put(capture_path(1), content=upload(1))
    assert client.delete(capture_path(1)).json()["removed"]
    assert client.delete(capture_path(1)).json()["removed"]
    late = client.put(capture_path(1), content=upload(1))
    assert (late.status_code, late.json()["removed"]) == (200, True)
    assert client.delete(capture_path(2)).status_code == 404


def test_the_session_can_be_named_and_taken_home(client: TestClient) -> None:
    client.put(capture_path(1), content=upload(1))
    change = client.patch(SESSION, json={"name": "Küche", "finished": True})
    assert (change.json()["name"], change.json()["finished"]) == ("Küche", True)
    answer = client.get(f"{SESSION}/dataset.zip")
    assert answer.content[:2] == b"PK"
    assert client.get("/api/v1/sessions").json()[0]["captures"] == 1


def test_a_session_is_listed_while_there_is_anything_in_it(client: TestClient) -> None:
    def listed() -> list[dict[str, Any]]:
        return client.get("/api/v1/sessions").json()

    assert listed() == []
    assert client.get(SESSION).status_code == 200  # it is there, and may be added to
    for number in range(1, 7):
        client.put(capture_path(number), content=upload(number))
    (summary,) = listed()
    assert summary["thumbnails"] == [capture_id(number) for number in (1, 3, 4, 6)]
    for number in range(2, 7):
        client.delete(capture_path(number))
    (summary,) = listed()
    assert (summary["captures"], summary["restorable"]) == (1, 5)
    assert summary["thumbnails"] == [capture_id(1)]
    client.delete(capture_path(1))
    (summary,) = listed()  # all were taken back, and can be brought back
    assert (summary["captures"], summary["restorable"], summary["thumbnails"]) == (0, 6, [])
    client.patch(SESSION, json={"finished": True})
    assert listed() == []
    client.put(capture_path(7), content=upload(7))
    assert len(listed()) == 1
    wait_until_made(client, 7)


def test_peaked_shares_are_kept(client: TestClient) -> None:
    pose = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
    shares = {"peaked_share": 0.2, "wrong_share": 0.1, "unseen_share": 0.1, "unfixable_share": 0.05}
    told = {"samples": [{"time_s": 1.0, "views": 1, "world_from_cam": pose} | shares]}
    for batch in ("batch-01", "batch-01", "batch-02"):  # whatever is sent again is kept once
        assert client.put(f"{SESSION}/peaked/{batch}", json=told).status_code == 204
    assert len(client.get(f"{SESSION}/peaked").json()["samples"]) == 1
    kept = client.get(f"{SESSION}/peaked").json()["samples"][0]
    assert {name: kept[name] for name in shares} == shares
    assert client.get(SESSION).json()["summary"]["peaked_share"] == 0.2


def test_a_recording_is_played(tmp_path: Path) -> None:
    desk = PlayedRecording("desk", open_recording(DESK))
    with client_of(tmp_path, recordings={"desk": desk}) as client:
        index = client.get("/api/v1/recordings/desk").json()
        assert len(index["frames"]) == 150
        frame = "/api/v1/recordings/desk/frames/3"
        assert client.get(f"{frame}/photo").content[:2] == b"\xff\xd8"
        layout = index["frames"][3]["depth"]
        size = 2 * layout["width_px"] * layout["height_px"]
        assert len(client.get(f"{frame}/depth").content) == size
        for missing in ("desk/frames/150/photo", "desk/frames/-1/photo", "chair", "..%2f..%2fetc"):
            assert client.get(f"/api/v1/recordings/{missing}").status_code == 404


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/v1/sessions/no-such-session", 404),
        ("GET", "/api/v1/sessions/..%2f..%2fetc", 404),
        ("GET", "/api/v1/sessions/%2e%2e", 404),
        ("GET", f"{SESSION}/captures/..%2f..%2flog.jsonl/photo", 404),
        ("GET", f"{capture_path(9)}/photo", 404),
        ("GET", "/../../../../etc/passwd", 404),
        ("GET", "/%2e%2e/%2e%2e/etc/passwd", 404),
        ("GET", "/api/v1/nothing", 404),
        ("POST", SESSION, 405),
    ],
)
def test_what_is_not_there(client: TestClient, method: str, path: str, status: int) -> None:
    answer = client.request(method, path)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert set(answer.json()) == {"type", "title", "status", "detail"}
    assert answer.json()["status"] == status
    assert answer.json()["type"] == "about:blank"


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"null",
        b"[]",
        b"{}",
        b'{"name": 3}',
        b"\xff\xfe",
        b'{"protocol":3,"name":"","source":"virtual"}',
        b'{"protocol":1,"name":"x","source":"virtual"}',
        b'{"protocol":9,"name":"x","source":"virtual"}',
        b'{"protocol":3,"name":"x","source":"spy"}',
        b'{"protocol":3,"name":"x","source":"virtual","admin":true}',
        b'{"id":"abcdefgh","protocol":3,"name":"x","source":"virtual"}',
        b"[" * 100_000,
    ],
)
def test_wrong_json_begins_nothing(client: TestClient, tmp_path: Path, body: bytes) -> None:
    answer = client.put("/api/v1/sessions/abcdefgh", content=body)
    assert 400 <= answer.status_code < 500
    assert answer.json()["type"] in ("urn:peaking:problem:invalid", "urn:peaking:problem:protocol")
    assert answer.json()["detail"]
    assert len(list((tmp_path / "sessions").glob("[!.]*"))) == 1


def test_too_much_is_refused_while_it_comes(tmp_path: Path) -> None:
    with client_of(tmp_path, max_upload_bytes=10_000) as client:
        client.put(SESSION, json=new_session())
        assert client.put(capture_path(1), content=b"x" * 10_001).status_code == 413
        endless = (b"x" * 1000 for _ in range(1000))
        assert client.put(capture_path(1), content=endless).status_code == 413
        assert client.get(SESSION).json()["captures"] == []
        assert not list((tmp_path / "sessions").glob("*/images/*"))


def test_a_full_disk_is_507(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("peaking.server.open_session.write_new", full)
        answer = client.put(capture_path(1), content=upload(1))
    assert answer.status_code == 507
    assert answer.json()["type"] == "urn:peaking:problem:disk-full"
    assert "phone holds the capture" in answer.json()["detail"]
    assert client.get(SESSION).json()["captures"] == []
    assert client.put(capture_path(1), content=upload(1)).status_code == 201


def test_what_breaks_inside_says_nothing_of_the_inside(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise RuntimeError("secret path /home/someone")

    monkeypatch.setattr(OpenSession, "store_capture", broken)
    answer = client.put(capture_path(1), content=upload(1))
    assert answer.status_code == 500
    assert "secret" not in answer.text


@pytest.fixture(scope="module")
def refusing(tmp_path_factory: pytest.TempPathFactory) -> Generator[TestClient, None, None]:
    """A client without a credential, of a server with a session; refused, it changes nothing."""
    with client_of(tmp_path_factory.mktemp("refusing")) as client:
        client.put(SESSION, json=new_session())
        client.headers.pop("authorization")
        yield client


@pytest.mark.parametrize(
    "operation",
    [o for o in OPERATIONS if o.needs != "nothing"],
    ids=lambda o: f"{o.method} {o.path}",
)
@pytest.mark.parametrize("sent", [None, "Bearer wrong", "Bearer ", "Basic eDp5", "Bearer \xff"])
def test_without_a_credential_there_is_nothing(
    refusing: TestClient, operation: Any, sent: str | None
) -> None:
    path = operation.path.replace("{session}", SESSION_ID).replace("{capture}", capture_id(1))
    path = path.replace("{recording}", "desk").replace("{index}", "0")
    headers: dict[bytes, bytes] = {} if sent is None else {b"Authorization": sent.encode("latin-1")}
    answer = refusing.request(operation.method, path, headers=headers, content=b"{}")
    assert answer.status_code == 401
    assert answer.json() == {
        "type": "urn:peaking:problem:not-paired",
        "title": "This device is not paired",
        "status": 401,
        "detail": "Pair this device first: open the link that the server printed.",
    }


def test_another_page_may_not_change_anything(client: TestClient) -> None:
    evil = {"Origin": "https://evil.example"}
    assert client.patch(SESSION, json={"name": "x"}, headers=evil).status_code == 403
    own = {"Origin": "http://localhost"}
    assert client.patch(SESSION, json={"name": "x"}, headers=own).status_code == 200


def test_without_a_token_only_loopback_is_answered(tmp_path: Path) -> None:
    with client_of(tmp_path, paired=False) as client:
        assert client.get("/api/v1/server").status_code == 200
        for host in ("evil.example", "192.168.1.5", "localhost.evil.example", ""):
            answer = client.get("/api/v1/server", headers={"Host": host})
            assert answer.status_code == 403, host
            assert client.get("/", headers={"Host": host}).status_code == 403


def test_pages_need_no_token_and_carry_a_policy(client: TestClient) -> None:
    client.headers.pop("authorization")
    for path, name in (
        ("/", "index"),
        ("/check", "check"),
        ("/sessions", "sessions"),
        ("/view", "view"),
    ):
        answer = client.get(path)
        assert answer.text == f"<p>{name}</p>"
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"


def test_only_the_built_client_is_served(client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "client" / "link.txt").symlink_to(tmp_path / "secret.txt")
    for path in ("/../secret.txt", "/%2e%2e/secret.txt", "/link.txt", "/..%5csecret.txt"):
        assert client.get(path).status_code == 404, path


def test_no_secret_is_in_a_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    devices = Devices(tmp_path / "sessions")
    code = devices.codes.give(devices.usual)
    config = ServerOptions(devices=devices, client_dir=tmp_path)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    with caplog.at_level(logging.DEBUG), TestClient(app, base_url="http://localhost") as client:
        asked = {"protocol": wire.PROTOCOL, "code": code, "device": str(uuid4())}
        credential = client.post("/api/v1/pair", json=asked).json()["credential"]
        client.post("/api/v1/pair", json={**asked, "device": str(uuid4())})
        client.headers["authorization"] = f"Bearer {credential}"
        client.get("/api/v1/sessions/nothing-like-that")
        client.put(SESSION, content=b"{")
    heard = capfd.readouterr()
    # The test's own HTTP client may log what it sends; the server may not.
    served = [
        r.getMessage() for r in caplog.records if not r.name.startswith(("httpx", "httpcore"))
    ]
    for secret in (code, credential):
        assert not any(secret in text for text in (*served, heard.out, heard.err))


def test_without_a_built_client_it_is_said(tmp_path: Path) -> None:
    config = ServerOptions(devices=None, client_dir=tmp_path / "nothing")
    app = create_app(store=SessionStore(tmp_path / "s"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        answer = client.get("/")
    assert (answer.status_code, "make client" in answer.text) == (503, True)


def test_news_begin_with_the_whole_state_and_go_on(tmp_path: Path) -> None:
    import asyncio

    from peaking.server.events import Hub

    async def listen() -> list[bytes]:
        hub = Hub()
        summary = wire.SessionSummary(
            "abcdefgh", "x", "f", "other", "", 0.0, False, 0, 0, None, False
        )
        state = wire.SessionState(wire.Session(summary, []))
        watching = hub.stream("abcdefgh", lambda: state)
        await anext(watching)
        assert not hub.is_live("abcdefgh")
        stream = hub.stream("abcdefgh", lambda: state, live=True)
        heard = [await anext(stream)]
        assert hub.is_live("abcdefgh")
        thread = threading.Thread(target=lambda: hub.send("abcdefgh", wire.SessionChanged(summary)))
        thread.start()
        heard.append(await asyncio.wait_for(anext(stream), PATIENCE_S))
        hub.send("another-one", wire.SessionChanged(summary))
        hub.close()
        heard += [message async for message in stream]
        await watching.aclose()
        assert not hub.is_live("abcdefgh")
        return heard

    first, second = asyncio.run(listen())
    assert b'"type":"SessionState"' in first
    assert b'"type":"SessionChanged"' in second


def test_a_listener_that_is_too_slow_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    import asyncio

    from peaking.server import events

    monkeypatch.setattr(events, "WAITING_BYTES", 1000)

    async def listen() -> int:
        hub = events.Hub()
        summary = wire.SessionSummary(
            "abcdefgh", "x", "f", "other", "", 0.0, False, 0, 0, None, False
        )
        stream = hub.stream("abcdefgh", lambda: wire.SessionChanged(summary))
        await anext(stream)
        for _ in range(50):
            hub.send("abcdefgh", wire.SessionChanged(summary))
        await asyncio.sleep(0.05)
        return len([message async for message in stream])

    assert asyncio.run(listen()) <= 3


def test_the_four_endings_of_a_photo(client: TestClient) -> None:
    for number in (1, 2, 3):
        client.put(capture_path(number), content=upload(number))

    def end(number: int, ending: str | None) -> dict[str, Any]:
        return client.patch(capture_path(number), json={"ending": ending}).json()

    assert end(1, "undone")["restorable"]
    assert client.get(capture_path(1) + "/photo").status_code == 404
    assert client.get(capture_path(1) + "/thumbnail").status_code == 404
    assert client.get(capture_path(1) + "/mpi").status_code == 404
    assert not end(1, None)["removed"]
    assert client.get(capture_path(1) + "/photo").content == photo(1)
    assert end(2, "set_aside")["ending"] == "set_aside"
    assert client.get(capture_path(2) + "/photo").status_code == 200
    assert not end(3, "erased")["restorable"]
    refused = client.patch(capture_path(3), json={"ending": None})
    assert (refused.status_code, "erased" in refused.json()["detail"]) == (409, True)
    assert client.patch(capture_path(1), json={"ending": "lost"}).status_code == 422

    gone = client.patch(SESSION, json={"deleted": True}).json()
    assert gone["deleted_s"] > 0
    assert client.get("/api/v1/sessions").json() == []
    assert client.get(SESSION).json()["summary"]["deleted_s"] > 0
    for answer in (
        client.put(SESSION, json=new_session()),
        client.put(capture_path(4), content=upload(4)),
        client.get(capture_path(1) + "/photo"),
        client.get(SESSION + "/dataset.zip"),
        client.get(SESSION + "/events"),
    ):
        assert (answer.status_code, answer.json()["type"]) == (410, "urn:peaking:problem:deleted")
    assert client.patch(SESSION, json={"deleted": False}).json()["deleted_s"] is None
    assert client.get(capture_path(1) + "/photo").content == photo(1)

    assert client.delete(SESSION).status_code == 204
    assert client.delete(SESSION).status_code == 204
    for answer in (
        client.put(SESSION, json=new_session()),
        client.put(capture_path(4), content=upload(4)),
        client.patch(SESSION, json={"deleted": False}),
    ):
        assert (answer.status_code, answer.json()["type"]) == (410, "urn:peaking:problem:erased")


@pytest.mark.parametrize("paired", [False, True])
def test_no_request_makes_the_server_fail(tmp_path: Path, paired: bool) -> None:
    with client_of(tmp_path, paired=paired) as client:
        client.put(SESSION, json=new_session())
        client.put(capture_path(1), content=upload(1))
        asked = [
            ("GET", "/api/v1/sessions%0A", {}),
            ("GET", f"{SESSION}/events%0A", {}),
            ("GET", f"{capture_path(1)}/mpi/{'9' * 5000}", {}),
            ("GET", f"{capture_path(1)}/mpi/-1", {}),
            ("PUT", SESSION, {"Origin": "http://["}),
        ]
        for method, path, headers in asked:
            assert client.request(method, path, headers=headers).status_code in (403, 404), path


def test_what_was_deleted_long_ago_is_erased_while_the_server_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("peaking.server.app.ERASED_EVERY_S", 0.01)
    monkeypatch.setattr("peaking.server.sessions.RESTORABLE_S", -1.0)
    with client_of(tmp_path) as client:
        client.put(SESSION, json=new_session())
        client.put(capture_path(1), content=upload(1))
        client.patch(SESSION, json={"deleted": True})
        while client.get(SESSION).json().get("type") != "urn:peaking:problem:erased":
            time.sleep(0.01)
    assert not list(tmp_path.rglob("*.jpg"))


def test_browsers_ask_each_time_for_what_may_be_taken_back(client: TestClient) -> None:
    client.put(capture_path(1), content=upload(1))
    for what in ("photo", "thumbnail"):
        path = f"{capture_path(1)}/{what}"
        first = client.get(path)
        assert first.headers["cache-control"] == "private, no-cache"
        asked = {"If-None-Match": first.headers["etag"]}
        again = client.get(path, headers=asked)
        assert (again.status_code, again.content) == (304, b"")
    client.delete(capture_path(1))
    for what in ("photo", "thumbnail"):
        assert client.get(f"{capture_path(1)}/{what}").status_code == 404
