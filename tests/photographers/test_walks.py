from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import Recording, open_recording
from peaking.photographers.recording import PhotoRecording, record_walk
from peaking.photographers.scene import Scene
from peaking.photographers.tasks import SCENE_NAMES, TASKS, SceneName
from peaking.photographers.walks import STEP_S, Walk, draw_walk, within
from peaking.selection.recorded_frames import select


def walk_of(scene: SceneName, seed: int, seconds: float = 60.0) -> Walk:
    rng = np.random.default_rng(seed)
    return draw_walk(TASKS[scene], rng, seconds=seconds, speed_m_per_s=0.3)


@pytest.mark.parametrize("scene", SCENE_NAMES)
def test_walks_stay_in_the_volume_and_keep_to_their_speed(scene: SceneName) -> None:
    task, walk = TASKS[scene], walk_of(scene, 1)
    assert abs(walk.seconds - 60) <= STEP_S
    for at in walk.steps[::7]:
        inside = within(task, at)
        free = np.array([task.circles, False, False, task.turns, False])
        assert (((inside >= 0) & (inside <= 1)) | free).all()
    steps_m = [task.length_m(a, b) for a, b in pairwise(walk.steps)]
    # A leg is fastest in its middle, by π / 2; and tasks bend what is straight in coordinates.
    assert float(np.percentile(steps_m, 95)) / STEP_S < 0.3 * np.pi / 2 * 1.5


def test_walks_dwell_turn_and_return() -> None:
    dwells = turns = returns = 0
    for seed in range(12):
        steps = walk_of("room", seed).steps
        moved = np.abs(np.diff(steps, axis=0))
        still = (moved < 1e-5).all(axis=1)
        dwells += int(still.sum() * STEP_S > 1)
        turns += int(((moved[:, :3] < 1e-5).all(axis=1) & (moved[:, 3] > 1e-3)).sum() > 5)
        far = np.linalg.norm(steps[200:] - steps[0], axis=1)
        returns += int(far.min() < 0.12 and far.max() > 0.5)
    assert dwells >= 8
    assert turns >= 3
    assert returns >= 1


def test_the_same_seed_is_the_same_walk() -> None:
    np.testing.assert_array_equal(walk_of("desk", 5).steps, walk_of("desk", 5).steps)
    assert np.abs(walk_of("desk", 5).steps - walk_of("desk", 6).steps).max() > 0.1


def test_walls_turn_back_and_rings_go_on() -> None:
    at = np.array([1.2, -0.1, 0.5, 1.3, 2.4])
    np.testing.assert_allclose(within(TASKS["desk"], at), [0.8, 0.1, 0.5, 0.7, 0.4])
    np.testing.assert_allclose(within(TASKS["room"], at), [0.8, 0.1, 0.5, 1.3, 0.4])
    np.testing.assert_allclose(within(TASKS["still-life"], at), [1.2, 0.1, 0.5, 0.7, 0.4])


def test_who_walks_around_looks_on_without_a_jump() -> None:
    task = TASKS["still-life"]
    yaws = [task.place(np.array([a, 0.5, 0.5, 0.5, 0.5]))[1] for a in np.linspace(0, 2, 200)]
    assert np.abs(np.diff(yaws)).max() < 0.2
    assert abs(yaws[-1] - yaws[0] - 4 * np.pi) < 0.2


@pytest.mark.usefixtures("drawn")
def test_a_walk_is_a_recording(tmp_path: Path) -> None:
    recording = record_walk("desk", 1, seconds=3.0)
    assert isinstance(recording, Recording)
    assert len(recording) == 15
    frame = recording.read(7)
    assert frame.depth_m is not None
    assert 0.5 < (frame.depth_m > 0).mean() < 1
    again = record_walk("desk", 1, seconds=3.0)
    assert again.fingerprint() == recording.fingerprint()
    assert record_walk("desk", 2, seconds=3.0).fingerprint() != recording.fingerprint()
    written = recording.write_subset([0, 4, 9], tmp_path / "walk")
    assert len(open_recording(tmp_path / "walk")) == len(written) == 3
    for k, number in enumerate((0, 4, 9)):
        np.testing.assert_allclose(
            written.cameras[k].world_from_cam.matrix(),
            recording.cameras[number].world_from_cam.matrix(),
            atol=1e-9,
        )
        apart = written.read(k).rgb.astype(float) - recording.read(number).rgb
        assert np.abs(apart).mean() < 4


def test_policies_choose_from_photos(drawn: Scene) -> None:
    recording: PhotoRecording = record_walk("desk", 0, seconds=3.0)
    assert len(select(recording, 3)) == 3
    with pytest.raises(IndexError):
        recording.read(99)
    with pytest.raises(ValueError, match="different indices"):
        recording.write_subset([], Path("nowhere"))
