"""Real recordings, where they lie beside the checkout; without them nothing of this runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from peaking.datasets import open_recording
from peaking.pipeline import Reconstruction

BESIDE = Path(__file__).parent.parent.parent / "shared/data"
RECORDINGS = sorted(path.parent for path in BESIDE.glob("*/transforms.json"))
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
