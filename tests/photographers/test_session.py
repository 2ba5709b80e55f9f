from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from peaking.geometry import Camera
from peaking.guidance.guide import progress
from peaking.options import PAPER_PEAKED_SHARE
from peaking.photographers import auto_shutter
from peaking.photographers.auto_shutter import AutoMoment, AutoShutter, Motion
from peaking.photographers.grid_walk import grids
from peaking.photographers.guides import GUIDE_NAMES, GuideName
from peaking.photographers.scene import Scene, look
from peaking.photographers.sensor import Shot, as_numbers, take_frame
from peaking.photographers.session import Limits, photograph, temperament_of
from peaking.photographers.tasks import PINHOLE, TASKS
from peaking.photographers.temperaments import TEMPERAMENTS

WEB = Path(__file__).parent.parent.parent / "web" / "src"


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize("guide", GUIDE_NAMES)
def test_photographers_keep_their_limits(guide: GuideName) -> None:
    taken = photograph("desk", guide, 1, Limits(3, 12.0))
    assert 1 <= len(taken.shots) <= 3
    times_s = [shot.time_s for shot in taken.shots]
    assert times_s == sorted(times_s)
    assert times_s[-1] <= 12.0
    assert len(taken.path) >= 2


@pytest.mark.usefixtures("drawn")
def test_the_same_photographer_does_the_same_again() -> None:
    limits = Limits(3, 6.0)
    assert photograph("desk", "red", 2, limits) == photograph("desk", "red", 2, limits)
    assert photograph("desk", "red", 1, limits) != photograph("desk", "red", 2, limits)


@pytest.mark.usefixtures("drawn")
def test_an_interval_shutter_goes_evenly() -> None:
    taken = photograph("desk", "interval", 0, Limits(5, 20.0))
    assert [shot.time_s for shot in taken.shots] == [2.0, 6.0, 10.0, 14.0, 18.0]


@pytest.mark.usefixtures("drawn")
def test_an_automatic_shutter_takes_no_two_views_at_once() -> None:
    taken = photograph("desk", "auto", 1, Limits(None, 12.0))
    gaps_s = np.diff([shot.time_s for shot in taken.shots])
    assert len(gaps_s) >= 2
    assert gaps_s.min() >= auto_shutter.PAUSE_MS / 1e3 - 1e-9


def test_of_every_three_one_is_of_each_temperament() -> None:
    assert [temperament_of(k) for k in (3, 4, 5)] == list(TEMPERAMENTS.values())


@pytest.mark.parametrize(("photos", "scene"), ((9, "desk"), (8, "desk"), (8, "room"), (9, "hall")))
def test_a_grid_has_as_many_targets_as_photos(photos: int, scene: str) -> None:
    task = next(task for task in TASKS.values() if task.name == scene)
    guide = grids(task, photos)
    assert len(guide.targets) == photos
    positions_m = np.array([t.translation_m for t in guide.targets])
    forwards = np.array([t.rotation[:, 2] for t in guide.targets])
    assert len(np.unique(np.round(np.hstack([positions_m, forwards]), 6), axis=0)) == photos
    views = [Camera(PINHOLE, target) for target in guide.targets]
    assert progress(guide, views).num_taken == photos


def moment(time_ms: float, **other: object) -> AutoMoment:
    usual = {"can_shoot": True, "steady": True, "views": 1, "ready": 1, "peaked_share": 0.05}
    return AutoMoment(time_ms, **{**usual, **other})  # type: ignore[arg-type]


def test_the_automatic_shutter_waits_for_what_lasts() -> None:
    auto = AutoShutter()
    assert not auto.look(moment(0.0))
    assert not auto.look(moment(200.0))
    assert auto.look(moment(250.0))
    assert not auto.look(moment(500.0, views=2)), "it is on its way"
    assert not auto.look(moment(600.0, views=2, ready=2))
    assert not auto.look(moment(900.0, views=2, ready=2)), "a pause between two"
    assert auto.look(moment(950.0, views=2, ready=2))


def test_why_the_automatic_shutter_waits() -> None:
    auto = AutoShutter()
    for k, wait in enumerate(
        ({"views": 0}, {"can_shoot": False}, {"peaked_share": None}, {"peaked_share": 0.01})
    ):
        assert not auto.look(moment(4000.0 * k, **wait))
        assert not auto.look(moment(4000.0 * k + 1000, **wait))
        assert not auto.asks_to_hold_still
    assert not auto.look(moment(20_000.0, steady=False))
    assert auto.asks_to_hold_still


def test_its_numbers_are_those_of_the_page() -> None:
    texts = [(WEB / name).read_text() for name in ("capture/auto_shutter.ts", "motion.ts")]
    said = {
        name: float(number.replace("_", ""))
        for text in texts
        for name, number in re.findall(r"const ([A-Z_]+(?:_[a-zS]+)*) = ([0-9._]+);", text)
    }
    for name in ("LASTS_MS", "PAUSE_MS", "PATIENCE_MS", "SMOOTHING_MS"):
        assert getattr(auto_shutter, name) == said[name]
    for text in (texts[1],):
        for name in ("TOO_FAST", "STEADY"):
            for unit in ("M_PER_S", "RAD_PER_S"):
                (number,) = re.findall(rf"const {name}_{unit} = ([0-9.]+);", text)
                assert getattr(auto_shutter, f"{name}_{unit}") == float(number)
    (share,) = re.findall(r"WORTH_SHARE = ([0-9.]+) / 4;", texts[0])
    assert float(share) == PAPER_PEAKED_SHARE
    assert auto_shutter.WORTH_SHARE == PAPER_PEAKED_SHARE / 4


def test_motion_tells_steady_from_fast() -> None:
    motion = Motion()
    for k in range(20):
        motion.update(50.0 * k, look(PINHOLE, (0.005 * k, 0.0, 0.0), 0.0, 0.0))  # 0.1 m/s
    assert motion.steady
    assert not motion.too_fast
    for k in range(20, 40):
        motion.update(50.0 * k, look(PINHOLE, (0.1 + 0.05 * (k - 20), 0.0, 0.0), 0.0, 0.0))
    assert motion.too_fast
    assert not motion.steady


def shot_at(number: int, blur_px: tuple[float, float]) -> Shot:
    camera = TASKS["desk"].camera(np.full(5, 0.5))
    return Shot(number, 1.5, as_numbers(camera), blur_px)


def test_a_phone_is_a_little_off_and_says_so_to_nobody(small_scene: Scene) -> None:
    still, same, other = (
        take_frame(small_scene, shot_at(number, (0.0, 0.0)), (1, 2)) for number in (3, 3, 4)
    )
    np.testing.assert_array_equal(still.rgb, same.rgb)
    np.testing.assert_array_equal(still.depth_m, same.depth_m)
    off_m = np.linalg.norm(still.camera.position_m - shot_at(3, (0.0, 0.0)).camera.position_m)
    assert 1e-5 < off_m < 0.03
    assert np.abs(still.rgb.astype(float) - other.rgb).mean() < 4
    blurred = take_frame(small_scene, shot_at(3, (4.0, 1.0)), (1, 2))
    edges = [np.abs(np.diff(frame.rgb.astype(float), axis=1)).mean() for frame in (still, blurred)]
    assert edges[1] < 0.8 * edges[0]
    assert still.depth_m is not None
    true_m = small_scene.depth_m(shot_at(3, (0.0, 0.0)).camera.resized(74, 160))
    known = still.depth_m > 0
    assert 0.6 < known.mean() < 0.99
    assert np.median(np.abs(still.depth_m - true_m)[known] / true_m[known]) < 0.03
