"""The study's server: what it takes, what it refuses, and what is left after a crash."""

from __future__ import annotations

import shutil
from collections.abc import Generator
from pathlib import Path
from typing import Any
from uuid import uuid4

import msgspec
import pytest
from starlette.testclient import TestClient

from capture_uploads import capture_id, photo, upload
from peaking.errors import StudyError
from peaking.server.app import ServerOptions, create_app
from peaking.server.devices import Devices
from peaking.server.pairing_codes import CONSOLE as CONSOLE_GRANT
from peaking.server.sessions import SessionStore
from peaking.server.study.app import StudyServerOptions, create_study_app
from peaking.server.study.erasure import erase_participant
from peaking.server.study.open_study import OpenStudy
from peaking.server.wire import PROTOCOL
from peaking.study.privacy import held
from peaking.study.protocol import FILE_NAME
from peaking.study.records import (
    ParticipantRecord,
    log_of,
    pseudonyms,
    read_events,
    read_participants,
    record_of,
)
from study.test_protocol import SMALL

P01 = "/api/v1/study/participants/P01"
CONSOLE = "/api/v1/study/console"
SUS = {f"q{i}": 4 for i in range(1, 11)}
NEW = "0f0f0f0f-0000-4000-8000-000000000001"
SESSION = "5e551011-0000-4000-8000-000000000001"


def open_client(folder: Path, *, devices: Devices | None = None) -> TestClient:
    sessions = SessionStore(folder / "sessions")
    study = OpenStudy(folder, sessions)
    capture = create_app(
        store=sessions,
        config=ServerOptions(devices=devices, client_dir=folder / "none"),
        admission=study,
    )
    config = StudyServerOptions(
        devices=devices,
        client_dir=folder / "none",
        phone_links=["http://localhost/participant?participant="],
    )
    app = create_study_app(study=study, capture=capture, config=config)
    return TestClient(app, base_url="http://localhost")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / FILE_NAME).write_text(SMALL)
    return folder


@pytest.fixture
def client(study: Path) -> Generator[TestClient, None, None]:
    with open_client(study) as client:
        add(client)
        yield client


def restarted(client: TestClient, folder: Path) -> TestClient:
    """End a server and open another on its folder."""
    client.__exit__()
    return open_client(folder)


def add(client: TestClient, new_id: str | None = None) -> Any:
    return client.put(f"{CONSOLE}/participants/{new_id or uuid4()}")


def step(client: TestClient) -> Any:
    found = client.get(P01).json()["step"]
    return None if found is None else found["key"]


def consent(client: TestClient, *, images: bool = True) -> None:
    assert client.put(f"{P01}/consent", json={"agreed": True, "images": images}).is_success


def order(client: TestClient, what: str, key: str) -> int:
    return client.put(f"{CONSOLE}/participants/P01/steps/{key}/{what}").status_code


def hand_in(client: TestClient, key: str, answers: dict[str, int]) -> Any:
    return client.put(f"{P01}/steps/{key}/answers", json={"answers": answers})


def keep_draft(client: TestClient, key: str, answers: dict[str, int]) -> int:
    return client.patch(f"{P01}/steps/{key}/draft", json={"answers": answers}).status_code


def tell(client: TestClient, told: dict[str, object], batch: str = "batch-01") -> int:
    return client.put(f"{P01}/told/{batch}", json=told).status_code


def link(client: TestClient, key: str) -> int:
    return client.put(f"{P01}/steps/{key}/session", json={"session": SESSION}).status_code


def repeat(client: TestClient, key: str, why: str, new_id: str | None = None) -> int:
    path = f"{CONSOLE}/participants/P01/steps/{key}/repetitions/{new_id or uuid4()}"
    return client.put(path, json={"text": why}).status_code


def do_phase(client: TestClient, key: str) -> None:
    assert order(client, "started", key) == 200
    assert order(client, "finished", key) == 200


