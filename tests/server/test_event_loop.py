"""No flush, no file and no lock is waited for on the event loop's thread, whatever is asked."""

from __future__ import annotations

import builtins
import contextlib
import http.client
import json
import os
import sys
import threading
import zlib
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from capture_uploads import SESSION_ID, capture_id, new_session, upload
from limited_server import limited_server
from patience import PATIENCE_S
from peaking.datasets import open_recording
from peaking.server.app import ServerOptions, create_app
from peaking.server.connections import ConnectionLimits
from peaking.server.devices import Devices
from peaking.server.openapi import OPERATIONS
from peaking.server.pairing_codes import CONSOLE as CONSOLE_GRANT
from peaking.server.recordings import PlayedRecording
from peaking.server.sessions import SessionStore
from peaking.server.study.app import StudyServerOptions, create_study_app
from peaking.server.study.open_study import OpenStudy
from peaking.server.study.openapi import STUDY_OPERATIONS
from peaking.server.wire import PROTOCOL
from peaking.study.protocol import FILE_NAME
from server.test_app import credential_of
from study.test_protocol import SMALL

DESK = Path(__file__).parents[2] / "scenes" / "desk"
FILE_CALLS = [
    *("stat", "lstat", "open", "fsync", "fdatasync", "rename", "replace", "unlink", "remove"),
    *("mkdir", "rmdir", "listdir", "scandir", "truncate", "ftruncate", "chmod", "utime"),
]
PARTICIPANT = "/api/v1/study/participants/P01"
CONSOLE = "/api/v1/study/console"
THEIR = f"{CONSOLE}/participants/P01"
SESSION = f"/api/v1/sessions/{SESSION_ID}"
CAPTURE = f"{SESSION}/captures/{capture_id(1)}"
OTHER = "/api/v1/sessions/5e551011-0000-4000-8000-000000000002"
SHOWN: dict[str, str] = {}
"""The credential of the console that is paired with the running server."""

NEW = "0f0f0f0f-0000-4000-8000-00000000000"


class Watch:
    """Remembers who waits on the loop's thread, from when it is told which one that is."""

    def __init__(self) -> None:
        self.loop_thread: int | None = None
        self.found: list[str] = []

    def saw(self, what: str) -> None:
        if threading.get_ident() != self.loop_thread:
            return
        places: list[str] = []
        frame = sys._getframe(2)
        while frame is not None:
            code = frame.f_code
            places.append(f"{Path(code.co_filename).name}:{frame.f_lineno} {code.co_name}")
            frame = frame.f_back
        if any("importlib" in place for place in places):
            return  # what is imported late is read once
        self.found.append(f"{what} in {' < '.join(places[:5])}")

    def of_lock(self, kind: Callable[[], Any]) -> Callable[[], Any]:
        """Return what makes locks of this kind; those of ours are watched."""

        def make() -> Any:
            callers = [sys._getframe(depth).f_globals.get("__name__", "") for depth in (1, 2)]
            lock = kind()
            ours = any(name.startswith("peaking.") for name in callers)
            return WatchedLock(lock, self) if ours else lock

        return make

    def of_file(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*arguments: Any, **named: Any) -> Any:
            self.saw(name)
            return call(*arguments, **named)

        return watched


class WatchedLock:
    """A lock that is watched."""

    def __init__(self, lock: Any, watch: Watch) -> None:
        self._lock, self._watch = lock, watch

    def acquire(self, *arguments: Any, **named: Any) -> bool:
        self._watch.saw("a lock")
        return self._lock.acquire(*arguments, **named)

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._lock, name)


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Watch:
    watch = Watch()
    for name in ("Lock", "RLock"):
        monkeypatch.setattr(threading, name, watch.of_lock(getattr(threading, name)))
    for name in FILE_CALLS:
        monkeypatch.setattr(os, name, watch.of_file(name, getattr(os, name)))
    monkeypatch.setattr(zlib, "crc32", watch.of_file("crc32", zlib.crc32))
    monkeypatch.setattr(builtins, "open", watch.of_file("open", open))
    return watch


@pytest.fixture
def port(tmp_path: Path, watch: Watch) -> Generator[int, None, None]:
    (tmp_path / FILE_NAME).write_text(SMALL)
    pages = tmp_path / "client"
    pages.mkdir()
    for name in ("index", "check", "sessions", "study", "participant"):
        (pages / f"{name}.html").write_text(f"<p>{name}</p>")
    sessions = SessionStore(tmp_path / "sessions")
    study = OpenStudy(tmp_path, sessions)
    recordings = {"desk": PlayedRecording("desk", open_recording(DESK))}
    devices = Devices(sessions.root, usual=CONSOLE_GRANT)
    SHOWN["Authorization"] = f"Bearer {credential_of(devices)}"
    config = ServerOptions(
        devices=devices, client_dir=pages, recordings=recordings, pages=["http://localhost/"]
    )
    links = ["http://localhost/participant?participant="]
    app = create_study_app(
        study=study,
        capture=create_app(store=sessions, config=config),
        config=StudyServerOptions(devices=devices, client_dir=pages, phone_links=links),
    )

    async def watched(scope: Scope, receive: Receive, send: Send) -> None:
        watch.loop_thread = threading.get_ident()
        await app(scope, receive, send)

    with limited_server(watched, ConnectionLimits()) as port:
        yield port
        watch.loop_thread = None


