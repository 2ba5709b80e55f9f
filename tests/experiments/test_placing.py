"""3D Gaussians at COLMAP's cameras: what is done with them, and (`-m colmap`) with COLMAP."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evaluate_factories import SIZE_PX

from peaking.datasets import open_recording
from peaking.errors import BackendUnavailable, CamerasNotFound, RecordingError
from peaking.experiments import placing
from peaking.experiments.executors import InProcess
from peaking.experiments.placing import Placement, at_pose, pose_of
from peaking.experiments.plan import EvaluationOptions, EvaluationStep, PlaceStep
from peaking.experiments.reconstruct import SplatTraining
from peaking.experiments.run import evaluate
from peaking.experiments.steps import Found, perform
from peaking.experiments.tables import Evaluation, table_md
from peaking.frame import Frame
from peaking.geometry import Camera, Rigid
from peaking.options import DEFAULT
from peaking.point_cloud import PointCloud
from peaking.poses.colmap import Estimate
from recordings import lateral_cameras

DESK = Path(__file__).parents[2] / "scenes" / "desk"
AGREE_DB = 0.5
"""Mean PSNR, COLMAP's cameras against exact ones. Measured (November 2026): 29.09 dB,
exact 29.15 dB."""
TESTED = [2, 6, 10, 14, 18, 22]


@pytest.fixture
def plan(walk: Path) -> EvaluationOptions:
    return EvaluationOptions(
        scenes=(walk,),
        options=replace(DEFAULT, pixels=48 * 64, num_planes=8),
        strategies=("uniform", "farthest"),
        reconstruct=("mpi", "3dgs"),
        views=(4,),
        splat=SplatTraining(iterations=60, pixels=SIZE_PX[0] * SIZE_PX[1]),
        cameras="colmap",
    )


class Told:
    """Stands for COLMAP: says what it is told, and counts how often it is asked."""

    def __init__(self, *, without: Sequence[int] = (), aside_m: float = 0.0) -> None:
        self.asked = 0
        self._without = without
        self._aside_m = aside_m

    def __call__(self, frames: Sequence[Frame]) -> Estimate:
        self.asked += 1
        cameras: list[Camera | None] = [self._moved(i, f.camera) for i, f in enumerate(frames)]
        return Estimate(cameras, PointCloud.joined([]), 1.0, self._aside_m)

    def _moved(self, index: int, camera: Camera) -> Camera | None:
        """Move test views alone, so that they are off from what was trained."""
        if index in self._without:
            return None
        aside_m = np.array([self._aside_m if index in TESTED else 0.0, 0.0, 0.0])
        pose = camera.world_from_cam
        return replace(camera, world_from_cam=Rigid(pose.rotation, pose.translation_m + aside_m))


def psnrs(found: Evaluation, reconstruct: str) -> list[list[float]]:
    return [
        [score.psnr for score in result.scores]
        for result in found.results
        if result.case.reconstruct == reconstruct
    ]


def test_cameras_where_they_were_recorded_change_nothing(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(placing, "estimate_cameras", Told())
    placed = evaluate(plan, tmp_path / "placed", InProcess())
    recorded = evaluate(replace(plan, cameras="recorded"), tmp_path / "recorded", InProcess())
    for how in ("mpi", "3dgs"):
        np.testing.assert_allclose(psnrs(placed, how), psnrs(recorded, how), atol=1e-3)
    assert not recorded.notes


def test_gaussians_and_only_they_are_seen_from_the_cameras_that_colmap_says(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(placing, "estimate_cameras", Told())
    right = evaluate(plan, tmp_path / "right", InProcess())
    monkeypatch.setattr(placing, "estimate_cameras", Told(aside_m=0.2))
    wrong = evaluate(plan, tmp_path / "wrong", InProcess())
    assert psnrs(right, "mpi") == psnrs(wrong, "mpi")
    assert np.mean(psnrs(right, "3dgs")) > np.mean(psnrs(wrong, "3dgs")) + 1


def test_what_cannot_be_placed_is_neither_trained_on_nor_tested_and_said(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frame 0 is the first view of both strategies; frame 6 is a test view."""
    monkeypatch.setattr(placing, "estimate_cameras", Told(without=(0, 6)))
    found = evaluate(plan, tmp_path / "out", InProcess())
    for result in found.results:
        with_gaussians = result.case.reconstruct == "3dgs"
        tested = [i for i in TESTED if i != 6] if with_gaussians else TESTED
        assert [score.view for score in result.scores] == tested
        assert result.views[0] == 0
        assert result.row()["n_views"] == 4
        assert result.row()["n_lost"] == (1 if with_gaussians else 0)
    (note,) = found.notes
    assert note.startswith("walk: COLMAP placed 22 of 24 frames, 0.0 cm (RMS)")
    assert "neither trains on the other 2 nor is tested there" in note
    assert note in table_md(found)
    assert note in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_colmap_is_asked_once_whatever_is_evaluated(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    colmap = Told()
    monkeypatch.setattr(placing, "estimate_cameras", colmap)
    evaluate(plan, tmp_path / "out", InProcess())
    again = Noting()
    evaluate(replace(plan, views=(3,)), tmp_path / "out", again)
    assert colmap.asked == 1
    assert again.done
    assert not any(isinstance(step, PlaceStep) for step in again.done)


class Noting:
    """Does steps here, and notes them."""

    def __init__(self) -> None:
        self.done: list[EvaluationStep] = []

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        for step in steps:
            self.done.append(step)
            yield step, perform(step)


def test_without_a_placed_test_view_there_is_nothing_to_say(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(placing, "estimate_cameras", Told(without=TESTED))
    with pytest.raises(RecordingError, match=r"0 of the 6 test views; take --cameras recorded"):
        evaluate(plan, tmp_path / "out", InProcess())
    assert not (tmp_path / "out" / "results.json").exists()


def test_without_pycolmap_it_is_said_before_anything_is_chosen(
    plan: EvaluationOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    noting = Noting()
    with pytest.raises(BackendUnavailable, match=r"pip install 'peaking\[colmap\]', or take"):
        evaluate(plan, tmp_path / "out", noting)
    assert [type(step) for step in noting.done] == [PlaceStep]


def test_pictures_that_cannot_be_joined_are_said_with_the_recording(
    plan: EvaluationOptions, walk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(frames: Sequence[Frame]) -> Estimate:
        raise CamerasNotFound("COLMAP could not join three of the pictures")

    monkeypatch.setattr(placing, "estimate_cameras", lost)
    with pytest.raises(CamerasNotFound, match=f"{walk / 'transforms.json'}: COLMAP could not join"):
        evaluate(plan, tmp_path / "out", InProcess())


def test_mpis_alone_have_no_use_for_colmap(plan: EvaluationOptions) -> None:
    with pytest.raises(ValueError, match="need --reconstruct 3dgs for --cameras colmap"):
        replace(plan, reconstruct=("mpi",))


def test_a_pose_is_the_same_after_it_was_plain_data() -> None:
    camera = lateral_cameras(3, *SIZE_PX)[2]
    frame = Frame("", np.zeros((64, 48, 3), np.uint8), lateral_cameras(1, *SIZE_PX)[0])
    moved = at_pose(frame, pose_of(camera)).camera
    np.testing.assert_allclose(
        moved.world_from_cam.matrix(), camera.world_from_cam.matrix(), atol=1e-12
    )
    read = Placement.read({"poses": [None, list(pose_of(camera))], "residual_m": 0.1})
    assert read == Placement((None, pose_of(camera)), 0.1)
    with pytest.raises(ValueError, match="need a frame that COLMAP placed, got 0"):
        read.at(0)


@pytest.mark.colmap
@pytest.mark.filterwarnings("default")
def test_at_colmaps_cameras_gaussians_are_as_good_as_at_exact_ones(tmp_path: Path) -> None:
    """The sample scene's pictures are ray-traced, so the recorded cameras are exact."""
    desk = open_recording(DESK)
    few = desk.write_subset(range(0, len(desk), 6), tmp_path / "desk")
    plan = EvaluationOptions(
        scenes=(few.path.parent,),
        strategies=("uniform",),
        reconstruct=("3dgs",),
        views=(12,),
        splat=SplatTraining(iterations=400, pixels=10_000),
    )
    recorded = evaluate(plan, tmp_path / "recorded", InProcess())
    placed = evaluate(replace(plan, cameras="colmap"), tmp_path / "placed", InProcess())
    assert not placed.results[0].lost
    mean_db = [np.mean(psnrs(found, "3dgs")) for found in (recorded, placed)]
    assert mean_db[1] > mean_db[0] - AGREE_DB, mean_db