def told(kind: str, name: str, time_s: float, **more: object) -> dict[str, object]:
    return {"kind": kind, "id": name, "step": step_key, "time_s": time_s, **more}


def told_by(events: list[dict[str, object]], session: str = SESSION) -> dict[str, object]:
    return {"session": session, "events": events}


step_key = "t1.capture"


def first_trial(client: TestClient) -> None:
    """Go to the end of the first trial's review, with the condition whose turn it is."""
    consent(client)
    if step(client) == "t1.scan":
        do_phase(client, "t1.scan")
    do_phase(client, "t1.capture")
    do_phase(client, "t1.review")


def test_pseudonyms_are_given_in_order(client: TestClient) -> None:
    assert add(client).json() == {"participant": "P02"}
    assert client.get(P01).json()["step"]["kind"] == "consent"
    assert client.get("/api/v1/study/participants/P09").status_code == 404


def test_a_participant_who_is_added_twice_is_one(client: TestClient, study: Path) -> None:
    for status in (201, 200, 200):
        answer = add(client, NEW)
        assert (answer.status_code, answer.json()) == (status, {"participant": "P02"})
    with restarted(client, study) as again:
        assert add(again, NEW).json() == {"participant": "P02"}
        assert add(again).json() == {"participant": "P03"}
    assert add(client, "No id").status_code == 404
    assert [r.pseudonym for r in read_participants(study)] == ["P01", "P02", "P03"]


def test_a_note_that_is_sent_twice_is_one(client: TestClient, study: Path) -> None:
    path = f"{CONSOLE}/participants/P01/notes"
    sent = [(NEW, "late"), (NEW, "late"), (str(uuid4()), "late")]
    for new_id, text in sent:
        assert client.put(f"{path}/{new_id}", json={"text": text}).status_code == 200
    with restarted(client, study) as again:
        assert again.put(f"{path}/{NEW}", json={"text": "late"}).status_code == 200
    assert read_participants(study)[0].notes == ["late", "late"]


def test_nothing_is_asked_of_who_does_not_consent(client: TestClient, study: Path) -> None:
    client.put(f"{P01}/consent", json={"agreed": False})
    state = client.get(P01).json()
    assert state["step"] is None
    assert state["refused"]
    (record,) = read_participants(study)
    assert record.excluded == "did not consent"


def test_phases_come_in_order(client: TestClient) -> None:
    assert order(client, "started", "t1.capture") == 409
    consent(client)
    now = step(client)
    assert order(client, "finished", now) == 409
    assert order(client, "started", now) == 200
    assert order(client, "started", now) == 200
    assert order(client, "finished", now) == 200
    assert order(client, "finished", now) == 200
    assert step(client) != now


def test_a_half_filled_form_is_refused_and_kept(client: TestClient) -> None:
    first_trial(client)
    key = "t1.ask.sus"
    answers = {"q1": 3, "q2": 9}
    assert keep_draft(client, key, {"q1": 3}) == 200
    refused = hand_in(client, key, answers)
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert refused.json()["type"] == "urn:peaking:problem:incomplete"
    items = refused.json()["items"]
    assert items["q2"] == "out-of-range"
    assert items["q10"] == "unanswered"
    assert "q1" not in items
    assert client.get(P01).json()["step"]["draft"] == {"q1": 3}


def test_two_tabs_do_not_undo_each_other(client: TestClient) -> None:
    first_trial(client)
    key = "t1.ask.sus"
    keep_draft(client, key, {"q1": 3, "q2": 2})
    keep_draft(client, key, {"q2": 5})
    assert client.get(P01).json()["step"]["draft"] == {"q1": 3, "q2": 5}


