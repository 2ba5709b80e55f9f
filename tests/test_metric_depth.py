"""Frames whose sensor depth is hidden get metric depth back, from whatever else is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from jaxtyping import Float32, Float64

from peaking.datasets.nerfstudio import Recording, open_recording
from peaking.depth import complete
from peaking.errors import PeakingError
from peaking.frame import Frame
from peaking.metric_depth import Captured, estimate_depth
from peaking.pipeline import LocalLightField
from peaking.render import render
from recordings import write_recording
from simulated_depth import Simulated

ERROR_WITH_POINTS = 0.05
"""Median relative error of depth. Worst measured, on three real recordings: 0.023 (60 points, a
quarter of them wrong by half a metre), 0.043 (16×12 samples) and 0.021 (two neighbours in metres);
the smooth error of the simulated estimate alone is about 0.01."""

ERROR_BY_MATCHES = 0.15
"""The same from matched pixels alone. Worst measured: 0.107 (7-Scenes, 10 cm aside)."""

BESIDE = Path(__file__).parent.parent.parent / "shared/data"
DESK = Path(__file__).parent.parent / "scenes/desk"
STEPS = {DESK: 4, **{p.parent: 1 for p in sorted(BESIDE.glob("*/depths"))}}
if (BESIDE / "7scenes_redkitchen") in STEPS:
    STEPS[BESIDE / "7scenes_redkitchen"] = 6  # its frames are 1.7 cm apart


@dataclass(frozen=True)
class Three:
    """Three frames in a row of the working size, and what the hidden sensor said of them."""

    frames: list[Frame]
    depths_m: list[Float32[np.ndarray, "h w"]]
    captured: list[Captured]
    estimator: Simulated

    def error(self, frame: Frame, others: list[Captured]) -> float:
        """Return the median relative error of the estimated depth of the middle one."""
        made = estimate_depth(frame, self.estimator, others)
        assert made.fit is not None
        return float(np.median(np.abs(made.depth_m / self.depths_m[1] - 1)))


def three_of(recording: Recording, step: int) -> Three:
    field = LocalLightField()
    middle = len(recording) // 2
    frames = [field.prepare(recording.read(middle + i * step)) for i in (-1, 0, 1)]
    estimator = Simulated()
    depths_m: list[Float32[np.ndarray, "h w"]] = []
    for frame in frames:
        assert frame.depth_m is not None
        depths_m.append(complete(frame.depth_m, frame.rgb))
        estimator.tell(frame.rgb, depths_m[-1])
    captured = [Captured(frame, field.mpi_of(frame), metric=True) for frame in frames]
    return Three(frames, depths_m, captured, estimator)


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
        Captured(hidden(captured.frame), captured.mpi.scaled(3.0), metric=False)
        for captured in (three.captured[0], three.captured[2])
    ]
    assert three.error(hidden(three.frames[1]), others) < ERROR_BY_MATCHES


def test_of_a_lone_frame_the_scale_is_a_guess(three: Three) -> None:
    made = estimate_depth(hidden(three.frames[1]), three.estimator, [])
    assert made.fit is None
    assert made.depth_m.min() == pytest.approx(0.8, rel=1e-3)
    assert made.depth_m.max() == pytest.approx(4.0, rel=1e-3)


def test_a_guessed_view_is_flagged_and_aligned_when_a_neighbour_comes(three: Three) -> None:
    field = LocalLightField(estimator=three.estimator)
    field.add_view(hidden(three.frames[1]))
    assert field.guessed == {0}
    seen, _ = field.view_from(three.frames[1].camera)  # from where it was taken it is right
    assert seen.alpha.mean() > 0.9
    field.add_view(three.frames[0])  # with sensor depth
    assert field.guessed == set()
    shown_m = render(field.views[0], three.frames[1].camera).depth_m
    error = np.median(np.abs(shown_m / three.depths_m[1] - 1))
    assert error < ERROR_WITH_POINTS


def test_a_sensor_of_few_samples_tells_the_scale_of_an_estimate(three: Three) -> None:
    frame = three.frames[1]
    assert frame.depth_m is not None
    few_m = cv2.resize(frame.depth_m, (16, 12), interpolation=cv2.INTER_NEAREST)
    few = replace(frame, depth_m=few_m.astype(np.float32))
    captured = LocalLightField(estimator=three.estimator).captured(few)
    assert captured.metric
    shown_m = render(captured.mpi, frame.camera).depth_m
    assert np.median(np.abs(shown_m / three.depths_m[1] - 1)) < ERROR_WITH_POINTS


def test_guessed_views_are_not_shown_beside_known_ones() -> None:
    three = three_of(open_recording(DESK), 4)
    field = LocalLightField(estimator=three.estimator)
    field.add_view(three.frames[0])
    black = np.zeros_like(three.frames[1].rgb)  # nothing to match
    three.estimator.tell(black, three.depths_m[1])
    camera = three.frames[1].camera
    behind = np.diag([-1.0, 1.0, -1.0])  # a half turn about the vertical axis: nothing to see
    pose = replace(camera.world_from_cam, rotation=camera.world_from_cam.rotation @ behind)
    turned = replace(camera, world_from_cam=pose)
    field.add_view(replace(hidden(three.frames[1]), rgb=black, camera=turned))
    assert field.guessed == {1}
    _, neighbours = field.view_from(turned)
    assert [neighbour.index for neighbour in neighbours] == [0]


def test_without_an_estimator_it_says_what_to_do(tmp_path: Path) -> None:
    scene = open_recording(write_recording(tmp_path / "scene", num_frames=1, with_depth=False))
    with pytest.raises(PeakingError, match="--depth-model"):
        LocalLightField().add_view(scene.read(0))
