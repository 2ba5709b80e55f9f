"""What the automatic shutter took beyond a number is set aside: the least missed, never lost."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
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
    upload,
)
from patience import PATIENCE_S
from peaking.mpi_file import encode
from peaking.options import DEFAULT
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.keeper import Keeper
from peaking.server.open_session import OpenSession
from peaking.server.sessions import SessionStore
from peaking.server.upload import parse_upload
from peaking.view_builder import ViewBuilder
from server.test_two_speeds import wait_for

SESSION = f"/api/v1/sessions/{SESSION_ID}"
MOST = 3
SMALL = replace(DEFAULT, pixels=4096, num_planes=8)


def automatic(number: int, place: int | None = None) -> bytes:
    """Return an upload of the automatic shutter; `place` is where it was taken, if elsewhere."""
    camera = header(number if place is None else place)["camera"]
    fields = header(number, automatic=True, camera=camera)
    return body_of(fields, photo(number) + depth_mm(number).tobytes())


@pytest.fixture
def client(tmp_path: Path) -> Generator[TestClient]:
    config = ServerOptions(devices=None, client_dir=tmp_path, options=SMALL, most_automatic=MOST)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        yield client


def send(client: TestClient, number: int, body: bytes) -> None:
    assert client.put(f"{SESSION}/captures/{capture_id(number)}", content=body).is_success
    wait_for(client, number, lambda c: c["state"] == "ready")


def captures(client: TestClient) -> list[dict[str, Any]]:
    return client.get(SESSION).json()["captures"]


def there(client: TestClient) -> list[int]:
    return [c["number"] for c in captures(client) if not c.get("removed")]


def wait_until_there(client: TestClient, count: int) -> list[int]:
    """Wait until so many views are in the data set; return their numbers."""
    until_s = time.monotonic() + PATIENCE_S
    while len(numbers := there(client)) != count:
        assert time.monotonic() < until_s, numbers
        time.sleep(0.02)
    return numbers


def photos_below(root: Path) -> set[int]:
    """Return the numbers of the photos whose bytes are below a folder."""
    bytes_there = {path.read_bytes() for path in root.rglob("*.jpg")}
    return {number for number in range(1, 20) if photo(number) in bytes_there}


def test_the_least_missed_automatic_views_are_set_aside(client: TestClient, tmp_path: Path) -> None:
    for number in (1, 2):
        send(client, number, upload(number))
    for number in range(3, 9):
        send(client, number, automatic(number))
    numbers = wait_until_there(client, 2 + MOST)
    assert numbers[:2] == [1, 2]
    away = [c for c in captures(client) if c.get("removed")]
    assert all((c["ending"], c["restorable"]) == ("set_aside", True) for c in away)
    assert photos_below(tmp_path) == set(range(1, 9))

    back = away[0]["number"]
    address = f"{SESSION}/captures/{away[0]['id']}"
    assert client.patch(address, json={"ending": None}).is_success
    send(client, 9, automatic(9))  # it is looked at again, and what was brought back stays
    assert {1, 2, back} <= set(wait_until_there(client, 3 + MOST))
    assert photos_below(tmp_path) == set(range(1, 10))


def test_what_was_taken_where_another_was_goes_first(client: TestClient) -> None:
    send(client, 1, upload(1))
    send(client, 2, automatic(2))
    send(client, 3, automatic(3, place=2))
    for number in (4, 5):
        send(client, number, automatic(number))
    gone = set(range(1, 6)) - set(wait_until_there(client, 1 + MOST))
    assert gone in ({2}, {3})


def test_views_by_hand_are_never_set_aside(client: TestClient) -> None:
    for number in range(1, 8):
        send(client, number, upload(number))
    assert there(client) == list(range(1, 8))


def test_an_undo_makes_room(tmp_path: Path) -> None:
    session = SessionStore(tmp_path).begin(
        SESSION_ID, msgspec.convert(new_session(), wire.NewSession)
    )[0]
    told: list[int] = []
    keeper = Keeper(SMALL, on_set_aside=lambda _, c: told.append(c.number), most_automatic=MOST)
    ready(session, 1, 2, 3, 4)
    keeper._thin_out(session)  # pyright: ignore[reportPrivateUsage]
    assert len(told) == 1
    kept = [capture for capture in session.captures if not capture.removed]
    session.remove_capture(kept[0].id)
    ready(session, 5)
    keeper._thin_out(session)  # pyright: ignore[reportPrivateUsage]
    assert len(told) == 1
    ready(session, 6)
    keeper._thin_out(session)  # pyright: ignore[reportPrivateUsage]
    assert len(told) == 2
    assert kept[0].number not in told


def ready(session: OpenSession, *numbers: int) -> None:
    """Let views of the automatic shutter be there; their MPIs are not looked at."""
    builder = ViewBuilder(SMALL)
    for number in numbers:
        session.store_capture(capture_id(number), parse_upload(automatic(number)))
        made = builder.build(session.frame_of(capture_id(number)))
        session.mark_ready(capture_id(number), encode(made.mpi), generator="layered")


KILLED = """
import os, signal, sys
from pathlib import Path
from peaking.server.sessions import SessionStore

steps = 0

def killed_before(call):
    def step(*arguments, **named):
        global steps
        steps -= 1
        if steps == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*arguments, **named)
    return step

# Each is killed in a process of its own; only importing is done once for all.
for line in sys.stdin:
    folder, step, capture = line.split()
    child = os.fork()
    if child:
        print(os.waitpid(child, 0)[1], flush=True)
        continue
    session = SessionStore(Path(folder)).sessions()[0]
    for name in ("write", "fsync", "rename", "replace", "link", "unlink"):
        setattr(os, name, killed_before(getattr(os, name)))
    steps = int(step)
    session.set_aside(capture)
    session.refresh_dataset()
    os._exit(0)
"""
VIEWS = 3


def test_killed_at_any_step_of_setting_aside_nothing_is_lost(tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "before")
    session = store.begin(SESSION_ID, msgspec.convert(new_session(), wire.NewSession))[0]
    for number in range(1, VIEWS + 1):
        session.store_capture(capture_id(number), parse_upload(automatic(number)))
    store.close()
    killer = subprocess.Popen(
        [sys.executable, "-c", KILLED], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert killer.stdin is not None
    assert killer.stdout is not None
    endings: list[str | None] = []
    step, status = 0, signal.SIGKILL.value
    while status == signal.SIGKILL:
        step += 1
        folder = tmp_path / f"killed-{step}"
        shutil.copytree(tmp_path / "before", folder)
        killer.stdin.write(f"{folder} {step} {capture_id(2)}\n")
        killer.stdin.flush()
        status = int(killer.stdout.readline())
        store = SessionStore(folder)
        assert store.problems == []
        (session,) = store.sessions()
        assert [capture.id for capture in session.captures] == [
            capture_id(number) for number in range(1, VIEWS + 1)
        ]
        for capture in session.captures:
            assert session.photo_path(capture).read_bytes() == photo(capture.number)
            assert session.frame_of(capture.id).depth_m is not None
        endings.append(session.capture(capture_id(2)).ending)
        assert not session.restore_capture(capture_id(2)).removed
        assert len(session.dataset_files()) == 1 + 2 * VIEWS
        store.close()
    killer.stdin.close()
    assert killer.wait(PATIENCE_S) == 0
    killer.stdout.close()
    assert status == 0
    assert endings[0] is None
    assert endings[-1] == "set_aside"
    assert step > 5  # there were steps at which it was killed