def test_a_double_submission_counts_once(client: TestClient, study: Path) -> None:
    first_trial(client)
    assert hand_in(client, "t1.ask.sus", SUS).status_code == 200
    assert hand_in(client, "t1.ask.sus", {**SUS, "q1": 1}).status_code == 200
    assert keep_draft(client, "t1.ask.sus", {"q1": 2}) == 200
    lines = log_of(study, "P01").path.read_text().splitlines()
    assert sum('"type":"Answered"' in line for line in lines) == 1
    assert read_participants(study)[0].trials[0].answers["sus"]["q1"] == 4
    assert hand_in(client, "t2.ask.sus", SUS).status_code == 409
    assert hand_in(client, "t9.ask.sus", SUS).status_code == 409
    assert hand_in(client, "No%20step", SUS).status_code == 404


def test_what_the_phone_tells_twice_is_kept_once(client: TestClient, study: Path) -> None:
    consent(client)
    events = [
        told("CaptureBegun", "b", 10.0),
        told("ViewTaken", "v", 12.0, capture="v"),
        told("PeakedTold", "p", 13.0, peaked_share=0.5, unseen_share=0.0, views=1),
    ]
    for batch in ("batch-01", "batch-01", "batch-02"):
        assert tell(client, told_by(events), batch) == 204
    unknown = [{**events[0], "id": "x", "step": "t9.capture"}]
    assert tell(client, told_by(unknown)) == 204
    half = [{**events[2], "id": "y", "peaked_share": None}]
    assert tell(client, told_by(half)) == 409
    assert tell(client, told_by([{"kind": "x"}])) == 400
    assert tell(client, told_by([{**events[0], "id": f"e{i}"} for i in range(201)])) == 400
    lines = log_of(study, "P01").path.read_text().splitlines()
    assert sum('"time_s":' in line for line in lines) == 3


def test_after_a_crash_everybody_is_where_they_were(client: TestClient, study: Path) -> None:
    first_trial(client)
    keep_draft(client, "t1.ask.sus", {"q3": 2})
    before = client.get(P01).json()
    with log_of(study, "P01").path.open("ab") as file:
        file.write(b'{"type":"Answered","at_s":1')
    with restarted(client, study) as again:
        assert again.get(P01).json() == before
        assert hand_in(again, "t1.ask.sus", SUS).status_code == 200
        assert add(again).json() == {"participant": "P02"}


def test_a_step_is_repeated_with_all_that_came_after(client: TestClient, study: Path) -> None:
    first_trial(client)
    hand_in(client, "t1.ask.sus", SUS)
    assert repeat(client, "t2.capture", "?") == 409
    assert repeat(client, "t1.capture", "a call") == 200
    assert step(client) == "t1.capture"
    assert read_participants(study)[0].trials[0].answers == {}


def test_a_repetition_that_is_sent_twice_undoes_nothing_new(
    client: TestClient, study: Path
) -> None:
    first_trial(client)
    assert repeat(client, step_key, "a call", NEW) == 200
    assert order(client, "started", step_key) == 200
    log = log_of(study, "P01").path
    before = log.read_bytes()
    assert repeat(client, step_key, "a call", NEW) == 200
    with restarted(client, study) as again:
        assert repeat(again, step_key, "a call", NEW) == 200
    assert log.read_bytes() == before
    assert repeat(client, step_key, "another call") == 200
    assert log.read_bytes() != before


def test_a_repetition_of_which_a_crash_kept_only_some_is_finished_when_sent_again(
    client: TestClient, study: Path
) -> None:
    first_trial(client)
    log = log_of(study, "P01").path
    done = log.read_bytes().count(b"\n")
    assert repeat(client, step_key, "a call", NEW) == 200
    lines = log.read_bytes().splitlines(keepends=True)
    assert len(lines) > done + 1
    for kept in range(done, len(lines)):
        log.write_bytes(b"".join(lines[:kept]))
        with restarted(client, study) as again:
            assert repeat(again, step_key, "a call", NEW) == 200
            now = again.get(P01).json()["step"]
            assert (now["key"], now["running"]) == (step_key, False)
            do_phase(again, step_key)
            assert step(again) == "t1.review"


