"""Real recordings, where they lie beside the checkout; without them nothing of this runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.geometry import Cam, Camera, Rigid
from peaking.options import DEFAULT
from peaking.pipeline import Reconstruction
from peaking.tracking import apart
from peaking.tracking.solution import rotation_of

BESIDE = Path(__file__).parent.parent.parent / "shared/data"
RECORDINGS = sorted(path.parent for path in BESIDE.glob("*/transforms.json"))
HAND_HELD = [path for path in RECORDINGS if path.name.startswith(("7scenes", "hololens"))]
WITH_DEPTH = [path for path in RECORDINGS if (path / "depths").is_dir()]


@pytest.mark.parametrize("folder", RECORDINGS, ids=lambda path: path.name)
def test_every_recording_opens_and_reads(folder: Path) -> None:
    recording = open_recording(folder)
    assert len(recording) > 10
    frame = recording.read(len(recording) // 2)
    assert frame.rgb.mean() > 10
    assert (frame.depth_m is not None) == (folder in WITH_DEPTH)


@pytest.mark.parametrize("folder", WITH_DEPTH, ids=lambda path: path.name)
def test_at_a_captured_view_little_is_red_and_steps_aside_more(folder: Path) -> None:
    recording = open_recording(folder)
    scene = Reconstruction()
    scene.add_view(recording.read(0))
    here, aside = (scene.prepare(recording.read(index)) for index in (0, 3))
    at_home = scene.compare(here.rgb, here.camera).errors.peaked_share
    away = scene.compare(aside.rgb, aside.camera).errors.peaked_share
    assert at_home < 0.005
    assert at_home < away < 0.9


SAME_PLACE_M = 0.003
SAME_PLACE_RAD = 0.002
"""Between where two alignments end. Measured at 24 places of each of these scenes, 2026-11-30:
median 0.3 mm and 0.0002 rad, 90th percentile 0.8 mm and 0.0006 rad; here 0.5 mm, 0.0003 rad."""


@pytest.mark.parametrize("folder", HAND_HELD, ids=lambda path: path.name)
def test_wherever_the_pose_is_said_to_be_it_is_found_at_the_same_place(folder: Path) -> None:
    recording = open_recording(folder)
    scene = Reconstruction()
    for index in (60, 64):
        scene.add_view(recording.read(index))
    live = scene.prepare(recording.read(62))
    turn = rotation_of(np.radians([0.3, -0.4, 0.0]))
    off: Rigid[Cam, Cam] = Rigid(turn, np.array([0.006, 0.0, -0.008]))
    told = Camera(live.camera.pinhole, live.camera.world_from_cam @ off)
    here, there = (scene.compare(live.rgb, camera) for camera in (live.camera, told))
    assert here.alignment is not None
    assert there.alignment is not None
    assert here.alignment.ok
    assert there.alignment.ok
    move_m, turn_rad = apart(here.alignment.camera, there.alignment.camera)
    assert move_m < SAME_PLACE_M
    assert turn_rad < SAME_PLACE_RAD
    recorded = Reconstruction(replace(DEFAULT, align_poses=False))
    recorded.views = scene.views
    assert there.errors.mean_error < recorded.compare(live.rgb, told).errors.mean_error
