"""The loop on a drawn room: red where nothing was seen, gone once it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import Recording, open_recording
from peaking.errors import PeakingError
from peaking.options import DEFAULT, PAPER, PRESETS, Options
from peaking.pipeline import Reconstruction
from peaking.timing import Stopwatch
from recordings import write_recording

SMALL = 160 * 120


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("room") / "room"
    return open_recording(write_recording(folder, num_frames=6, width_px=160, height_px=120))


@pytest.mark.parametrize("options", (DEFAULT, PAPER), ids=("default", "paper"))
def test_at_a_captured_view_nothing_is_red(recording: Recording, options: Options) -> None:
    scene = Reconstruction(replace(options, pixels=SMALL))
    frame = recording.read(0)
    scene.add_view(frame)
    small = scene.prepare(frame)
    seen = scene.compare(small.rgb, small.camera)
    assert seen.errors.peaked_share < 0.001
    assert seen.neighbours[0].weight == 1.0


def test_the_next_view_takes_the_red_away(recording: Recording) -> None:
    scene = Reconstruction(replace(DEFAULT, pixels=SMALL))
    scene.add_view(recording.read(0))
    last = scene.prepare(recording.read(len(recording) - 1))
    before = scene.compare(last.rgb, last.camera).errors
    scene.add_view(recording.read(len(recording) - 1))
    after = scene.compare(last.rgb, last.camera).errors
    assert before.peaked_share > 0.02
    assert after.peaked_share < before.peaked_share / 5


def test_a_metric_mpi_has_the_depth_of_the_room(recording: Recording) -> None:
    scene = Reconstruction(replace(DEFAULT, pixels=SMALL))
    frame = recording.read(2)
    assert frame.depth_m is not None
    scene.add_view(frame)
    small = scene.prepare(frame)
    view = scene.render(small.camera)
    ratio = view.depth_m / frame.depth_m
    assert abs(np.median(ratio) - 1) < 0.01


def test_a_frame_without_depth_is_refused_by_name(recording: Recording) -> None:
    frame = replace(recording.read(0), depth_m=None)
    scene = Reconstruction(DEFAULT)
    with pytest.raises(PeakingError, match=f"{frame.name}: no metric depth"):
        scene.add_view(frame)
    assert scene.views == []


def test_before_the_first_view_there_is_nothing_to_see(recording: Recording) -> None:
    scene = Reconstruction(replace(DEFAULT, pixels=SMALL))
    small = scene.prepare(recording.read(0))
    with pytest.raises(ValueError, match="at least one captured view"):
        scene.compare(small.rgb, small.camera)


def test_stages_are_timed_by_the_clock_that_is_handed_in(recording: Recording) -> None:
    ticks = iter(range(1000))
    watch = Stopwatch(lambda: float(next(ticks)))
    scene = Reconstruction(replace(DEFAULT, pixels=SMALL), stopwatch=watch)
    scene.add_view(recording.read(0))
    taken = watch.take()
    assert list(taken) == ["prepare", "complete", "generate", "align"]
    assert set(taken.values()) == {1000.0}
    assert watch.take() == {}


def test_presets_differ_only_in_named_options() -> None:
    assert PAPER.neighbours == 3
    assert PAPER.error_threshold == 0.4
    assert PAPER.num_planes == 32
    assert (PAPER.blend_weights, PAPER.opacity, PAPER.align) == ("paper", "paper", "paper")
    assert (PAPER.shift_px, PAPER.compensate_exposure) == (0, False)
    assert set(PRESETS) == {"default", "paper"}
    assert PRESETS["default"].generator == PRESETS["paper"].generator


@pytest.mark.parametrize(
    "bad", [{"pixels": 10}, {"num_planes": 1}, {"neighbours": 0}, {"error_threshold": 0.0}]
)
def test_impossible_options_are_refused(bad: dict[str, float], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="need"):
        replace(DEFAULT, **bad)  # type: ignore[arg-type]