def test_what_a_phone_tells_late_of_a_repeated_step_does_not_count(
    client: TestClient, study: Path
) -> None:
    consent(client)
    if step(client) == "t1.scan":
        do_phase(client, "t1.scan")
    order(client, "started", step_key)
    assert link(client, step_key) == 200
    repeat(client, step_key, "a call")
    order(client, "started", step_key)
    late = told_by([told("CaptureBegun", "late", 10.0)])
    assert tell(client, late) == 204
    new = told_by([told("CaptureBegun", "new", 20.0)], SESSION.replace("1", "2"))
    assert tell(client, new) == 204
    text = log_of(study, "P01").path.read_text()
    assert '"id":"new"' in text
    assert '"id":"late"' not in text


def test_who_is_left_out_gives_the_place_to_the_next(client: TestClient, study: Path) -> None:
    add(client)
    for _ in range(2):
        path = f"{CONSOLE}/participants/P01/excluded"
        assert client.put(path, json={"text": "the phone broke"}).status_code == 200
    assert log_of(study, "P01").path.read_text().count('"ParticipantExcluded"') == 1
    add(client)
    records = {r.pseudonym: r for r in read_participants(study)}
    assert records["P03"].row == records["P01"].row
    assert records["P02"].row != records["P01"].row
    assert client.get(P01).json()["step"] is None


def test_photos_go_after_the_review_when_they_may_not_be_kept(
    client: TestClient, study: Path
) -> None:
    consent(client, images=False)
    if step(client) == "t1.scan":
        do_phase(client, "t1.scan")
    order(client, "started", "t1.capture")
    assert link(client, "t1.capture") == 200
    begun = {"protocol": PROTOCOL, "name": "x", "source": "virtual"}
    assert client.put(f"/api/v1/sessions/{SESSION}", json=begun).status_code == 201
    order(client, "finished", "t1.capture")
    assert len(list((study / "sessions").glob("[!.]*"))) == 1
    do_phase(client, "t1.review")
    assert list((study / "sessions").glob("[!.]*")) == []
    again = client.put(f"/api/v1/sessions/{SESSION}", json=begun)
    assert (again.status_code, again.json()["type"]) == (410, "urn:peaking:problem:erased")
    assert '"ImagesErased"' in log_of(study, "P01").path.read_text()


