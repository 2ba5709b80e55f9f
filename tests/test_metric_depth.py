"""Frames whose sensor depth is hidden get metric depth back, from whatever else is known."""

from __future__ import annotations

import json
import logging
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from jaxtyping import Float32, Float64

from peaking import view_builder
from peaking.cli import main
from peaking.datasets.nerfstudio import NerfstudioRecording, open_recording
from peaking.datasets.point_cloud import encode_points
from peaking.depth import complete
from peaking.errors import PeakingError
from peaking.frame import Frame
from peaking.metric_depth import CapturedView, estimate_depth
from peaking.mpi import Mpi
from peaking.pipeline import Reconstruction
from peaking.point_cloud import visible_points
from peaking.rendering import render
from peaking.view_builder import ViewBuilder
from recordings import Room, write_recording
from simulated_depth import Simulated

ERROR_WITH_POINTS = 0.05
"""Median relative error of depth. Worst measured, on three real recordings: 0.023 (60 points, a
quarter of them wrong by half a metre), 0.043 (16×12 samples) and 0.021 (two neighbours in metres);
the smooth error of the simulated estimate alone is about 0.01."""

ERROR_BY_MATCHES = 0.15
"""The same from matched pixels alone. Worst measured: 0.107 (7-Scenes, 10 cm aside)."""

RESIDUAL_OF_A_FEW_HUNDRED = 0.04
"""Median relative residual of the fit to 300 points of the frame or to what it sees of 5000 of the
recording. Worst measured: 0.030 (APC shelf, of the recording); elsewhere at most 0.016."""

PSNR_LOST_DB = 0.6
"""By the MPI of such points in the place of the sensor's whole depth map, of a view a step aside.
Worst measured: 0.46 (APC shelf), elsewhere at most 0.23. At the guessed range 1.9 to 13 are lost
(but on 7-Scenes to one side, where poses are off and a guess happens to be 1.1 better)."""

HIDDEN_SHARE = 0.05
"""Of the points that a frame takes of a cloud of 5000. Worst measured: 0.014 (7-Scenes), of
0.019 to 0.144 among all that project into it."""

measured = logging.getLogger("measured")
"""Shown by `pytest --log-cli-level=INFO`."""

BESIDE = Path(__file__).parent.parent.parent / "shared/data"
DESK = Path(__file__).parent.parent / "scenes/desk"
STEPS = {DESK: 4, **{p.parent: 1 for p in sorted(BESIDE.glob("*/depths"))}}
if (BESIDE / "7scenes_redkitchen") in STEPS:
    STEPS[BESIDE / "7scenes_redkitchen"] = 6  # its frames are 1.7 cm apart


@dataclass(frozen=True)
class Three:
    """Three frames in a row of the working size, and what the hidden sensor said of them."""

    recording: NerfstudioRecording
    middle: int
    frames: list[Frame]
    depths_m: list[Float32[np.ndarray, "h w"]]
    captured: list[CapturedView]
    estimator: Simulated

    def error(self, frame: Frame, others: list[CapturedView]) -> float:
        """Return the median relative error of the estimated depth of the middle one."""
        made = estimate_depth(frame, self.estimator, others)
        assert made.fit is not None
        return float(np.median(np.abs(made.depth_m / self.depths_m[1] - 1)))


def three_of(recording: NerfstudioRecording, step: int) -> Three:
    field = ViewBuilder()
    middle = len(recording) // 2
    frames = [field.prepare(recording.read(middle + i * step)) for i in (-1, 0, 1)]
    estimator = Simulated()
    depths_m: list[Float32[np.ndarray, "h w"]] = []
    for frame in frames:
        assert frame.depth_m is not None
        depths_m.append(complete(frame.depth_m, frame.rgb))
        estimator.tell(frame.rgb, depths_m[-1])
    captured = [CapturedView(frame, field.generate(frame), metric=True) for frame in frames]
    return Three(recording, middle, frames, depths_m, captured, estimator)


@pytest.fixture(scope="module", params=STEPS, ids=lambda path: path.name)
def three(request: pytest.FixtureRequest) -> Three:
    return three_of(open_recording(request.param), STEPS[request.param])


def hidden(frame: Frame) -> Frame:
    return replace(frame, depth_m=None)


def tracked_points_m(frame: Frame) -> Float64[np.ndarray, "n 3"]:
    """Return 60 points of the sensor in the world, a quarter of them moved by half a metre."""
    generator = np.random.default_rng(0)
    assert frame.depth_m is not None
    known = np.argwhere(frame.depth_m > 0)
    rows, cols = known[generator.choice(len(known), 60, replace=False)].T
    rays = frame.camera.resized(*frame.depth_m.shape[::-1]).pinhole.rays()[rows, cols]
    in_camera_m = rays * frame.depth_m[rows, cols, None].astype(np.float64)
    points_m = frame.camera.world_from_cam.apply(in_camera_m)
    points_m[:15] += generator.normal(0.0, 0.5, (15, 3))
    return points_m


