from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import pytest

from peaking.cli import main
from peaking.commands.photographers import Photographers
from peaking.datasets import open_recording
from peaking.experiments.executors import Executor, InProcess
from peaking.experiments.plan import EvaluationStep
from peaking.experiments.steps import Found
from peaking.photographers.steps import perform

WORDS = (
    "--scenes", "desk", "--guides", "interval", "llff", "threshold", "auto", "--photos", "2", "4",
    "--photographers", "2", "--seconds", "8", "--test-views", "2",
)  # fmt: skip


class Counting:
    """Does steps here, and counts them; can be made to break off."""

    def __init__(self, stop_after: int | None = None) -> None:
        self.done = 0
        self._stop_after = stop_after

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        for step, found in InProcess(perform=perform).run(steps):
            if self.done == self._stop_after:
                raise KeyboardInterrupt
            self.done += 1
            yield step, found


def use(monkeypatch: pytest.MonkeyPatch, executor: Executor) -> None:
    def chosen(_: Photographers) -> Executor:
        return executor

    monkeypatch.setattr(Photographers, "_executor", chosen)


@pytest.mark.usefixtures("drawn")
def test_it_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "out.json"
    words = ["photographers", "--json", str(file), *WORDS]
    broken = Counting(stop_after=5)
    use(monkeypatch, broken)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 130
    assert not file.exists()
    rest = Counting()
    use(monkeypatch, rest)
    main(words)
    assert rest.done == 2 * 4 - broken.done
    printed = capsys.readouterr().out
    assert "| desk (tuning) | interval |" in printed
    assert "auto minus others" in printed
    found = json.loads(file.read_text())
    assert len(found["photographers"]) == 2 * 4 * 2
    assert {home["guide"] for home in found["photographers"]} == set(WORDS[3:7])
    assert all(home["kept"] <= home["photos"] for home in found["photographers"])
    out = tmp_path / "out"
    assert json.loads((out / "results.json").read_text()) == found
    assert (out / "table.md").read_text().splitlines()[0] in printed
    for name in ("desk.png", "desk-paths.png"):
        assert cv2.imread(str(out / name)) is not None
    again = Counting()
    use(monkeypatch, again)
    main(words)
    assert again.done == 0
    once_more = json.loads(file.read_text())
    assert once_more["photographers"] == found["photographers"]
    assert once_more["differences"] == found["differences"]


@pytest.mark.usefixtures("drawn")
def test_gaussians_are_trained_for_some(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "out.json"
    use(monkeypatch, InProcess(perform=perform))
    words = ["photographers", "--json", str(file), "--scenes", "desk", "--guides", "interval"]
    words += ["--photos", "2", "--photographers", "2", "--seconds", "4", "--test-views", "1"]
    main([*words, "--splats", "1", "--iterations", "3"])
    homes = json.loads(file.read_text())["photographers"]
    assert [home["model"] for home in homes] == ["mpi", "mpi", "3dgs"]


def test_wrong_arguments_are_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, said in (
        (["--json", str(tmp_path / "a.json"), "--photos", "0"], "--photos >= 1"),
        (["--json", str(tmp_path / "a")], "need --out"),
        ([], "need --json"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["photographers", *words])
        assert ended.value.code == 2
        assert said in capsys.readouterr().err


def test_a_folder_of_something_else_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("mine")
    with pytest.raises(SystemExit):
        main(["photographers", "--json", str(tmp_path / "out.json")])
    assert "holds thesis.tex" in capsys.readouterr().err


@pytest.mark.usefixtures("drawn")
def test_walks_can_be_evaluated(tmp_path: Path) -> None:
    words = ["--walks", str(tmp_path / "walks"), "--scenes", "desk", "--photographers", "2"]
    main(["photographers", *words, "--seconds", "2"])
    names = sorted(path.name for path in (tmp_path / "walks").iterdir())
    assert names == ["desk-walk-0", "desk-walk-1"]
    recording = open_recording(tmp_path / "walks" / "desk-walk-0")
    assert len(recording) == 10
    assert all(recording.has_depth)
    assert list(recording.timestamps_s[:2]) == [0.0, 0.2]