def test_photos_that_cannot_be_erased_keep_nobody_from_going_on(
    client: TestClient, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    consent(client, images=False)
    is_due(client, "t1.capture")
    link(client, "t1.capture")
    client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    client.put(capture_of(SESSION), content=upload(1))
    order(client, "finished", "t1.capture")

    def refuse(*_: object, **__: object) -> None:
        """Delete nothing."""

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", refuse)
        do_phase(client, "t1.review")
        assert client.get(f"/api/v1/sessions/{SESSION}").status_code == 410
    assert hand_in(client, "t1.ask.sus", SUS).status_code == 200
    with restarted(client, study):
        assert photos_of(study) == set()


def pair(client: TestClient, code: str, device: str | None = None) -> dict[str, str]:
    """Pair a device; return the header by which it is known."""
    asked = {"protocol": PROTOCOL, "code": code, "device": device or str(uuid4())}
    answer = client.post("/api/v1/pair", json=asked)
    assert answer.status_code == 200, answer.text
    return {"Authorization": f"Bearer {answer.json()['credential']}"}


def code_for(client: TestClient, console: dict[str, str], participant: str) -> str:
    answer = client.post(f"{CONSOLE}/participants/{participant}/codes", headers=console)
    link = answer.json()["links"][0]
    assert link.startswith(f"http://localhost/participant?participant={participant}#code=")
    return link.partition("#code=")[2]


def test_a_participants_phone_reaches_that_participant_and_nothing_else(study: Path) -> None:
    devices = Devices(study / "sessions", usual=CONSOLE_GRANT)
    with open_client(study, devices=devices) as client:
        console = pair(client, devices.codes.give(CONSOLE_GRANT))
        new = f"{CONSOLE}/participants/{uuid4()}"
        assert client.put(new).status_code == 401
        assert client.put(new, headers=console).status_code == 201
        assert client.put(f"{CONSOLE}/participants/{uuid4()}", headers=console).status_code == 201
        phone = pair(client, code_for(client, console, "P01"), NEW)
        assert client.get("/api/v1/study/texts").status_code == 401
        assert client.get("/api/v1/study/texts", headers=phone).status_code == 200
        assert client.get(P01, headers=phone).status_code == 200
        assert client.get("/api/v1/server", headers=phone).status_code == 200
        forbidden = [
            ("PUT", new), ("GET", f"{CONSOLE}/events"),
            ("POST", f"{CONSOLE}/participants/P01/codes"),
            ("GET", P01.replace("P01", "P02")), ("GET", "/api/v1/sessions"),
            ("GET", "/api/v1/events"), ("GET", "/api/v1/devices"),
            ("POST", "/api/v1/devices/codes"), ("DELETE", "/api/v1/devices/x"),
            ("GET", "/api/v1/anything"), ("GET", "/api/v1/study/anything"),
        ]  # fmt: skip
        for method, path in forbidden:
            answer = client.request(method, path, headers=phone)
            assert (answer.status_code, path) == (403, path)
            assert answer.json()["type"] == "urn:peaking:problem:not-admitted"
            answer = client.request(method, path + "%0A", headers=phone)
            assert answer.status_code in (403, 404), path
        # The same phone, handed to the next participant, may still send what it kept of the first.
        phone = pair(client, code_for(client, console, "P02"), NEW)
        for path in (P01, P01.replace("P01", "P02")):
            assert client.get(path, headers=phone).status_code == 200
        assert len(client.get("/api/v1/devices", headers=console).json()["devices"]) == 2
        stranger = {**console, "origin": "http://elsewhere"}
        assert client.put(new, headers=stranger).status_code == 403


def test_the_consoles_codes_are_fresh(study: Path) -> None:
    devices = Devices(study / "sessions", usual=CONSOLE_GRANT)
    with open_client(study, devices=devices) as client:
        console = pair(client, devices.codes.give(CONSOLE_GRANT))
        client.put(f"{CONSOLE}/participants/{uuid4()}", headers=console)
        codes = {code_for(client, console, "P01") for _ in range(3)}
        assert len(codes) == 3
        for code in codes:
            assert client.get(P01, headers=pair(client, code)).status_code == 200


def test_one_server_at_a_time(study: Path) -> None:
    with (
        held(study),
        pytest.raises(StudyError, match="being served by another process"),
        held(study),
    ):
        pass


def test_who_is_erased_is_gone_and_the_pseudonym_stays_taken(
    client: TestClient, study: Path
) -> None:
    consent(client)
    assert log_of(study, "P01").path.is_file()
    client.__exit__()
    erase_participant(study, "P01")
    assert not (study / "participants" / "P01").exists()
    with pytest.raises(StudyError, match="none yet"):
        erase_participant(study, "P01")
    with restarted(client, study) as again:
        assert add(again).json() == {"participant": "P02"}


# Consent is asked where photos come in


OTHER = "5e551011-0000-4000-8000-000000000002"
BEGUN = {"protocol": PROTOCOL, "name": "x", "source": "virtual"}


def of_p02(what: str) -> str:
    return f"{P01[:-3]}P02/{what}"


def capture_of(session: str, number: int = 1) -> str:
    return f"/api/v1/sessions/{session}/captures/{capture_id(number)}"


def is_due(client: TestClient, key: str) -> None:
    """Bring P01, who agreed, to a step of the first trial, and start it."""
    if step(client) == "t1.scan" != key:
        do_phase(client, "t1.scan")
    assert order(client, "started", key) == 200


def photos_of(study: Path) -> set[int]:
    there = {path.read_bytes() for path in study.rglob("*") if path.is_file()}
    return {number for number in range(1, 9) if photo(number) in there}


@pytest.mark.parametrize("agreed", [None, False])
def test_without_consent_nothing_is_taken_in(
    client: TestClient, study: Path, agreed: bool | None
) -> None:
    if agreed is not None:
        client.put(f"{P01}/consent", json={"agreed": agreed, "images": True})
    assert link(client, "t1.capture") == 409
    begun = client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    assert (begun.status_code, begun.json()["type"]) == (403, "urn:peaking:problem:not-admitted")
    assert client.put(capture_of(SESSION), content=upload(1)).status_code == 404
    event = {"kind": "CaptureBegun", "id": "e1", "step": "t1.capture", "time_s": 1.0}
    assert tell(client, {"session": SESSION, "events": [event]}) == 409
    assert photos_of(study) == set()


def test_a_session_is_granted_to_one_participant_in_a_step_that_captures(
    client: TestClient, study: Path
) -> None:
    add(client)
    client.put(of_p02("consent"), json={"agreed": True, "images": True})
    consent(client)
    assert client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN).status_code == 403
    is_due(client, "t1.capture")
    assert link(client, "t1.capture") == 200
    assert link(client, "t1.capture") == 200
    assert client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN).status_code == 201
    assert client.put(capture_of(SESSION), content=upload(1)).status_code == 201
    # P02 names it too, to have it erased with theirs.
    theirs = {"session": SESSION}
    step_of_p02 = client.get(of_p02("")[:-1]).json()["step"]["key"]
    client.put(f"{CONSOLE}/participants/P02/steps/{step_of_p02}/started")
    stolen = client.put(of_p02(f"steps/{step_of_p02}/session"), json=theirs)
    assert (stolen.status_code, "somebody else" in stolen.json()["detail"]) == (409, True)
    client.__exit__()
    erase_participant(study, "P02")
    assert photos_of(study) == {1}
    erase_participant(study, "P01")
    assert photos_of(study) == set()


