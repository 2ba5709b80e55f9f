"""Logs that a crash tore, what follows from events, and TCT and NCT worked by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from peaking.errors import StudyError
from peaking.study.measures import catalogue_of, measures_of, peaked_over_time
from peaking.study.protocol import FILE_NAME, Trial, parse_protocol
from peaking.study.records import (
    VERSION,
    Answered,
    AnyEvent,
    CaptureBegun,
    CaptureEnded,
    ConsentGiven,
    ConsentRefused,
    PageGone,
    ParticipantBegun,
    ParticipantExcluded,
    PeakedTold,
    StepFinished,
    StepRepeated,
    StepStarted,
    TrackingFound,
    TrackingLost,
    ViewJoined,
    ViewTaken,
    ViewUndone,
    log_of,
    participant_folder,
    pseudonyms,
    read_participants,
    record_of,
)
from peaking.study.tables import measurements, read_study
from study.test_protocol import FILE, SMALL

PROTOCOL = parse_protocol(SMALL, FILE)
TRIALS = [Trial(1, "peaking", "desk"), Trial(2, "llff", "desk")]
BEGUN = ParticipantBegun(
    at_s=0.0, version=VERSION, participant="P01", row=0, trials=TRIALS, protocol_sha256="0" * 64
)
AHEAD_S = 1000.0
"""The phone's clock is ahead of the server's."""


def phone(kind: type, at_s: float, *, step: str = "t1.capture", **fields: object) -> AnyEvent:
    name = f"{kind.__name__}-{at_s:.0f}-{step}".replace(".", "-")
    return kind(at_s=at_s, id=name, step=step, time_s=at_s + AHEAD_S, **fields)


def capture(step: str = "t1.capture") -> list[AnyEvent]:
    """From 10 s to 70 s: three views, waits 20-24, 22-27 (overlapping) and 40-43 (undone),
    tracking lost 50-52, the page gone 60-65.
    """
    return [
        StepStarted(at_s=5.0, step=step),
        phone(CaptureBegun, 10.0, step=step),
        phone(PeakedTold, 11.0, step=step, peaked_share=0.4, unseen_share=0.1, views=0),
        phone(PeakedTold, 15.0, step=step, peaked_share=0.2, unseen_share=0.1, views=0),
        phone(ViewTaken, 20.0, step=step, capture="a"),
        phone(ViewTaken, 22.0, step=step, capture="b"),
        phone(ViewJoined, 24.0, step=step, capture="a"),
        phone(ViewJoined, 27.0, step=step, capture="b"),
        phone(ViewTaken, 40.0, step=step, capture="c"),
        phone(ViewUndone, 43.0, step=step, capture="c"),
        phone(PeakedTold, 45.0, step=step, peaked_share=0.05, unseen_share=0.0, views=2),
        phone(TrackingLost, 50.0, step=step),
        phone(TrackingFound, 52.0, step=step),
        phone(PageGone, 60.0, step=step, until_s=65.0 + AHEAD_S),
        phone(CaptureEnded, 70.0, step=step),
        StepFinished(at_s=71.0, step=step, by="participant"),
    ]


def test_times_worked_by_hand() -> None:
    (trial, _) = record_of([BEGUN, *capture()]).trials
    found = measures_of(trial, PROTOCOL)
    assert found["tct_s"] == pytest.approx(70 - 10 - 5)
    assert found["waiting_s"] == pytest.approx(7 + 3)
    assert found["nct_s"] == pytest.approx(55 - 10)
    assert found["interrupted_s"] == pytest.approx(5)
    assert found["captures"] == 2
    assert found["undone"] == 1
    assert found["tracking_losses"] == 1
    assert found["tracking_lost_s"] == pytest.approx(2)
    assert found["peaked_last"] == pytest.approx(5.0)
    assert found["peaked_mean"] == pytest.approx((4 * 40 + 5 * 20) / 9)
    assert found["peaked_at_shutter"] == pytest.approx(20.0)
    assert peaked_over_time(trial) == [(1.0, 0.4), (5.0, 0.2), (35.0, 0.05)]


def test_nobody_waits_where_nothing_is_shown_of_the_views() -> None:
    (_, trial) = record_of([BEGUN, *capture("t2.capture")]).trials
    found = measures_of(trial, PROTOCOL)
    assert found["waiting_s"] == 0.0
    assert found["nct_s"] == found["tct_s"] == pytest.approx(55)


def test_order_of_arrival_does_not_matter_and_telling_twice_counts_once() -> None:
    events = capture()
    late = [events[0], *reversed(events[1:-1]), *events[1:5], events[-1]]
    (expected, _) = record_of([BEGUN, *events]).trials
    (trial, _) = record_of([BEGUN, *late]).trials
    assert measures_of(trial, PROTOCOL) == measures_of(expected, PROTOCOL)


def test_stopped_from_the_console() -> None:
    events = [e for e in capture() if not isinstance(e, CaptureEnded)]
    (trial, _) = record_of([BEGUN, *events]).trials
    assert measures_of(trial, PROTOCOL)["tct_s"] == pytest.approx(71 - 10 - 5)


def test_an_unfinished_trial_has_no_numbers() -> None:
    (trial, _) = record_of([BEGUN, *capture()[:-1]]).trials
    found = measures_of(trial, PROTOCOL)
    assert not trial.finished
    assert set(found.values()) == {None}
    assert list(found) == [m.name for m in catalogue_of(PROTOCOL)]


def test_the_last_repetition_counts() -> None:
    again = [StepRepeated(at_s=80.0, step="t1.capture", reason="a call"), *capture()[:9]]
    later = [
        phone(CaptureBegun, 110.0),
        phone(CaptureEnded, 120.0),
        StepFinished(at_s=121.0, step="t1.capture"),
    ]
    events = [BEGUN, *capture(), again[0], StepStarted(at_s=100.0, step="t1.capture"), *later]
    (trial, _) = record_of(events).trials
    assert measures_of(trial, PROTOCOL)["tct_s"] == pytest.approx(10)
    assert measures_of(trial, PROTOCOL)["captures"] == 0


def test_answers_are_scored() -> None:
    answers = {f"q{i}": 3 for i in range(1, 11)}
    asked = Answered(at_s=1.0, step="t2.ask.sus", questionnaire="sus", answers={**answers})
    (one, two) = record_of([BEGUN, asked]).trials
    assert measures_of(two, PROTOCOL)["sus"] == 50.0
    assert measures_of(one, PROTOCOL)["sus"] is None


def test_who_counts() -> None:
    assert record_of([BEGUN]).excluded is None
    given = ConsentGiven(at_s=1.0, images=False, text_sha256="")
    assert not record_of([BEGUN, given]).images
    refused = record_of([BEGUN, ConsentRefused(at_s=1.0)])
    assert refused.excluded == "did not consent"
    assert not refused.consented
    out = record_of([BEGUN, given, ParticipantExcluded(at_s=2.0, reason="phone broke")])
    assert out.excluded == "phone broke"


def write(study: Path, *events: AnyEvent) -> Path:
    participant_folder(study, "P01").mkdir(parents=True)
    log = log_of(study, "P01")
    log.append(*events)
    return log.path


def test_a_torn_last_line_is_not_an_event(tmp_path: Path) -> None:
    path = write(tmp_path, BEGUN, *capture())
    whole = path.read_bytes()
    (expected,) = read_participants(tmp_path)
    torn = len(whole) - len(whole.splitlines(keepends=True)[-1])
    for cut in (1, 5, 20):
        path.write_bytes(whole + whole[torn : torn + cut])
        assert read_participants(tmp_path) == [expected]
    assert pseudonyms(tmp_path) == ["P01"]


def test_appending_after_a_crash_keeps_what_was_acknowledged(tmp_path: Path) -> None:
    path = write(tmp_path, BEGUN)
    with path.open("ab") as file:
        file.write(b'{"type":"NoteAd')
    log = log_of(tmp_path, "P01")
    log.append(*capture())
    (found,) = read_participants(tmp_path)
    assert found.trials[0].finished


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"StepStarted", b"StepStartled", "line 2 cannot be read"),
        (b'"version":1', b'"version":2', "version: is 2"),
        (b'"type":"ParticipantBegun"', b'"type":"Began"', "line 1 cannot be read"),
    ],
)
def test_damage_is_said(tmp_path: Path, old: bytes, new: bytes, said: str) -> None:
    path = write(tmp_path, BEGUN, *capture())
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(StudyError, match=said):
        read_participants(tmp_path)


def test_a_log_that_begins_in_the_middle_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, *capture())
    with pytest.raises(StudyError, match="does not begin with ParticipantBegun"):
        read_participants(tmp_path)
    path.write_bytes(b"")
    with pytest.raises(StudyError, match="does not begin with ParticipantBegun"):
        read_participants(tmp_path)


def test_a_study_becomes_a_table(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text(SMALL)
    write(tmp_path, BEGUN, *capture())
    found = {(m.condition, m.measure): m for m in measurements(read_study(tmp_path))}
    assert found["peaking", "tct_s"].value == pytest.approx(55)
    assert found["peaking", "tct_s"].position == 1
    assert found["llff", "tct_s"].value is None
    log_of(tmp_path, "P01").append(ParticipantExcluded(at_s=99.0, reason="the phone broke"))
    assert measurements(read_study(tmp_path)) == []
