"""Photos that may not be kept, and erasures that were cut: gone, whoever leaves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from capture_uploads import new_session, photo, upload
from clocks import Clock
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.devices import Devices
from peaking.server.events import Hub
from peaking.server.pairing_codes import Grant
from peaking.server.sessions import SessionStore
from peaking.server.study import wire as study_wire
from peaking.server.study.erasure import erase_participant
from peaking.server.study.open_participant import OpenParticipant
from peaking.server.study.open_study import OpenStudy
from peaking.server.upload import parse_upload
from peaking.study.privacy import KEPT_FOR_REVIEW_S
from peaking.study.protocol import FILE_NAME
from peaking.study.records import log_of
from study.test_protocol import SMALL

SESSION = "5e551011-0000-4000-8000-000000000001"
NEW_SESSION = msgspec.convert(new_session(), wire.NewSession)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / FILE_NAME).write_text(SMALL)
    return tmp_path


def opened(folder: Path, clock: Clock) -> OpenStudy:
    return OpenStudy(folder, SessionStore(folder / "sessions", clock=clock), clock=clock)


def closed(study: OpenStudy) -> None:
    study.sessions.close()


def photos_in(folder: Path) -> int:
    return sum(path.read_bytes() == photo(1) for path in folder.rglob("*") if path.is_file())


def capturing(study: OpenStudy, *, images: bool) -> OpenParticipant:
    """Bring P01 into the first trial's capture, with one photo taken."""
    participant, _ = study.add("a-participant")
    participant.consent(study_wire.Consent(agreed=True, images=images))
    while (now := participant.current) is not None and now[0].kind != "capture":
        participant.start(now[0].key)
        participant.stop(now[0].key, by="experimenter")
    participant.start("t1.capture")
    study.grant(participant, "t1.capture", study_wire.SessionBegun(SESSION))
    session, _ = study.sessions.begin(SESSION, NEW_SESSION, owner=study.to_begin(SESSION))
    session.store_capture("c0ffee00-0000-4000-8000-000000000001", parse_upload(upload(1)))
    return participant


def test_who_leaves_during_the_capture_leaves_no_photos(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    participant = capturing(study, images=False)
    clock.now_s += KEPT_FOR_REVIEW_S - 1
    assert study.forget_overdue_images() == ([], [])
    assert photos_in(folder) == 1
    clock.now_s += 2
    assert study.forget_overdue_images() == ([participant], [])
    assert photos_in(folder) == 0
    assert participant.session(participant.steps[-1]) is None
    # Who comes back begins another capture.
    (capture,) = [step for step in participant.steps if step.key == "t1.capture"]
    assert participant.session(capture) is None


def test_who_leaves_leaves_no_photos_at_the_next_start(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    capturing(study, images=False)
    closed(study)
    clock.now_s += KEPT_FOR_REVIEW_S / 2
    closed(opened(folder, clock))
    assert photos_in(folder) == 1
    clock.now_s += KEPT_FOR_REVIEW_S
    closed(opened(folder, clock))
    assert photos_in(folder) == 0


def test_photos_that_may_be_kept_stay(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    capturing(study, images=True)
    closed(study)
    clock.now_s += 1000 * KEPT_FOR_REVIEW_S
    closed(opened(folder, clock))
    assert photos_in(folder) == 1


def test_what_a_page_tells_for_ever_keeps_no_photos(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    participant = capturing(study, images=False)
    for hour in range(25):
        clock.now_s += 3600.0
        told = {"kind": "CaptureBegun", "id": f"e{hour}", "step": "t1.capture", "time_s": 1.0}
        participant.tell([msgspec.convert(told, study_wire.Told)], session=SESSION)
    study.forget_overdue_images()
    assert photos_in(folder) == 0


@pytest.mark.parametrize("again", ["t1.capture", "consent"])
def test_a_capture_that_is_begun_anew_leaves_no_photos(
    folder: Path, clock: Clock, again: str
) -> None:
    study = opened(folder, clock)
    participant = capturing(study, images=False)
    participant.repeat(again, "a bell rang", new_id="again-01")
    study.forget_images(participant)
    assert photos_in(folder) == 0


def _whole_line(lines: list[bytes], kind: bytes) -> list[bytes]:
    return [b"{}" if kind in line else line for line in lines]


@pytest.mark.parametrize("lost", [b"StepStarted", b"SessionLinked", b"ParticipantBegun"])
def test_a_damaged_log_keeps_no_photos_that_may_not_be_kept(
    folder: Path, clock: Clock, lost: bytes
) -> None:
    study = opened(folder, clock)
    capturing(study, images=False)
    closed(study)
    log = log_of(folder, "P01").path
    log.write_bytes(b"\n".join(_whole_line(log.read_bytes().split(b"\n"), lost)))
    study = opened(folder, clock)
    assert "P01 is set aside" in study.problems[0]
    assert photos_in(folder) == 1
    clock.now_s += KEPT_FOR_REVIEW_S + 1
    study.forget_overdue_images()
    assert photos_in(folder) == 0
    closed(study)


def test_a_lost_consent_is_said(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    capturing(study, images=False)
    closed(study)
    log = log_of(folder, "P01").path
    log.write_bytes(b"\n".join(_whole_line(log.read_bytes().split(b"\n"), b"ConsentGiven")))
    study = opened(folder, clock)
    assert any("whether photos may be kept cannot be read" in p for p in study.problems)


def test_a_full_disk_keeps_nobody_from_being_served(
    folder: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = opened(folder, clock)
    capturing(study, images=False)
    closed(study)
    clock.now_s += KEPT_FOR_REVIEW_S + 1

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("peaking.event_log.append", full)
    study = opened(folder, clock)
    assert study.problems == ["P01: photos cannot be erased (No space left on device)"]


def test_streams_of_what_is_erased_end(folder: Path, clock: Clock) -> None:
    study = opened(folder, clock)
    participant = capturing(study, images=False)
    ended: list[str] = []

    class Listening(Hub):
        def end(self, topic: str) -> None:
            ended.append(topic)

    config = ServerOptions(devices=None, client_dir=folder / "none")
    create_app(store=study.sessions, hub=Listening(), admission=study, config=config)
    participant.exclude("left")
    study.forget_images(participant)
    assert ended == [SESSION]


def test_an_erasure_that_was_cut_forgets_the_phone_at_the_next_start(
    folder: Path, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = opened(folder, clock)
    capturing(study, images=True)
    devices = Devices(study.sessions.root)
    devices.pair(devices.codes.give(Grant("participant", "P01")), device="phone-01", name="x")
    closed(study)

    def power_cut(*_: object) -> None:
        raise KeyboardInterrupt

    cuts: list[tuple[str, Callable[..., None]]] = [
        ("peaking.server.sessions.SessionStore.erase", power_cut),
        ("peaking.server.devices.Devices.forget", power_cut),
    ]
    for where, cut in cuts:
        with monkeypatch.context() as patch:
            patch.setattr(where, cut)
            with pytest.raises(KeyboardInterrupt):
                erase_participant(folder, "P01")
    study = opened(folder, clock)
    assert Devices(study.sessions.root).list() == []
    assert photos_in(folder) == 0
    assert not (folder / "participants" / "P01").exists()


def test_damage_in_the_list_of_the_erased_is_said(folder: Path, clock: Clock) -> None:
    (folder / "erased.jsonl").write_bytes(b'{"participant":"P0\n{"participant":"P02","at_s":1.0}\n')
    study = opened(folder, clock)
    assert "erased.jsonl: line 1 cannot be read" in study.problems[0]
    participant, _ = study.add("a-participant")
    assert participant.pseudonym == "P03"