def test_a_phone_erases_nobodys_session(client: TestClient) -> None:
    consent(client)
    is_due(client, "t1.capture")
    link(client, "t1.capture")
    client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    assert client.delete(f"/api/v1/sessions/{SESSION}").status_code == 403
    deleted = client.patch(f"/api/v1/sessions/{SESSION}", json={"deleted": True})
    assert deleted.status_code == 403


def test_nothing_is_captured_in_a_form(client: TestClient) -> None:
    consent(client)
    if step(client) == "t1.scan":
        do_phase(client, "t1.scan")
    do_phase(client, "t1.capture")
    do_phase(client, "t1.review")
    assert step(client) == "t1.ask.sus"
    assert link(client, "t1.ask.sus") == 409


def test_who_is_erased_stays_erased_whatever_phones_send(client: TestClient, study: Path) -> None:
    consent(client)
    is_due(client, "t1.capture")
    link(client, "t1.capture")
    client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    client.put(capture_of(SESSION), content=upload(1))
    client.__exit__()
    erase_participant(study, "P01")
    assert photos_of(study) == set()
    with open_client(study) as again:
        for answer in (
            again.put(f"/api/v1/sessions/{SESSION}", json=BEGUN),
            again.put(capture_of(SESSION, 2), content=upload(2)),
            again.get(f"/api/v1/sessions/{SESSION}"),
        ):
            assert answer.status_code == 410
        assert again.get(P01).status_code == 404
    assert photos_of(study) == set()


def test_a_console_order_of_who_was_erased_adds_nobody(client: TestClient, study: Path) -> None:
    new = str(uuid4())
    assert add(client, new).status_code == 201
    client.__exit__()
    erase_participant(study, "P02")
    with open_client(study) as again:
        assert add(again, new).status_code == 409
        assert add(again).json() == {"participant": "P03"}