REQUESTS: list[tuple[str, str, Any]] = [
    ("get", "/", None),
    ("get", "/check", None),
    ("get", "/index.html", None),
    ("get", "/nothing.js", None),
    ("get", "/participant", None),
    ("get", "/api/v1/server", None),
    ("post", "/api/v1/pair", {"protocol": PROTOCOL, "code": "x" * 24, "device": f"{NEW}6"}),
    ("get", "/api/v1/devices", None),
    ("post", "/api/v1/devices/codes", {}),
    ("delete", f"/api/v1/devices/{NEW}6", None),
    ("get", "/api/v1/openapi.json", None),
    ("get", "/api/v1/events", None),
    ("put", SESSION, new_session()),
    ("put", OTHER, new_session()),
    ("get", f"{SESSION}/events", None),
    ("put", CAPTURE, upload(1)),
    ("put", CAPTURE, upload(1)),
    ("get", f"{CAPTURE}/mpi", "until it is made"),
    ("get", f"{CAPTURE}/mpi/1", None),
    ("get", f"{CAPTURE}/photo", None),
    ("get", f"{CAPTURE}/thumbnail", None),
    ("get", f"{CAPTURE}/thumbnail", None),
    ("get", "/api/v1/sessions", None),
    ("get", SESSION, None),
    ("patch", SESSION, {"name": "another"}),
    ("put", f"{SESSION}/peaked/{NEW}1", {"samples": []}),
    ("get", f"{SESSION}/peaked", None),
    ("get", f"{SESSION}/guidance", None),
    ("get", f"{CAPTURE}/points", None),
    ("get", f"{SESSION}/training", None),
    ("put", f"{SESSION}/training", {"state": "running"}),
    ("get", f"{SESSION}/training/splat/1", None),
    ("get", f"{SESSION}/selection?policy=all", None),
    ("get", f"{SESSION}/selection", None),
    ("get", f"{SESSION}/dataset.zip", None),
    ("get", f"{SESSION}/dataset.zip?views=auto", None),
    ("get", f"{SESSION}/dataset.zip?format=colmap", None),
    ("patch", CAPTURE, {"ending": "set_aside"}),
    ("patch", CAPTURE, {"ending": None}),
    ("delete", CAPTURE, None),
    ("patch", OTHER, {"deleted": True}),
    ("patch", OTHER, {"deleted": False}),
    ("delete", OTHER, None),
    ("get", "/api/v1/recordings/desk", None),
    ("get", "/api/v1/recordings/desk/frames/0/photo", None),
    ("get", "/api/v1/recordings/desk/frames/0/depth", None),
    ("get", f"{CONSOLE}/events", None),
    ("put", f"{CONSOLE}/participants/{NEW}2", None),
    ("get", f"{PARTICIPANT}/events", None),
    ("get", "/api/v1/study/texts", None),
    ("get", PARTICIPANT, None),
    ("put", f"{PARTICIPANT}/consent", {"agreed": True, "images": True}),
    ("patch", f"{PARTICIPANT}/steps/start.ask.demographics/draft", {"answers": {}}),
    ("put", f"{PARTICIPANT}/steps/start.ask.demographics/answers", {"answers": {}}),
    ("put", f"{PARTICIPANT}/steps/t1.capture/session", {"session": SESSION_ID}),
    ("put", f"{PARTICIPANT}/steps/t1.capture/finished", None),
    ("put", f"{PARTICIPANT}/told/{NEW}3", {"session": SESSION_ID, "events": []}),
    ("put", f"{THEIR}/steps/t1.practice/started", None),
    ("put", f"{THEIR}/steps/t1.practice/finished", None),
    ("put", f"{THEIR}/steps/t1.practice/repetitions/{NEW}4", {"text": "again"}),
    ("put", f"{THEIR}/notes/{NEW}5", {"text": "a note"}),
    ("post", f"{THEIR}/codes", None),
    ("put", f"{THEIR}/excluded", {"text": "a reason"}),
]


def ask(port: int, method: str, path: str, body: Any, streams: contextlib.ExitStack) -> int:
    sent = body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
    connection = http.client.HTTPConnection("localhost", port, timeout=PATIENCE_S)
    streams.callback(connection.close)
    while True:
        content = None if isinstance(body, str) else sent
        connection.request(method.upper(), path, content, headers=SHOWN)
        answer = connection.getresponse()
        if path.endswith("/events"):
            assert answer.readline().startswith(b"data:")
            return answer.status
        answer.read()
        if not (isinstance(body, str) and answer.status == 404):
            return answer.status


def test_nothing_is_waited_for_on_the_event_loop(port: int, watch: Watch) -> None:
    with contextlib.ExitStack() as streams:
        for method, path, body in REQUESTS:
            status = ask(port, method, path, body, streams)
            assert status < 500, (method, path)
    assert watch.loop_thread is not None
    assert watch.found == []


def test_every_address_is_asked() -> None:
    def fits(path: str, pattern: str) -> bool:
        parts, wanted = path.partition("?")[0].split("/"), pattern.split("/")
        return len(parts) == len(wanted) and all(
            w.startswith("{") or w == p for p, w in zip(parts, wanted, strict=True)
        )

    missing = [
        f"{operation.method} {operation.path}"
        for operation in (*OPERATIONS, *STUDY_OPERATIONS)
        if not any(
            method == operation.method and fits(path, operation.path)
            for method, path, _ in REQUESTS
        )
    ]
    assert missing == []


def test_the_watch_sees_files_and_locks(watch: Watch, tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "sessions")
    watch.loop_thread = threading.get_ident()
    (tmp_path / "a").write_bytes(b"")
    (tmp_path / "a").is_file()
    store.begin(SESSION_ID, wire_of(new_session()))
    kinds = {found.partition(" in ")[0] for found in watch.found}
    assert {"open", "stat", "fsync", "a lock"} <= kinds
    watch.loop_thread = None
    store.close()


def wire_of(new: dict[str, Any]) -> Any:
    import msgspec

    from peaking.server import wire

    return msgspec.convert(new, wire.NewSession)
