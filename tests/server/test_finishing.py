"""A finished session takes what was taken before that, whenever it arrives, and nothing later."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, body_of, capture_id, depth_mm, header, new_session, photo
from clocks import Clock
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.open_session import OpenSession, SessionClosed
from peaking.server.sessions import SessionStore
from peaking.server.upload import Upload, parse_upload

NEW = msgspec.convert(new_session(), wire.NewSession)
SESSION = f"/api/v1/sessions/{SESSION_ID}"
WRONG_CLOCK_S = 86_400.0
"""A phone's clock may be a day ahead."""


def sent(number: int, *, taken_s: float, sent_s: float | None = None) -> Upload:
    """Return an upload that was taken and sent at times of the phone's clock."""
    return parse_upload(body(number, taken_s=taken_s, sent_s=sent_s))


def body(number: int, *, taken_s: float, sent_s: float | None = None) -> bytes:
    fields = header(number, time_s=taken_s, sent_s=sent_s)
    return body_of(fields, photo(number) + depth_mm(number).tobytes())


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path, clock: Clock) -> SessionStore:
    return SessionStore(tmp_path, clock=clock)


@pytest.fixture
def session(store: SessionStore, clock: Clock) -> OpenSession:
    """A session that was finished a minute ago."""
    session = store.begin(SESSION_ID, NEW)[0]
    session.finish(True)
    clock.now_s += 60.0
    return session


def reopened(store: SessionStore, clock: Clock) -> OpenSession:
    store.close()
    return SessionStore(store.root, clock=clock).get(SESSION_ID)


@pytest.mark.parametrize("clock_is_ahead_s", [0.0, WRONG_CLOCK_S, -WRONG_CLOCK_S])
def test_what_was_taken_before_the_end_is_kept_whatever_the_phones_clock_says(
    session: OpenSession, clock: Clock, clock_is_ahead_s: float
) -> None:
    phone_s = clock.now_s + clock_is_ahead_s
    before = sent(1, taken_s=phone_s - 61.0, sent_s=phone_s)
    assert session.store_capture(capture_id(1), before)[1]
    with pytest.raises(SessionClosed, match="Take more views"):
        session.store_capture(capture_id(2), sent(2, taken_s=phone_s - 59.0, sent_s=phone_s))
    assert [capture.id for capture in session.captures] == [capture_id(1)]
    assert session.summary().finished


def test_how_long_it_took_to_arrive_does_not_count(session: OpenSession, clock: Clock) -> None:
    arrived_s = clock.now_s - 60.5
    slow = sent(1, taken_s=5.0, sent_s=5.5)
    with pytest.raises(SessionClosed):
        session.store_capture(capture_id(1), slow)
    assert session.store_capture(capture_id(1), slow, arrived_s=arrived_s)[1]


def test_a_client_that_does_not_say_when_it_sent_it_is_believed(
    session: OpenSession, clock: Clock
) -> None:
    assert session.store_capture(capture_id(1), sent(1, taken_s=clock.now_s - 61.0))[1]
    with pytest.raises(SessionClosed):
        session.store_capture(capture_id(2), sent(2, taken_s=clock.now_s - 59.0))


def test_it_stays_closed_until_one_says_so(
    store: SessionStore, session: OpenSession, clock: Clock
) -> None:
    late = sent(1, taken_s=clock.now_s)
    session = reopened(store, clock)
    with pytest.raises(SessionClosed):
        session.store_capture(capture_id(1), late)
    session.finish(False)
    assert session.store_capture(capture_id(1), late)[1]
    session.finish(True)
    assert not session.store_capture(capture_id(1), late)[1]  # sending again is always right


def test_a_phone_is_told_by_the_kind_of_the_problem(tmp_path: Path) -> None:
    config = ServerOptions(devices=None, client_dir=tmp_path)
    clock = Clock()
    app = create_app(store=SessionStore(tmp_path / "sessions", clock=clock), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        client.patch(SESSION, json={"finished": True})
        clock.now_s += 1.0
        late = body(1, taken_s=clock.now_s)
        address = f"{SESSION}/captures/{capture_id(1)}"
        refused = client.put(address, content=late)
        assert (refused.status_code, refused.json()["type"]) == (
            409,
            "urn:peaking:problem:finished",
        )
        assert client.get(SESSION).json()["captures"] == []
        assert not client.patch(SESSION, json={"finished": False}).json()["finished"]
        assert client.put(address, content=late).status_code == 201