def test_photos_go_at_the_next_start_when_the_server_died_after_the_review(
    client: TestClient, study: Path
) -> None:
    consent(client, images=False)
    is_due(client, "t1.capture")
    link(client, "t1.capture")
    client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    client.put(capture_of(SESSION), content=upload(1))
    order(client, "finished", "t1.capture")
    client.__exit__()
    at = {"at_s": 1.0, "step": "t1.review", "by": "experimenter"}
    with log_of(study, "P01").path.open("ab") as log:
        log.write(msgspec.json.encode({"type": "StepStarted", **at}) + b"\n")
        log.write(msgspec.json.encode({"type": "StepFinished", **at}) + b"\n")
    assert photos_of(study) == {1}
    with open_client(study) as again:
        assert photos_of(study) == set()
        assert again.put(f"/api/v1/sessions/{SESSION}", json=BEGUN).status_code == 410


def test_an_erasure_that_was_interrupted_is_finished_at_the_next_start(
    client: TestClient, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    consent(client)
    is_due(client, "t1.capture")
    link(client, "t1.capture")
    client.put(f"/api/v1/sessions/{SESSION}", json=BEGUN)
    client.put(capture_of(SESSION), content=upload(1))
    client.__exit__()

    def power_cut(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("peaking.server.study.erasure.finish_erasures", power_cut)
        with pytest.raises(KeyboardInterrupt):
            erase_participant(study, "P01")
    assert photos_of(study) == {1}
    with open_client(study) as again:
        assert add(again).json() == {"participant": "P02"}
    assert photos_of(study) == set()
    assert not (study / "participants" / "P01").exists()


def test_a_damaged_log_sets_aside_its_participant_and_nobody_else(
    client: TestClient, study: Path
) -> None:
    add(client)
    consent(client)
    client.__exit__()
    log = log_of(study, "P01").path
    data = log.read_bytes()
    log.write_bytes(data[:-60] + bytes(30) + data[-30:])
    with open_client(study) as again:
        assert again.get(P01).status_code == 404
        assert again.get(of_p02("")[:-1]).status_code == 200
        assert add(again).json() == {"participant": "P03"}
    rows = [r.row for r in read_participants_but(study, "P01")]
    assert rows == [1, 2]
    erase_participant(study, "P01")
    assert not log.exists()


def read_participants_but(study: Path, pseudonym: str) -> list[ParticipantRecord]:
    names = [name for name in pseudonyms(study) if name != pseudonym]
    return [record_of(read_events(log_of(study, name))) for name in names]


def test_a_phone_sees_no_capture_of_another_participant(study: Path) -> None:
    devices = Devices(study / "sessions", usual=CONSOLE_GRANT)
    with open_client(study, devices=devices) as client:
        console = pair(client, devices.codes.give(CONSOLE_GRANT))
        for _ in range(2):
            client.put(f"{CONSOLE}/participants/{uuid4()}", headers=console)
        phone = pair(client, code_for(client, console, "P01"))
        other = pair(client, code_for(client, console, "P02"))
        client.headers.update(phone)
        consent(client)
        key = step(client)
        client.put(f"{CONSOLE}/participants/P01/steps/{key}/started", headers=console)
        assert link(client, key) == 200
        session = f"/api/v1/sessions/{SESSION}"
        assert client.put(session, json=BEGUN, headers=other).status_code == 403
        assert client.put(session, json=BEGUN).status_code == 201
        assert client.put(capture_of(SESSION), content=upload(1)).status_code == 201
        for path in (session, f"{session}/events", f"{session}/dataset.zip", f"{session}/peaked"):
            assert client.get(path, headers=other).status_code == 403
        for what in ("photo", "thumbnail", "mpi"):
            path = f"{capture_of(SESSION)}/{what}"
            assert client.get(path, headers=other).status_code == 403
        assert client.delete(capture_of(SESSION), headers=other).status_code == 403
        assert (
            client.put(capture_of(SESSION, 2), content=upload(2), headers=other).status_code == 403
        )
        assert client.get(f"{capture_of(SESSION)}/photo").status_code == 200
        assert client.get(f"{capture_of(SESSION)}/photo", headers=console).status_code == 200
