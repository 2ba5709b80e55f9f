"""The loop on a drawn room: red where nothing was seen, gone once it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from peaking.commands.options import MethodOptions
from peaking.datasets import Recording, open_recording
from peaking.errors import PeakingError
from peaking.geometry import Cam, Rigid
from peaking.options import DEFAULT, PAPER, PRESETS, Options
from peaking.pipeline import Reconstruction
from peaking.timing import Stopwatch
from peaking.tracking import apart
from peaking.tracking.solution import rotation_of
from peaking.view_weights import Neighbour
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


def light_field_of(options: Options, recording: Recording, views: Sequence[int]) -> Reconstruction:
    field = Reconstruction(replace(options, pixels=SMALL))
    for index in views:
        field.add_view(recording.read(index))
    return field


def test_each_difference_between_the_presets_is_an_option_of_the_command_line() -> None:
    differ = {
        field.name: getattr(PAPER, field.name)
        for field in fields(Options)
        if getattr(PAPER, field.name) != getattr(DEFAULT, field.name)
    }
    assert differ
    assert MethodOptions(preset="default", **differ).options() == PAPER
    assert MethodOptions(preset="paper").options() == PAPER
    assert MethodOptions().options() == DEFAULT
    assert set(PRESETS) == {"default", "paper"}


def test_the_paper_counts_an_exposure_and_half_a_pixel_of_displacement_as_errors(
    recording: Recording,
) -> None:
    """Neither goes away by taking more views, so the default forgives them.

    Without a correction of the pose, which would take the displacement for a turn.
    """
    default = replace(DEFAULT, align_poses=False)
    small = light_field_of(PAPER, recording, []).prepare(recording.read(2))
    darker = (0.6 * small.rgb).astype(np.uint8)
    beside = np.hstack([small.rgb[:, :1], small.rgb[:, :-1]])
    displaced = (small.rgb / 2 + beside / 2).astype(np.uint8)
    shares = {
        (name, live): light_field_of(options, recording, [2]).compare(rgb, small.camera).errors
        for name, options in (("paper", PAPER), ("default", default))
        for live, rgb in (("darker", darker), ("displaced", displaced))
    }
    peaked = {key: errors.peaked_share for key, errors in shares.items()}
    assert peaked["paper", "darker"] > 0.5
    assert peaked["default", "darker"] < 0.01
    assert peaked["paper", "displaced"] > 0.002
    assert peaked["default", "displaced"] < 0.001


def test_a_pose_is_corrected_before_it_is_compared(recording: Recording) -> None:
    """A turn of 0.4 degrees is 0.5 px here; the paper takes the pose as it is told."""
    scenes = {
        name: light_field_of(options, recording, [1, 3])
        for name, options in (("paper", PAPER), ("default", DEFAULT))
    }
    live = scenes["default"].prepare(recording.read(2))
    off: Rigid[Cam, Cam] = Rigid(rotation_of(np.array([0.0, 0.007, 0.0])), np.zeros(3))
    told = replace(live.camera, world_from_cam=live.camera.world_from_cam @ off)
    seen = {name: scene.compare(live.rgb, told) for name, scene in scenes.items()}
    assert seen["paper"].alignment is None
    alignment = seen["default"].alignment
    assert alignment is not None
    assert alignment.ok
    assert apart(alignment.camera, live.camera)[1] < 0.3 * apart(told, live.camera)[1]
    off_scene = light_field_of(replace(DEFAULT, align_poses=False), recording, [1, 3])
    uncorrected = off_scene.compare(live.rgb, told)
    assert seen["default"].errors.mean_error < uncorrected.errors.mean_error


def test_the_paper_blends_three_views_and_dims_what_some_did_not_see(recording: Recording) -> None:
    """The default blends four, and shows what one of them saw in full."""
    target = light_field_of(PAPER, recording, []).prepare(recording.read(5))
    views = [0, 1, 2, 3, 4]
    paper, in_full, default = (
        light_field_of(options, recording, views).compare(target.rgb, target.camera)
        for options in (PAPER, replace(PAPER, opacity=DEFAULT.opacity), DEFAULT)
    )
    assert (len(paper.neighbours), len(default.neighbours)) == (3, 4)
    assert (paper.rendering.alpha <= in_full.rendering.alpha + 1e-6).all()
    assert (paper.rendering.alpha < in_full.rendering.alpha - 0.1).mean() > 0.01


def test_at_a_captured_view_the_default_shows_that_view_alone(recording: Recording) -> None:
    """The paper's weights, exp(-l/γ), leave it 1 / (1 + 2/e) beside two views 5 cm away."""
    nearest: dict[str, Neighbour] = {}
    for name, options in (("paper", PAPER), ("default", DEFAULT)):
        scene = light_field_of(options, recording, [0, 1, 2, 3, 4])
        target = scene.prepare(recording.read(2))
        nearest[name] = scene.compare(target.rgb, target.camera).neighbours[0]
    assert {neighbour.index for neighbour in nearest.values()} == {2}
    assert nearest["paper"].weight == pytest.approx(1 / (1 + 2 / np.e), abs=0.01)
    assert nearest["default"].weight > 0.9


@pytest.mark.parametrize(
    "bad", [{"pixels": 10}, {"num_planes": 1}, {"neighbours": 0}, {"error_threshold": 0.0}]
)
def test_impossible_options_are_refused(bad: dict[str, float], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="need"):
        replace(DEFAULT, **bad)  # type: ignore[arg-type]
