"""GET …/guidance: computed in the background, told as an event, not in studies."""

from __future__ import annotations

import base64
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, header, new_session, upload
from patience import PATIENCE_S
from peaking.options import DEFAULT
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.guidance import NOTHING_YET, GuidanceWorker
from peaking.server.open_session import OpenSession
from peaking.server.sessions import SessionStore
from peaking.server.upload import parse_upload
from server.test_two_speeds import wait_for

SESSION = f"/api/v1/sessions/{SESSION_ID}"
SMALL = replace(DEFAULT, pixels=4096, num_planes=8)


@pytest.fixture
def client(tmp_path: Path) -> Generator[TestClient]:
    config = ServerOptions(devices=None, client_dir=tmp_path, options=SMALL)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        yield client


def take(client: TestClient, number: int) -> None:
    client.put(f"{SESSION}/captures/{capture_id(number)}", content=upload(number))
    wait_for(client, number, lambda c: c["state"] == "ready")


def guidance(client: TestClient, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    until = time.monotonic() + PATIENCE_S
    answer: dict[str, Any] = {}
    while time.monotonic() < until:
        answer = client.get(f"{SESSION}/guidance").json()
        if wanted(answer):
            return answer
        time.sleep(0.05)
    raise AssertionError(f"it did not come to that: {answer}")


def test_before_the_first_view_there_is_none(client: TestClient) -> None:
    assert client.get(f"{SESSION}/guidance").json() == msgspec.to_builtins(NOTHING_YET)


def test_it_follows_the_views(client: TestClient) -> None:
    take(client, 1)
    first = guidance(client, lambda g: g["views"] == 1)
    assert 0 <= first["score"] <= 1
    assert len(first["surface_m"]) % 3 == 0
    take(client, 2)
    second = guidance(client, lambda g: g["views"] == 2)
    assert second["revision"] > first["revision"]
    assert [point["views"] for point in second["curve"]] == [1, 2]
    client.delete(f"{SESSION}/captures/{capture_id(2)}")
    undone = guidance(client, lambda g: g["views"] == 1 and g["revision"] > second["revision"])
    assert [point["views"] for point in undone["curve"]] == [1]
    client.delete(f"{SESSION}/captures/{capture_id(1)}")
    nothing = guidance(client, lambda g: g["views"] == 0)
    assert nothing["revision"] > undone["revision"]  # or who saw the last would keep it
    assert nothing["left"] == []


def test_what_is_erased_is_in_no_guidance(client: TestClient) -> None:
    take(client, 1)
    guidance(client, lambda g: g["views"] == 1)
    erased = client.patch(f"{SESSION}/captures/{capture_id(1)}", json={"ending": "erased"})
    assert erased.status_code == 200
    assert client.get(f"{SESSION}/guidance").json()["left"] == []


def test_what_is_no_pose_is_left_out_of_the_walk(client: TestClient) -> None:
    sample = {"time_s": 1.0, "peaked_share": 0.1, "views": 1, "world_from_cam": [7.0] * 12}
    told = client.put(f"{SESSION}/peaked/{capture_id(98)}", json={"samples": [sample]})
    assert told.status_code == 204
    take(client, 1)
    guidance(client, lambda g: g["views"] == 1)


def test_what_is_left_has_a_picture_and_a_reason(client: TestClient) -> None:
    take(client, 1)
    answer = guidance(client, lambda g: g["views"] == 1)
    assert 1 <= len(answer["left"]) <= wire.MAX_PLACES_LEFT
    for place in answer["left"]:
        jpeg = np.frombuffer(base64.b64decode(place["picture"]), np.uint8)
        picture = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        assert picture is not None
        assert picture.shape[0] > picture.shape[1]  # as the views
        assert place["reason"]
        assert 0 < place["share"] <= 1


def test_a_walk_is_looked_at_again(client: TestClient) -> None:
    take(client, 1)
    before = guidance(client, lambda g: g["views"] == 1)
    pose = header(1)["camera"]["world_from_cam"]
    samples = [
        {"time_s": 1.0 + k, "peaked_share": 0.1, "views": 1, "world_from_cam": pose}
        for k in range(12)
    ]
    client.put(f"{SESSION}/peaked/{capture_id(99)}", json={"samples": samples})
    guidance(client, lambda g: g["revision"] > before["revision"])


def stored(tmp_path: Path, *, owner: str | None = None) -> OpenSession:
    store = SessionStore(tmp_path / "kept")
    new = msgspec.convert(new_session(), wire.NewSession)
    session, _ = store.begin(SESSION_ID, new, owner=owner)
    session.store_capture(capture_id(1), parse_upload(upload(1), keep_exif=False))
    return session


def test_a_study_has_none(tmp_path: Path) -> None:
    told: list[int] = []
    worker = GuidanceWorker(SMALL, on_new=lambda _, n: told.append(n), is_busy=lambda: False)
    try:
        assert worker.of(stored(tmp_path, owner="P01")) == NOTHING_YET
        assert worker.waiting == 0
    finally:
        worker.close()
    assert told == []


def test_it_waits_for_what_is_better_to_do(tmp_path: Path) -> None:
    """And does not hold up the end of the server."""
    asked = threading.Event()

    def busy() -> bool:
        asked.set()
        return True

    worker = GuidanceWorker(SMALL, on_new=lambda _session, _revision: None, is_busy=busy)
    session = stored(tmp_path)
    session.mark_ready(capture_id(1), b"", generator="layered")
    worker.want(session)
    assert asked.wait(PATIENCE_S)
    assert worker.of(session) == NOTHING_YET
    worker.close()
    assert not worker.alive
