"""The console computes what changed, and nobody can fill the study's disk by typing."""

from __future__ import annotations

from pathlib import Path

import pytest

from peaking.server.sessions import SessionStore
from peaking.server.study import open_participant, shown, wire
from peaking.server.study.open_participant import OpenParticipant, TooMuch
from peaking.server.study.open_study import OpenStudy
from peaking.server.study.shown import ConsoleView
from peaking.study.protocol import FILE_NAME
from peaking.study.records import record_of
from study.test_protocol import SMALL
from study.test_serve_study import SESSION

IDS = [f"0f0f0f0f-0000-4000-8000-{number:012d}" for number in range(60)]


@pytest.fixture
def study(tmp_path: Path) -> OpenStudy:
    (tmp_path / FILE_NAME).write_text(SMALL)
    return OpenStudy(tmp_path, SessionStore(tmp_path / "sessions"))


def told(number: int, step: str = "t1.capture") -> wire.Told:
    return wire.Told(
        kind="PeakedTold",
        id=f"event-{number:06d}",
        step=step,
        time_s=float(number),
        peaked_share=0.5,
        unseen_share=0.25,
        views=1,
    )


def nobody(_: str) -> bool:
    return False


def begin(study: OpenStudy, count: int) -> list[OpenParticipant]:
    participants = [study.add(new_id)[0] for new_id in IDS[:count]]
    for participant in participants:
        participant.consent(wire.Consent(agreed=True, images=True))
    return participants


def test_only_what_changed_is_computed_again(
    study: OpenStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    participants = begin(study, 5)
    view = ConsoleView(study)
    view.state([], on_phone=nobody)
    computed: list[str] = []
    line = shown._trial_line  # pyright: ignore[reportPrivateUsage]

    def counted(record: shown.TrialRecord, protocol: shown.Protocol) -> wire.TrialLine:
        computed.append(record.trial.key)
        return line(record, protocol)

    monkeypatch.setattr(shown, "_trial_line", counted)
    view.state([], on_phone=nobody)
    assert computed == []
    participants[2].tell([told(1)], session=SESSION)
    state = view.state([], on_phone=lambda name: name == "P02")
    assert computed == ["t1"]
    assert [p.on_phone for p in state.participants] == [False, True, False, False, False]
    assert [p.trials[0].peaked_share for p in state.participants] == [None, None, 0.5, None, None]
    begin(study, 6)
    assert len(view.state([], on_phone=nobody).participants) == 6


def test_what_a_participant_asks_does_not_grow_with_what_phones_tell(study: OpenStudy) -> None:
    (participant,) = begin(study, 1)
    before = len(participant.sparse_events)
    for batch in range(20):
        events = [told(200 * batch + number) for number in range(200)]
        participant.tell(events, session=SESSION)
    assert len(participant.events) > 4000
    assert len(participant.sparse_events) == before


def test_the_record_of_a_trial_is_that_of_the_whole_log(study: OpenStudy) -> None:
    (participant,) = begin(study, 1)
    steps = ["t1.capture", "t1.practice", "t2.capture"]
    participant.tell([told(n, steps[n % 3]) for n in range(30)], session=SESSION)
    whole = record_of(participant.events)
    assert [participant.trial_record(t.trial) for t in whole.trials] == whole.trials
    again = OpenStudy(study.folder, study.sessions).get("P01")
    assert again.events == participant.events
    assert again.sparse_events == participant.sparse_events
    assert [again.trial_record(t.trial) for t in whole.trials] == whole.trials


def form_of(study: OpenStudy) -> tuple[OpenParticipant, str, str]:
    """Return a participant who is at a form, its step, and one of its items."""
    (participant,) = begin(study, 1)
    while (now := participant.current) is not None and now[0].questionnaire is None:
        participant.start(now[0].key)
        participant.stop(now[0].key, by="experimenter")
    assert now is not None
    name = now[0].questionnaire
    assert name is not None
    return participant, now[0].key, study.protocol.questionnaire(name).items[0].id


def test_drafts_are_bounded(study: OpenStudy, monkeypatch: pytest.MonkeyPatch) -> None:
    participant, step, item = form_of(study)
    with pytest.raises(TooMuch):
        participant.keep_draft(step, wire.Draft({item: "x" * 200_000}))
    participant.keep_draft(step, wire.Draft({item: "same"}))
    kept = len(participant.events)
    participant.keep_draft(step, wire.Draft({item: "same"}))
    assert len(participant.events) == kept
    monkeypatch.setattr(open_participant, "MAX_DRAFTS_BYTES", 1000)

    def type_on() -> None:
        for number in range(1000):
            participant.keep_draft(step, wire.Draft({item: f"other {number}"}))

    with pytest.raises(TooMuch, match="Hand the form in"):
        type_on()
    assert len(participant.events) < kept + 100


def test_what_phones_tell_is_bounded(study: OpenStudy, monkeypatch: pytest.MonkeyPatch) -> None:
    (participant,) = begin(study, 1)
    monkeypatch.setattr(open_participant, "MAX_TOLD", 10)
    participant.tell([told(number) for number in range(10)], session=SESSION)
    participant.tell([told(number) for number in range(10)], session=SESSION)
    with pytest.raises(TooMuch):
        participant.tell([told(10)], session=SESSION)
