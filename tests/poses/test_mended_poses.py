"""Recorded poses mended: residuals by hand, planted errors, and poses that are kept."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.cli import main
from peaking.commands.scenes import SceneOptions
from peaking.datasets import open_recording
from peaking.datasets.mended_poses import refined
from peaking.errors import CamerasNotFound
from peaking.experiments.plan import EvaluationOptions
from peaking.experiments.run import _checked
from peaking.experiments.steps import _opened
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.poses.colmap import similarity_to
from peaking.poses.refine import Matches, epipolar_px, refine_cameras, residuals_px
from recordings import lateral_cameras

DESK = Path(__file__).parents[2] / "scenes" / "desk"
INDICES = range(0, 60, 6)
LEFT_OF_PLANTED = 0.1
"""Root mean square of positions. Measured: 0.02."""
SCALE_AGREES = 0.05
"""Of a path of 1 m, recorded to 1.7 cm. Measured: 0.02."""


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKING_CACHE", str(tmp_path / "cache"))


def at(x_m: float) -> Camera:
    return Camera(
        Pinhole(100, 80, 100.0, 100.0, 50.0, 40.0), Rigid(np.eye(3), np.array([x_m, 0, 0]))
    )


def test_residuals_of_cameras_side_by_side_are_differences_of_rows() -> None:
    xy_a = np.array([[20.0, 30.0], [60.0, 50.0], [70.0, 10.0]])
    xy_b = xy_a + np.array([[-5.0, 0.0], [-9.0, 2.0], [3.0, -1.0]])
    pair = Matches(0, 2, xy_a, xy_b)
    np.testing.assert_allclose(epipolar_px(pair, at(0.0), at(1.0)), [0.0, 2.0, 1.0], atol=1e-12)
    of_pictures = residuals_px([pair], [at(0.0), at(0.5), at(1.0)])
    np.testing.assert_allclose(of_pictures, [1.0, np.nan, 1.0], atol=1e-12)


def turned(vector_rad: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(vector_rad))
    x, y, z = vector_rad / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def shaken(pose: Rigid[World, Cam], rng: np.random.Generator) -> Rigid[World, Cam]:
    return Rigid(
        pose.rotation @ turned(rng.normal(0, 0.01, 3)),
        pose.translation_m + rng.normal(0, 0.01, 3),
    )


def apart_m(cameras: Sequence[Camera], true: Sequence[Camera]) -> tuple[float, float]:
    """Return the root mean square distance after a similarity, and the scale of that."""
    poses = [camera.world_from_cam for camera in cameras]
    similarity = similarity_to(poses, [camera.world_from_cam for camera in true])
    at_m = similarity.apply(np.array([camera.position_m for camera in cameras]))
    off_m = np.linalg.norm(at_m - [camera.position_m for camera in true], axis=1)
    return float(np.sqrt(np.mean(off_m**2))), similarity.scale


def test_planted_errors_are_mended_and_metres_stay() -> None:
    desk, rng = open_recording(DESK), np.random.default_rng(0)
    frames = [desk.read(i) for i in INDICES]
    off = [
        replace(f, camera=replace(f.camera, world_from_cam=shaken(f.camera.world_from_cam, rng)))
        for f in frames
    ]
    found = refine_cameras(off)
    assert found.is_better
    assert "poses were mended" in found.words()
    assert np.nanmedian(found.before_px) > 2
    assert np.nanmedian(found.after_px) < 0.5
    true = [frame.camera for frame in frames]
    was_m, _ = apart_m([frame.camera for frame in off], true)
    now_m, scale = apart_m(found.cameras, true)
    assert now_m < LEFT_OF_PLANTED * was_m
    assert scale == pytest.approx(1.0, abs=SCALE_AGREES)


def test_good_poses_are_kept() -> None:
    desk = open_recording(DESK)
    frames = [desk.read(i) for i in INDICES]
    found = refine_cameras(frames)
    assert not found.is_better
    assert "recorded poses are kept" in found.words()
    assert all(a is b.camera for a, b in zip(found.cameras, frames, strict=True))


def test_pictures_of_nothing_are_refused() -> None:
    rng = np.random.default_rng(0)
    frames = [
        Frame("", rng.integers(0, 256, (60, 80, 3), np.uint8), camera)
        for camera in lateral_cameras(4, 80, 60)
    ]
    with pytest.raises(CamerasNotFound, match="could be matched"):
        refine_cameras(frames)


def shaken_desk(folder: Path) -> Path:
    open_recording(DESK).write_subset(list(INDICES), folder)
    fields, rng = json.loads((folder / "transforms.json").read_text()), np.random.default_rng(1)
    for frame in fields["frames"]:
        pose = Rigid[World, Cam].from_matrix(np.array(frame["transform_matrix"]))
        frame["transform_matrix"] = shaken(pose, rng).matrix().tolist()
    (folder / "transforms.json").write_text(json.dumps(fields), encoding="utf-8")
    return folder


def test_every_command_that_is_asked_to_mends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = shaken_desk(tmp_path / "desk")
    as_it_was = open_recording(scene)
    mended = SceneOptions(refine=True).open(scene)
    assert "poses were mended" in capsys.readouterr().out
    assert mended.fingerprint() != as_it_was.fingerprint()
    assert mended.cameras[3].position_m.tolist() != as_it_was.cameras[3].position_m.tolist()
    frame, was = mended.read(3), as_it_was.read(3)
    assert frame.camera == mended.cameras[3]
    np.testing.assert_array_equal(frame.rgb, was.rgb)
    subset = mended.write_subset([3, 1], tmp_path / "subset")
    np.testing.assert_allclose(
        subset.cameras[0].world_from_cam.matrix(),
        mended.cameras[3].world_from_cam.matrix(),
        atol=1e-9,
    )
    monkeypatch.setitem(sys.modules, "pycolmap", None)  # it is not asked for a second time
    main(["info", str(scene), "--refine", "--json", str(tmp_path / "info.json")])
    said = capsys.readouterr().out
    assert "poses were mended" in said
    told = json.loads((tmp_path / "info.json").read_text())["refined"]
    assert told["is_better"]
    assert [frame["name"] for frame in told["frames"]] == list(mended.names)
    worst = max(told["frames"], key=lambda frame: frame["after_px"] or 0.0)
    assert worst["after_px"] < worst["before_px"]
    expected = f"{worst['name']} {worst['before_px']:.2f} → {worst['after_px']:.2f} px"
    assert f"farthest off: {expected}" in said


def test_an_evaluation_is_of_the_mended_poses(tmp_path: Path) -> None:
    scene = shaken_desk(tmp_path / "desk")
    plan = EvaluationOptions((scene,), strategies=("uniform",), refine=True)
    fingerprint = _checked(plan, scene)
    as_it_was, mended = open_recording(scene), refined(open_recording(scene))
    assert fingerprint == mended.fingerprint() != as_it_was.fingerprint()
    for wanted in (mended, as_it_was):
        frames = _opened(scene, wanted.fingerprint(), plan.options, None)
        assert frames.recording.cameras[2].position_m.tolist() == (
            wanted.cameras[2].position_m.tolist()
        )
    with pytest.raises(ValueError, match="one of --refine and --cameras colmap"):
        EvaluationOptions((scene,), reconstruct=("3dgs",), cameras="colmap", refine=True)
