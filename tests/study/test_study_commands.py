"""`peaking study init`, `export`, `erase`: what they write, and one sentence for what is wrong."""

from __future__ import annotations

import shutil
import tomllib
import zipfile
from pathlib import Path

import pytest

from peaking.cli import main
from peaking.study.privacy import erased
from peaking.study.procedure import states_of, steps_of
from peaking.study.protocol import FILE_NAME, load_protocol, trials_of
from peaking.study.records import (
    Answered,
    SessionLinked,
    StepFinished,
    StepRepeated,
    StepStarted,
    log_of,
    participant_folder,
    pseudonyms,
)
from peaking.study.texts import Texts, english
from study.test_protocol import SMALL
from study.test_records import BEGUN, capture

SESSION = "5e551011-0000-4000-8000-000000000001"


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as caught:
        main(["study", *words])
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("peaking: ")
    assert said.count("\n") == 1
    return said


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "study"
    participant_folder(folder, "P01").mkdir(parents=True)
    (folder / FILE_NAME).write_text(SMALL)
    answers = {f"q{i}": 3 for i in range(1, 11)}
    log_of(folder, "P01").append(
        BEGUN,
        SessionLinked(at_s=1.0, step="t1.capture", session=SESSION),
        *capture(),
        Answered(at_s=80.0, step="t1.ask.sus", questionnaire="sus", answers={**answers}),
    )
    captured = folder / "sessions" / "2026-01-01_120000_5e551011"
    (captured / "images").mkdir(parents=True)
    (captured / "mpi").mkdir()
    (captured / "log.jsonl").write_text(f'{{"session":{{"id":"{SESSION}"}}}}\n')
    (captured / "images" / "000001.jpg").write_bytes(b"photo")
    (captured / "mpi" / "000001.mpi").write_bytes(b"cache")
    (captured / "removed" / "images").mkdir(parents=True)
    (captured / "removed" / "images" / "000002.jpg").write_bytes(b"undone")
    other = folder / "sessions" / "other"
    other.mkdir()
    (other / "log.jsonl").write_text('{"session":{"id":"somebody-else"}}\n')
    return folder


def test_init_writes_a_protocol_that_is_sound_and_leaves_it_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "study"
    main(["study", "init", str(folder)])
    protocol = load_protocol(folder)
    assert [c.name for c in protocol.conditions] == ["llff", "peaking"]
    edited = (folder / FILE_NAME).read_text().replace("= 20 ", "= 21 ").replace("= 20\n", "= 21\n")
    (folder / FILE_NAME).write_text(edited)
    capsys.readouterr()
    main(["study", "init", str(folder)])
    assert (folder / FILE_NAME).read_text() == edited
    assert "an odd number" in capsys.readouterr().out


def test_the_steps_of_the_example(tmp_path: Path) -> None:
    main(["study", "init", str(tmp_path / "study")])
    protocol = load_protocol(tmp_path / "study")
    steps = steps_of(protocol, trials_of(protocol, 0))
    keys = [step.key for step in steps]
    assert keys[:3] == ["consent", "start.ask.demographics", "introduction"]
    assert keys[-1] == "end.ask.comments"
    assert sum(step.kind == "scan" for step in steps) == 1
    events = [StepFinished(at_s=1.0, step=key) for key in keys[:2]]
    assert states_of(steps, events)[:4] == ["done", "done", "waiting", "waiting"]
    started = [*events, StepStarted(at_s=2.0, step="introduction")]
    assert states_of(steps, started)[2] == "running"
    again = [*started, StepRepeated(at_s=3.0, step=keys[1], reason="?")]
    assert states_of(steps, again)[:3] == ["done", "running", "waiting"]