def test_from_tracked_points(three: Three) -> None:
    frame = replace(hidden(three.frames[1]), points_m=tracked_points_m(three.frames[1]))
    assert three.error(frame, []) < ERROR_WITH_POINTS


def sampled_m(
    recording: NerfstudioRecording, indices: Sequence[int], count: int
) -> Float64[np.ndarray, "n 3"]:
    """Return points of the sensor's depth in the world, as many of every frame."""
    generator = np.random.default_rng(0)
    points_m: list[Float64[np.ndarray, "n 3"]] = []
    for index in indices:
        frame = recording.read(index)
        assert frame.depth_m is not None
        known = np.argwhere(frame.depth_m > 0)
        rows, cols = generator.choice(known, count // len(indices)).T
        rays = frame.camera.resized(*frame.depth_m.shape[::-1]).pinhole.rays()[rows, cols]
        in_camera_m = rays * frame.depth_m[rows, cols, None].astype(np.float64)
        points_m.append(frame.camera.world_from_cam.apply(in_camera_m))
    return np.concatenate(points_m)


def sampled_everywhere_m(recording: NerfstudioRecording) -> Float64[np.ndarray, "n 3"]:
    """Return a cloud of 5000 points, of 40 frames from begin to end."""
    indices = np.linspace(0, len(recording) - 1, min(len(recording), 40)).astype(int)
    return sampled_m(recording, indices.tolist(), 5000)


def with_points_for_depth(
    recording: NerfstudioRecording, index: int, folder: Path, *, own: bool
) -> Frame:
    """Write a frame as a recording without depth, with 300 points of its own or 5000 of all."""
    entry = {
        key: value
        for key, value in recording.views[index].entry.items()
        if key == "file_path" or not key.endswith("_file_path")
    }
    picture = folder / entry["file_path"]
    picture.parent.mkdir(parents=True)
    shutil.copy(recording.root / recording.views[index].picture, picture)
    points_m = sampled_m(recording, [index], 300) if own else sampled_everywhere_m(recording)
    (folder / "points.ply").write_bytes(encode_points(points_m))
    top = {**recording.top, "frames": [entry]}
    (entry if own else top)["ply_file_path"] = "points.ply"
    (folder / "transforms.json").write_text(json.dumps(top))
    return open_recording(folder).read(0)


def psnrs_db(mpis: Sequence[Mpi], live: Frame) -> list[float]:
    """Return the PSNR of each one's view over what all of them cover."""
    views = [render(mpi, live.camera) for mpi in mpis]
    covered = np.all([view.alpha >= 0.95 for view in views], axis=0)
    errors = [(view.rgba[..., :3] - live.rgb / 255.0)[covered] for view in views]
    return [float(-10 * np.log10(np.mean(error**2))) for error in errors]


def hidden_share(points_m: Float64[np.ndarray, "n 3"], frame: Frame) -> float:
    """Return how many of the points in a picture are more than a tenth behind the sensor's."""
    assert frame.depth_m is not None
    height, width = frame.depth_m.shape
    xy_px, depth_m = frame.camera.resized(width, height).project(points_m)
    inside = (depth_m > 0) & ((xy_px >= 0) & (xy_px < (width, height))).all(axis=1)
    cols, rows = xy_px[inside].astype(int).T
    sensor_m, depth_m = frame.depth_m[rows, cols], depth_m[inside]
    known = sensor_m > 0
    return float((depth_m[known] > 1.1 * sensor_m[known]).mean())


def test_few_of_the_points_that_a_frame_takes_of_a_cloud_are_hidden(three: Three) -> None:
    frame, cloud_m = three.frames[1], sampled_everywhere_m(three.recording)
    of_all = hidden_share(cloud_m, frame)
    of_taken = hidden_share(visible_points(cloud_m, frame.camera), frame)
    measured.info("hidden of all, of those taken: %.4f %.4f", of_all, of_taken)
    assert of_taken < min(of_all / 2, HIDDEN_SHARE)


@pytest.mark.parametrize("own", [True, False], ids=["own", "shared"])
def test_a_recording_with_a_few_hundred_points_in_the_place_of_depth(
    three: Three, own: bool, tmp_path: Path
) -> None:
    frame = with_points_for_depth(three.recording, three.middle, tmp_path, own=own)
    field = ViewBuilder(estimator=three.estimator)
    fit = estimate_depth(field.prepare(frame), three.estimator, []).fit
    assert fit is not None
    measured.info("residual of %d points: %.4f", fit.num_points, fit.residual)
    assert fit.residual < RESIDUAL_OF_A_FEW_HUNDRED
    made, guessed = (field.build(f).mpi for f in (frame, replace(frame, points_m=None)))
    for aside in (three.frames[0], three.frames[2]):
        psnr_db = psnrs_db([three.captured[1].mpi, made, guessed], aside)
        measured.info("PSNR of sensor, points, guess: %.2f %.2f %.2f", *psnr_db)
        assert psnr_db[1] > psnr_db[0] - PSNR_LOST_DB


def test_from_a_few_samples_of_a_sensor(three: Three) -> None:
    frame = three.frames[1]
    assert frame.depth_m is not None
    few_m = cv2.resize(frame.depth_m, (16, 12), interpolation=cv2.INTER_NEAREST)
    assert three.error(replace(frame, depth_m=few_m.astype(np.float32)), []) < ERROR_WITH_POINTS


def test_from_neighbours_in_metres(three: Three) -> None:
    others = [three.captured[0], three.captured[2]]
    assert three.error(hidden(three.frames[1]), others) < ERROR_WITH_POINTS


def test_from_matches_with_views_that_have_no_depth_either(three: Three) -> None:
    others = [
        CapturedView(hidden(captured.frame), captured.mpi.scaled(3.0), metric=False)
        for captured in (three.captured[0], three.captured[2])
    ]
    assert three.error(hidden(three.frames[1]), others) < ERROR_BY_MATCHES


def test_of_a_lone_frame_the_scale_is_a_guess(three: Three) -> None:
    made = estimate_depth(hidden(three.frames[1]), three.estimator, [])
    assert made.fit is None
    assert made.depth_m.min() == pytest.approx(0.8, rel=1e-3)
    assert made.depth_m.max() == pytest.approx(4.0, rel=1e-3)


def test_a_guessed_view_is_flagged_and_aligned_when_a_neighbour_comes(three: Three) -> None:
    field = Reconstruction(estimator=three.estimator)
    field.add_view(hidden(three.frames[1]))
    assert field.light_field.guessed == {0}
    seen = field.render(three.frames[1].camera)  # from where it was taken it is right
    assert seen.alpha.mean() > 0.9
    field.add_view(three.frames[0])  # with sensor depth
    assert field.light_field.guessed == set()
    shown_m = render(field.views[0].mpi, three.frames[1].camera).depth_m
    error = np.median(np.abs(shown_m / three.depths_m[1] - 1))
    assert error < ERROR_WITH_POINTS


def test_a_sensor_of_few_samples_tells_the_scale_of_an_estimate(three: Three) -> None:
    frame = three.frames[1]
    assert frame.depth_m is not None
    few_m = cv2.resize(frame.depth_m, (16, 12), interpolation=cv2.INTER_NEAREST)
    few = replace(frame, depth_m=few_m.astype(np.float32))
    captured = ViewBuilder(estimator=three.estimator).build(few)
    assert captured.metric
    shown_m = render(captured.mpi, frame.camera).depth_m
    assert np.median(np.abs(shown_m / three.depths_m[1] - 1)) < ERROR_WITH_POINTS


def test_guessed_views_are_not_shown_beside_known_ones() -> None:
    three = three_of(open_recording(DESK), 4)
    field = Reconstruction(estimator=three.estimator)
    field.add_view(three.frames[0])
    black = np.zeros_like(three.frames[1].rgb)  # nothing to match
    three.estimator.tell(black, three.depths_m[1])
    camera = three.frames[1].camera
    behind = np.diag([-1.0, 1.0, -1.0])  # a half turn about the vertical axis: nothing to see
    pose = replace(camera.world_from_cam, rotation=camera.world_from_cam.rotation @ behind)
    turned = replace(camera, world_from_cam=pose)
    field.add_view(replace(hidden(three.frames[1]), rgb=black, camera=turned))
    assert field.light_field.guessed == {1}
    neighbours = field.light_field.choose_views(turned)
    assert [neighbour.index for neighbour in neighbours] == [0]


def test_without_an_estimator_it_says_what_to_do(tmp_path: Path) -> None:
    scene = open_recording(write_recording(tmp_path / "scene", num_frames=1, with_depth=False))
    with pytest.raises(PeakingError, match="--depth-model"):
        Reconstruction().add_view(scene.read(0))


def test_recordings_without_depth_are_generated_and_replayed_with_a_depth_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = write_recording(tmp_path / "scene", num_frames=6, with_depth=False)
    estimator = Simulated(waves=0.0)
    field, recording = ViewBuilder(estimator=estimator), open_recording(scene)
    for index in range(len(recording)):
        small = field.prepare(recording.read(index))
        estimator.tell(small.rgb, Room().photographed(small.camera)[1])

    def simulated(model: str, *, device: str, runtime: str) -> Simulated:
        assert (model, device, runtime) == ("simulated", "auto", "pytorch")
        return estimator

    monkeypatch.setattr(view_builder, "create_estimator", simulated)
    estimated = ["--depth-model", "simulated"]
    main(["generate", str(scene), "--out", str(tmp_path / "a.mpi"), *estimated])
    assert "its scale is a guess" in capsys.readouterr().out
    main(["replay", str(scene), "--out", str(tmp_path / "out"), "--no-video", *estimated])
    assert len(open_recording(tmp_path / "out/captured")) >= 1
