"""Cut at every place, asked by many at once, and sent junk."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from peaking.server.sessions import SessionStore
from peaking.server.study import wire
from peaking.server.study.open_study import OpenStudy
from peaking.study.procedure import current
from peaking.study.records import log_of, read_events
from study.test_serve_study import CONSOLE, NEW, P01, SUS, client, first_trial, study

__all__ = ["client", "study"]  # fixtures

JUNK = (
    b"",
    b"{",
    b"null",
    b"[]",
    b"\xff\xfe",
    b'"text"',
    b"{}",
    b'{"step":"t1.capture"}',
    b'{"answers":{"q1":{"deep":[1]}}}',
    b'{"answers":{"q1":1e999}}',
    b'{"agreed":"yes"}',
    b'{"session":"s","events":[{"kind":"ViewTaken","id":"?","step":"t1.capture","time_s":-1}]}',
    b'{"text":""}',
)
PLACES = (
    f"PUT {P01}/consent",
    f"PUT {P01}/told/batch-01",
    f"PATCH {P01}/steps/consent/draft",
    f"PUT {P01}/steps/consent/answers",
    f"PUT {P01}/steps/consent/session",
    f"PUT {CONSOLE}/participants/P01/steps/consent/repetitions/{NEW}",
    f"PUT {CONSOLE}/participants/P01/notes/{NEW}",
    f"PUT {CONSOLE}/participants/P01/excluded",
)


def test_a_log_that_is_cut_anywhere_is_a_log_of_what_came_before(
    client: TestClient, study: Path
) -> None:
    first_trial(client)
    client.patch(f"{P01}/steps/t1.ask.sus/draft", json={"answers": {"q1": 3}})
    client.put(f"{P01}/steps/t1.ask.sus/answers", json={"answers": SUS})
    client.__exit__()
    sessions = SessionStore(study / "sessions")
    log = log_of(study, "P01")
    whole, events = log.path.read_bytes(), read_events(log)
    begun = whole.index(b"\n") + 1
    for cut in range(begun, len(whole) + 1, 3):
        log.path.write_bytes(whole[:cut])
        (again,) = OpenStudy(study, sessions).participants.values()
        kept = whole[:cut].count(b"\n")
        assert again.events == events[:kept]
        assert again.current == current(again.steps, events[:kept])
        again.note("on we go", new_id=NEW)
        assert read_events(log) == again.events


def test_handed_in_by_many_tabs_at_once_it_counts_once(client: TestClient, study: Path) -> None:
    first_trial(client)
    client.__exit__()
    participant = OpenStudy(study, SessionStore(study / "sessions")).get("P01")
    answers = wire.Answered(answers={**SUS})

    def hand_in(_: int) -> None:
        participant.answer("t1.ask.sus", answers)

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(hand_in, range(32)))
    assert log_of(study, "P01").path.read_text().count('"type":"Answered"') == 1


@pytest.mark.parametrize("place", PLACES)
def test_junk_is_refused_with_a_sentence(client: TestClient, study: Path, place: str) -> None:
    method, path = place.split()
    before = log_of(study, "P01").path.read_bytes()
    for body in JUNK:
        answer = client.request(method, path, content=body)
        assert 400 <= answer.status_code < 500, body
        assert answer.json()["detail"]
    assert log_of(study, "P01").path.read_bytes() == before
    assert client.request(method, path, content=b"x" * 1_000_001).status_code == 413
