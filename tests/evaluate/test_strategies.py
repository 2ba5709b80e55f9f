"""Who chooses which views: worked by hand, laws, and what each may know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.datasets.nerfstudio import open_recording
from peaking.errors import RecordingError
from peaking.evaluate.scene import Scene
from peaking.evaluate.splits import budgets, num_candidates, split
from peaking.evaluate.strategies import STRATEGIES
from peaking.evaluate.strategies.peaking import Keeper
from peaking.evaluate.strategies.plenoptic import spaced
from peaking.evaluate.strategies.threshold import walk
from peaking.evaluate.strategies.uniform import path_m, spread_along
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.presets import DEFAULT
from recordings import lateral_cameras, write_recording

SIZE_PX = (48, 64)
NUM_FRAMES = 24
SMALL = replace(DEFAULT, pixels=48 * 64, num_planes=8)


def cameras_at(*places_x_m: float) -> list[Camera]:
    pinhole = Pinhole(4, 4, 4.0, 4.0, 2.0, 2.0)
    return [Camera(pinhole, Rigid(np.eye(3), np.array([x, 0.0, 0.0]))) for x in places_x_m]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    root: Path = tmp_path_factory.mktemp("walk") / "walk"
    write_recording(root, cameras=lateral_cameras(NUM_FRAMES, *SIZE_PX))
    return Scene(open_recording(root), SMALL)


def test_uniform_goes_by_the_path_and_not_by_the_number() -> None:
    cameras = cameras_at(0.0, 0.1, 0.2, 0.3, 2.0, 4.0)
    np.testing.assert_allclose(path_m(cameras), [0.0, 0.1, 0.2, 0.3, 2.0, 4.0])
    assert spread_along(cameras, [10, 11, 12, 13, 14, 15], 3) == [10, 14, 15]


def test_uniform_takes_no_view_twice() -> None:
    cameras = cameras_at(0.0, 1.0, 1.0, 1.0)
    assert spread_along(cameras, [0, 1, 2, 3], 4) == [0, 1, 2, 3]


def test_a_rotation_can_count_as_a_way() -> None:
    turned = Rigid(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    cameras = [*cameras_at(0.0), Camera(Pinhole(4, 4, 4.0, 4.0, 2.0, 2.0), turned)]
    np.testing.assert_allclose(path_m(cameras), [0.0, 0.0])
    np.testing.assert_allclose(path_m(cameras, metres_per_rad=2.0), [0.0, 2 * np.pi])


def test_spaced_views_keep_their_distance_where_the_path_returns() -> None:
    places_m = np.array([[0.0, 0, 0], [0.4, 0, 0], [1.0, 0, 0], [0.1, 0, 0], [2.0, 0, 0]])
    assert spaced(places_m, 0.5) == [0, 2, 4]


@pytest.mark.parametrize("name", sorted(STRATEGIES))
@pytest.mark.parametrize("count", [2, 5])
def test_every_strategy_gives_as_many_as_asked(scene: Scene, name: str, count: int) -> None:
    candidates = [i for i in range(NUM_FRAMES) if i % 3]
    chosen = STRATEGIES[name](scene, candidates, count, np.random.default_rng(0))
    assert chosen == sorted(set(chosen))
    assert set(chosen) <= set(candidates)
    assert len(chosen) == (len(candidates) if name == "all" else count)


def test_random_follows_its_seed(scene: Scene) -> None:
    choose = STRATEGIES["random"]
    once, again, other = (
        choose(scene, range(NUM_FRAMES), 6, np.random.default_rng(seed)) for seed in (3, 3, 4)
    )
    assert once == again
    assert once != other


def test_threshold_begins_with_the_first_and_takes_more_when_it_is_lower(scene: Scene) -> None:
    few = walk(scene, range(NUM_FRAMES), 0.3, most=NUM_FRAMES).views
    more = walk(scene, range(NUM_FRAMES), 0.02, most=NUM_FRAMES).views
    assert few[0] == more[0] == 0
    assert len(few) < len(more)


def test_threshold_knows_only_the_past(scene: Scene) -> None:
    whole = walk(scene, range(NUM_FRAMES), 0.05, most=NUM_FRAMES).views
    first_half = walk(scene, range(NUM_FRAMES // 2), 0.05, most=NUM_FRAMES).views
    assert first_half == tuple(i for i in whole if i < NUM_FRAMES // 2)


def test_what_is_held_follows_from_the_frames_seen_so_far(scene: Scene, tmp_path: Path) -> None:
    """Two walks that begin alike hold the same views until they part, and others afterwards."""
    alike = 10
    back = np.array([0.0, 0.0, -0.3])
    parted = [
        replace(camera, world_from_cam=Rigid(np.eye(3), camera.position_m + k * back))
        for k, camera in enumerate(scene.cameras[alike:], start=1)
    ]
    write_recording(tmp_path / "parted", cameras=[*scene.cameras[:alike], *parted])
    other = Scene(open_recording(tmp_path / "parted"), SMALL)
    when_they_part, at_the_end = [], []
    for walked in (scene, other):
        keeper = Keeper(walked)
        for i in range(NUM_FRAMES):
            keeper.offer(i)
            if len(keeper.held) > 4:
                keeper.let_go()
            if i == alike - 1:
                when_they_part.append(list(keeper.held))
        at_the_end.append(list(keeper.held))
    assert when_they_part[0] == when_they_part[1]
    assert at_the_end[0] != at_the_end[1]


def test_who_stands_still_keeps_one_view(tmp_path: Path) -> None:
    walked = lateral_cameras(12, *SIZE_PX)
    cameras = [walked[0]] * 6 + walked[1:]
    write_recording(tmp_path / "still", cameras=cameras)
    still = Scene(open_recording(tmp_path / "still"), SMALL)
    chosen = STRATEGIES["peaking"](still, range(len(cameras)), 3, np.random.default_rng(0))
    assert sum(i < 6 for i in chosen) <= 1


def test_peaking_covers_the_whole_walk(scene: Scene) -> None:
    chosen = STRATEGIES["peaking"](scene, range(NUM_FRAMES), 4, np.random.default_rng(0))
    assert np.diff([0, *chosen, NUM_FRAMES - 1]).max() <= NUM_FRAMES // 2


def test_holdout_tests_every_eighth_frame_and_never_offers_it(scene: Scene) -> None:
    usable = list(range(48))
    frames = split(scene, usable, "holdout", 5)
    assert frames.test == (4, 12, 20, 28, 36, 44)
    assert not set(frames.test) & set(frames.candidates)


def test_paper_tests_between_every_two_of_uniform(scene: Scene) -> None:
    frames = split(scene, list(range(NUM_FRAMES)), "paper", 4)
    assert frames.uniform is not None
    assert len(frames.test) == 3
    for a, middle, b in zip(frames.uniform, frames.test, frames.uniform[1:], strict=False):
        assert middle == (a + b) // 2
    assert not set(frames.test) & set(frames.candidates)


@given(st.integers(12, 400))
@settings(max_examples=30, deadline=None)
def test_budgets_rise(count: int) -> None:
    few, middle, many = budgets(count)
    assert 2 <= few < middle < many <= count


def test_too_many_views_are_refused(scene: Scene) -> None:
    with pytest.raises(RecordingError, match=r"24 usable frames.*40 views were asked for"):
        split(scene, list(range(NUM_FRAMES)), "holdout", 40)


def test_candidates_are_counted_without_the_test_views(scene: Scene) -> None:
    frames = split(scene, list(range(NUM_FRAMES)), "holdout", 2)
    assert num_candidates(scene.recording) == len(frames.candidates)
