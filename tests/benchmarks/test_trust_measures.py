"""`peaking bench trust` on a small made scene: it is hard to fool."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trust_rules import Rule, at_random, everything, nothing, oracle

from peaking.benchmarks.trust import false_red, seen, steady, true_red
from peaking.benchmarks.trust import stage as stage_module
from peaking.benchmarks.trust.constructed import MAKERS
from peaking.benchmarks.trust.run import MEASURE_NAMES, measure_scenes
from peaking.benchmarks.trust.scene import open_trust_scene
from peaking.benchmarks.trust.scores import Marks
from peaking.benchmarks.trust.stage import QUICK, VIEWS, Plan, Stage, as_picture
from peaking.benchmarks.trust.table import as_markdown
from peaking.cli import main
from peaking.geometry import Camera, Rigid
from peaking.options import DEFAULT
from recordings import lateral_cameras, write_recording

WIDTH_PX, HEIGHT_PX = 96, 128
SMALL = replace(DEFAULT, pixels=WIDTH_PX * HEIGHT_PX)
FEW = Plan(poses=1, constructed=1, steps=2, frames=6)


def walk(count: int = 24) -> list[Camera]:
    """Return cameras that step sideways by 1.5 cm."""
    middle = lateral_cameras(1, WIDTH_PX, HEIGHT_PX)[0]
    steps_m = 0.015 * (np.arange(count) - count / 2)
    return [
        Camera(middle.pinhole, Rigid(np.eye(3), np.array([x_m, 0.004 * (i % 2), 0.0])))
        for i, x_m in enumerate(steps_m)
    ]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("trust") / "made", cameras=walk())


@pytest.fixture(scope="module")
def stage(root: Path) -> Stage:
    return Stage(open_trust_scene(root), SMALL, plan=QUICK)


@pytest.fixture(scope="module")
def document(root: Path) -> dict[str, Any]:
    return measure_scenes([root], options=SMALL, plan=FEW)


@pytest.fixture(scope="module")
def true_pictures(stage: Stage) -> list[false_red.Question]:
    numbers = stage.views(VIEWS)
    judge = stage.judge(numbers)
    return [q for i in stage.close_to(numbers, 1) for q in false_red.questions(stage, judge, i)]


@pytest.fixture(scope="module")
def faulty_pictures(stage: Stage) -> list[true_red.Question]:
    return [question for _, question in true_red.questions(stage)]


def false_share(asked: list[false_red.Question], rule: Rule) -> float:
    return float(np.mean([rule(q).red[q.counted].mean() for q in asked]))


def found_by(asked: list[true_red.Question], rule: Rule) -> true_red.Tally:
    tally = true_red.Tally()
    for question in asked:
        tally.add(question, rule(question))
    return tally


def test_who_marks_nothing_fails_true_red(true_pictures: Any, faulty_pictures: Any) -> None:
    found = found_by(faulty_pictures, nothing).of()
    assert false_share(true_pictures, nothing) == 0
    assert (found.recall, found.auc) == (0, 0.5)


def test_who_marks_everything_fails_false_red(true_pictures: Any, faulty_pictures: Any) -> None:
    found = found_by(faulty_pictures, everything).of()
    assert false_share(true_pictures, everything) == 1
    assert (found.recall, found.auc) == (1, 0.5)


def test_who_marks_at_random_fails_both(true_pictures: Any, faulty_pictures: Any) -> None:
    found = found_by(faulty_pictures, at_random).of()
    assert false_share(true_pictures, at_random) == pytest.approx(0.1, abs=0.01)
    assert found.auc == pytest.approx(0.5, abs=0.01)
    assert found.recall == pytest.approx(0.1, abs=0.01)


def test_who_knows_passes_both(true_pictures: Any, faulty_pictures: Any) -> None:
    tally = found_by(faulty_pictures, oracle)
    assert false_share(true_pictures, oracle) == 0
    for kind in tally.kinds:
        found = tally.of(kind)
        assert (found.auc, found.recall, found.precision) == (1, 1, 1), kind
        assert found.recall_at(1.0) == 1, kind


def test_every_fault_finds_a_place(faulty_pictures: Any) -> None:
    kinds = found_by(faulty_pictures, nothing).kinds
    assert set(MAKERS) <= set(kinds)
    assert {"parallax_5_cm", "parallax_10_cm"} <= set(kinds)


def test_a_fault_is_where_it_is_said_to_be(stage: Stage) -> None:
    """Where nothing is wrong, the picture and the rendering are the same."""
    numbers = stage.views(VIEWS)
    judge = stage.judge(numbers)
    index = stage.close_to(numbers, 1)[0]
    rendering = judge.render(stage.frame(index).camera)
    for kind, make in MAKERS.items():
        fault = make(rendering, stage.rng(kind))
        assert fault is not None
        shown = rendering if fault.change is None else fault.change(rendering)
        off = np.abs(as_picture(shown).astype(int) - fault.live).sum(axis=-1)
        assert fault.wrong.any(), kind
        assert not (fault.wrong & fault.right).any(), kind
        assert off[fault.right].max(initial=0) <= 0.01 * 255 + 3, kind
        assert off[fault.wrong].min() >= 0.2 * 255 - 3, kind


def test_true_pictures_have_no_red(stage: Stage, true_pictures: Any) -> None:
    judge = stage.judge(stage.views(VIEWS))
    for question in (q for q in true_pictures if q.name == "none"):
        said = judge.compare(question.live, question.told)
        assert not said["ours"].red[question.counted].any()
        assert not said["paper"].red[question.counted].any()


def test_a_perfect_mark_of_what_was_never_seen(stage: Stage) -> None:
    marks = Marks()
    true, known = stage.seen_truth(stage.views(3), stage.held_out("beyond")[-1])
    marks.add(~true, ~true, known)
    assert marks.true > 50
    assert marks.as_dict()["precision"] == marks.as_dict()["recall"] == 1


def test_the_same_points_of_one_frame_are_its_own(stage: Stage) -> None:
    camera, depth_m = stage.frame(3).camera, stage.depth_m(3)
    sources_px, same = steady.same_points(depth_m, camera, depth_m, camera)
    assert same.all()
    x, y = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    np.testing.assert_allclose(sources_px, np.stack([x, y], axis=-1), atol=1e-3)


def test_brightness_of_grey_is_grey() -> None:
    grey = np.full((2, 2, 3), 51, np.uint8)
    np.testing.assert_allclose(seen.luma(grey), 0.2, atol=1e-6)


def test_all_measures_are_there_with_the_papers_beside(document: dict[str, Any]) -> None:
    (scene,) = document["scenes"]
    assert list(scene) == ["scene", *MEASURE_NAMES]
    assert all("paper" in scene[name] for name in MEASURE_NAMES)
    assert scene["steady"]["pairs"] > 0
    assert scene["useful"]["regions"] > 0
    assert json.loads(json.dumps(document)) is not None


def test_the_same_figures_twice(root: Path, document: dict[str, Any]) -> None:
    again: dict[str, Any] = measure_scenes(
        [root], only=["false_red", "pose"], options=SMALL, plan=FEW
    )
    (first,), (second,) = document["scenes"], again["scenes"]
    assert second == {name: first[name] for name in ("scene", "false_red", "pose")}


def test_the_table_has_a_line_for_every_measure(document: dict[str, Any]) -> None:
    lines = as_markdown(document).splitlines()
    for name in MEASURE_NAMES:
        assert any(line.startswith(f"| {name}") for line in lines)


def test_the_command_measures_what_is_asked_for(
    root: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stage_module, "QUICK", FEW)
    out = tmp_path / "trust.json"
    main(["bench", "trust", str(root), "--quick", "--only", "steady,useful", "--json", str(out)])
    (scene,) = json.loads(out.read_text())["scenes"]
    assert list(scene) == ["scene", "useful", "steady"]
    assert "| useful: Pearson |" in capsys.readouterr().out


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "trust", *arguments])
    assert ended.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


def test_an_unknown_measure_is_refused(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails([str(root), "--only", "steady,speed"], capsys)
    assert "--only" in said
    assert said.endswith("got speed")


def test_a_scene_without_depth_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flat = write_recording(tmp_path / "flat", num_frames=12, with_depth=False)
    assert "depth" in fails([str(flat)], capsys)