def test_a_translation_is_a_file_to_write_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "study"
    main(["study", "init", str(folder), "--language", "de"])
    path = folder / "translations" / "de.toml"
    words = tomllib.loads(path.read_text())
    assert words["pages"] == english()
    assert len(words["sus"]["items"]) == 10
    protocol = folder / FILE_NAME
    protocol.write_text(protocol.read_text().replace('language = "en"', 'language = "de"'))
    assert len(Texts(load_protocol(folder), folder).untranslated()) > 20
    path.write_text(
        '[pages]\nhand_in = "Abgeben"\n[sus.items.q1]\ntext = "Gern"\n[demographics.items.hand]\n'
        'choices = { left = "Links" }\n[protocol]\ncapture = "Nimm auf."\n'
    )
    texts = Texts(load_protocol(folder), folder)
    assert texts.pages["hand_in"] == "Abgeben"
    assert texts.pages["continue"] == "Continue"
    assert texts.form("sus").item("q1").text == "Gern"
    assert texts.form("sus").item("q2").text.startswith("I found")
    assert [c.text for c in texts.form("demographics").item("hand").choices][1] == "Links"
    assert texts.task("capture") == "Nimm auf."
    assert "exists already" in refused(capsys, "init", str(folder), "--language", "de")
    assert "need --language" in refused(capsys, "init", str(folder), "--language", "../x")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("[pages]\nhand = 1", "de.toml: pages"),
        ('[pages]\nhand = "x"', "pages.hand: there is no such text"),
        ("[nothing]", "nothing: is no questionnaire"),
        ('[sus.items.q11]\ntext = "x"', "sus.items.q11: there is no such item"),
        (
            '[demographics.items.hand.choices]\nthird = "x"',
            "demographics.items.hand.choices.third: there is no such choice",
        ),
        ("[sus", "is not TOML"),
    ],
)
def test_a_wrong_translation_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, said: str
) -> None:
    folder = tmp_path / "study"
    main(["study", "init", str(folder), "--language", "de"])
    protocol = folder / FILE_NAME
    protocol.write_text(protocol.read_text().replace('language = "en"', 'language = "de"'))
    (folder / "translations" / "de.toml").write_text(words)
    capsys.readouterr()
    assert said in refused(capsys, "serve", str(folder), "--local", "--port", "0")


def test_serve_says_what_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in (tmp_path / "nowhere", tmp_path):
        assert "peaking study init" in refused(capsys, "serve", str(folder), "--local")
        assert "there is no participant" in refused(capsys, "erase", str(folder), "P01", "--yes")
    assert list(tmp_path.iterdir()) == []


def test_export_is_all_there_is_of_one_participant(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "P01.zip"
    main(["study", "export", str(study), "P01", "--out", str(out)])
    with zipfile.ZipFile(out) as files:
        names = files.namelist()
        assert files.read("events.jsonl") == log_of(study, "P01").path.read_bytes()
        assert "t1,sus,q1,3" in files.read("answers.csv").decode()
        assert "t1,peaking,desk,tct_s,55.0" in files.read("measures.csv").decode()
        assert "undid are not in it" in files.read("README.txt").decode()
    photos = [name for name in names if name.startswith("sessions/")]
    assert [Path(name).name for name in photos] == ["000001.jpg", "log.jsonl"]


def test_an_export_that_is_refused_leaves_nothing(study: Path, tmp_path: Path) -> None:
    outside = tmp_path / "secret"
    outside.write_text("secret")
    (captured,) = (study / "sessions").glob("*_5e551011")
    (captured / "images" / "000003.jpg").symlink_to(outside)
    out = tmp_path / "out" / "P01.zip"
    with pytest.raises(SystemExit):
        main(["study", "export", str(study), "P01", "--out", str(out)])
    assert not out.parent.exists()


def test_erase_leaves_nothing_but_the_pseudonym(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["study", "erase", str(study), "P01", "--yes"])
    assert pseudonyms(study) == []
    assert [path.name for path in (study / "sessions").glob("[!.]*")] == ["other"]
    assert list((study / "sessions" / ".deleted").iterdir()) == []
    left = b"".join(path.read_bytes() for path in study.rglob("*") if path.is_file())
    assert b"q1" not in left
    assert b'"participant":"P01"' in (study / "erased.jsonl").read_bytes()
    capsys.readouterr()
    assert "there is no participant 'P01'" in refused(capsys, "erase", str(study), "P01", "--yes")


def test_erase_after_a_power_cut_within_the_list_of_the_erased(study: Path) -> None:
    (study / "erased.jsonl").write_bytes(b'{"participant":"P09","at_s":17')
    main(["study", "erase", str(study), "P01", "--yes"])
    assert not participant_folder(study, "P01").exists()
    assert [path.name for path in (study / "sessions").glob("[!.]*")] == ["other"]
    assert [entry.participant for entry in erased(study)] == ["P01"]


def test_what_cannot_be_erased_is_said(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        """Delete nothing, as a disk that is mounted read-only."""

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", refuse)
        said = refused(capsys, "erase", str(study), "P01", "--yes")
    assert "something is left" in said
    main(["study", "erase", str(study), "P01", "--yes"])
    assert not participant_folder(study, "P01").exists()
    assert not any(path.read_bytes() == b"photo" for path in study.rglob("*.jpg"))


def test_erase_asks_first(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no(_: str) -> str:
        return "no"

    monkeypatch.setattr("builtins.input", no)
    main(["study", "erase", str(study), "P01"])
    assert pseudonyms(study) == ["P01"]


def test_export_of_nobody(study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "x.zip"
    said = refused(capsys, "export", str(study), "P07", "--out", str(out))
    assert "choose from: P01" in said
    assert not out.exists()
    said = refused(capsys, "export", str(tmp_path / "no"), "P01", "--out", str(out))
    assert "none yet" in said
