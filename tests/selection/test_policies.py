"""Which views policies choose: worked by hand, laws, and what each may know."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import PeakingError
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.mpi import Mpi
from peaking.options import DEFAULT, PolicyName
from peaking.output import encode_png
from peaking.selection import backward_elimination
from peaking.selection.auto_shutter import WORTH_SHARE, AutoShutter
from peaking.selection.backward_elimination import HELD_PER_VIEW, BackwardElimination
from peaking.selection.coverage import cover
from peaking.selection.policy import Candidate, CandidatePath, Decision, Policy, walk
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.registry import (
    POLICIES,
    NeedsWholePath,
    SelectionOptions,
    create_policy,
    select_from,
)
from peaking.selection.spacing import Spacing, spaced
from peaking.selection.threshold import Threshold, taken_at
from peaking.selection.uniform import path_m, spread_along
from recordings import lateral_cameras, write_recording

SIZE_PX = (48, 64)
NUM_FRAMES = 24
SMALL = replace(DEFAULT, pixels=48 * 64, num_planes=8)
PINHOLE = Pinhole(4, 4, 4.0, 4.0, 2.0, 2.0)


def cameras_at(*places_x_m: float) -> list[Camera]:
    return [Camera(PINHOLE, Rigid(np.eye(3), np.array([x, 0.0, 0.0]))) for x in places_x_m]


@dataclass
class Told:
    """A candidate that is told how red it is, and remembers what it was asked."""

    number: int
    share: float = 0.0
    x_m: float = 0.0
    accepted: bool = True
    asked: list[tuple[int, ...]] = field(default_factory=list[tuple[int, ...]])

    @property
    def camera(self) -> Camera:
        return cameras_at(self.x_m)[0]

    def sharpness(self) -> float:
        raise PeakingError("nobody may look")

    def frame(self, pixels: int) -> Frame:
        raise PeakingError("nobody may look")

    def mpi(self, pixels: int) -> Mpi:
        raise PeakingError("nobody may look")

    def peaked_share(self, views: Sequence[int]) -> float:
        self.asked.append(tuple(views))
        return self.share


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> RecordedFrames:
    root: Path = tmp_path_factory.mktemp("walk") / "walk"
    write_recording(root, cameras=lateral_cameras(NUM_FRAMES, *SIZE_PX))
    return RecordedFrames(open_recording(root), SMALL)


def whole(frames: RecordedFrames) -> CandidatePath:
    return frames.path(range(NUM_FRAMES))


# By hand


def test_the_threshold_takes_the_first_and_what_is_redder_than_it() -> None:
    policy = Threshold(0.1)
    candidates = [Told(7, 0.0), Told(8, 0.1), Told(9, 0.11), Told(10, 0.5)]
    decisions = [policy.observe(candidate) for candidate in candidates]
    assert [decision.take for decision in decisions] == [True, False, True, True]
    assert [decision.reason for decision in decisions] == [
        "the first view", "10.00% red", "11.00% red", "50.00% red",
    ]  # fmt: skip
    assert policy.views == (7, 9, 10)
    assert [candidate.asked for candidate in candidates] == [[], [(7,)], [(7,)], [(7, 9)]]


def test_a_frame_without_depth_is_not_taken_and_the_next_one_is() -> None:
    policy = Threshold(0.1)
    blind = Told(0, accepted=False)
    assert policy.observe(blind).reason == "no depth"
    assert policy.observe(Told(1)).take


def test_spacing_asks_for_its_distance_from_all_views_where_the_path_returns() -> None:
    path = CandidatePath(
        [Told(k, x_m=x) for k, x in enumerate((0.0, 0.4, 1.0, 0.1, 2.0))], scene_depth_m=1.0
    )
    assert spaced(path, 0.5) == [0, 2, 4]
    policy = Spacing(0.5)
    policy.observe(path.candidates[0])
    assert policy.observe(path.candidates[1]).reason == "40.0 cm from the nearest view"


def test_uniform_goes_by_the_path_and_not_by_the_number() -> None:
    cameras = cameras_at(0.0, 0.1, 0.2, 0.3, 2.0, 4.0)
    np.testing.assert_allclose(path_m(cameras), [0.0, 0.1, 0.2, 0.3, 2.0, 4.0])
    assert spread_along(cameras, 3) == [0, 4, 5]


def test_uniform_takes_no_view_twice() -> None:
    assert spread_along(cameras_at(0.0, 1.0, 1.0, 1.0), 4) == [0, 1, 2, 3]


def test_a_rotation_can_count_as_a_way() -> None:
    turned = Rigid(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    cameras = [*cameras_at(0.0), Camera(PINHOLE, turned)]
    np.testing.assert_allclose(path_m(cameras), [0.0, 0.0])
    np.testing.assert_allclose(path_m(cameras, metres_per_rad=2.0), [0.0, 2 * np.pi])


# All of them


@pytest.mark.parametrize("name", sorted(POLICIES))
@pytest.mark.parametrize("count", [2, 5])
def test_every_policy_gives_as_many_as_asked(
    frames: RecordedFrames, name: PolicyName, count: int
) -> None:
    numbers = [i for i in range(NUM_FRAMES) if i % 3]
    chosen = select_from(frames.path(numbers), SelectionOptions(name, num_views=count), SMALL)
    assert chosen == sorted(set(chosen))
    assert set(chosen) <= set(numbers)
    assert len(chosen) == (len(numbers) if name == "all" else count)


ONLINE: dict[PolicyName, SelectionOptions] = {
    "peaking": SelectionOptions("peaking", num_views=3),
    "auto-shutter": SelectionOptions("auto-shutter", num_views=3),
    "threshold": SelectionOptions("threshold", threshold_share=0.05),
    "plenoptic": SelectionOptions("plenoptic", spacing_m=0.1),
}


@pytest.mark.parametrize("name", sorted(ONLINE))
def test_what_is_held_follows_from_the_frames_seen_so_far(
    frames: RecordedFrames, name: PolicyName
) -> None:
    """A policy that goes on to other frames has held the same until then."""
    candidates = whole(frames).candidates
    until, other = candidates[:10], candidates[:9:-1]  # then forwards, then backwards
    held: list[list[tuple[int, ...]]] = []
    for path in ([*until, *candidates[10:]], [*until, *other]):
        policy = create_policy(ONLINE[name], SMALL)
        held.append([held_after(policy, candidate) for candidate in path])
    assert held[0][:10] == held[1][:10]
    assert held[0][-1] != held[1][-1]


def held_after(policy: Policy, candidate: Candidate) -> tuple[int, ...]:
    policy.observe(candidate)
    return tuple(policy.views)


@pytest.mark.parametrize("name", sorted(ONLINE))
def test_decisions_add_up_to_what_is_held(frames: RecordedFrames, name: PolicyName) -> None:
    policy = create_policy(ONLINE[name], SMALL)
    held: set[int] = set()
    for candidate in whole(frames).candidates:
        decision = policy.observe(candidate)
        assert decision.reason
        assert set(decision.dropped) <= held
        held -= set(decision.dropped)
        held |= {candidate.number} if decision.take else set()
        assert held == set(policy.views)
    held -= set(policy.finish().dropped)
    assert held == set(policy.views)


def test_those_that_need_the_whole_path_say_so() -> None:
    needing: set[PolicyName] = {name for name, kind in POLICIES.items() if kind.needs_whole_path}
    assert needing == {
        "uniform", "every-nth", "sharpest", "farthest", "coverage", "random", "all",
    }  # fmt: skip
    also: set[PolicyName] = {"threshold", "plenoptic"}
    for name in needing | also:
        with pytest.raises(NeedsWholePath, match=f"whole path for the policy {name}"):
            create_policy(SelectionOptions(name, num_views=3))


def test_ours_needs_no_number_of_views(frames: RecordedFrames) -> None:
    chosen = select_from(whole(frames), SelectionOptions("peaking"), SMALL)
    assert 1 <= len(chosen) < NUM_FRAMES


@pytest.mark.parametrize("name", ["random", "uniform", "plenoptic"])
def test_without_a_number_of_views_it_is_said(name: PolicyName) -> None:
    with pytest.raises(ValueError, match=f"need a number of views.*{name}"):
        create_policy(SelectionOptions(name))


@pytest.mark.parametrize("bad", [{"num_views": 0}, {"seed": -1}, {"threshold_share": 1.0}], ids=str)
def test_impossible_selections_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="need"):
        SelectionOptions(**bad)  # type: ignore[arg-type]


# Threshold


def test_random_follows_its_seed(frames: RecordedFrames) -> None:
    once, again, other = (
        select_from(whole(frames), SelectionOptions("random", num_views=6, seed=seed), SMALL)
        for seed in (3, 3, 4)
    )
    assert once == again
    assert once != other


def test_a_lower_threshold_takes_more(frames: RecordedFrames) -> None:
    few = taken_at(whole(frames).candidates, 0.3).views
    more = taken_at(whole(frames).candidates, 0.02).views
    assert few[0] == more[0] == 0
    assert len(few) < len(more)


# Automatic shutter


def test_it_holds_only_what_was_worth_a_picture(frames: RecordedFrames) -> None:
    policy = AutoShutter(2, SMALL, worth_share=0.05)
    calm = 0
    for candidate in whole(frames).candidates:
        before = tuple(policy.views)
        share = candidate.peaked_share(before) if before else 1.0
        decision = policy.observe(candidate)
        if share <= 0.05:
            calm += 1
            assert decision == Decision(False, f"{share:.2%} red: nothing new")
            assert tuple(policy.views) == before
    assert 0 < calm < len(frames.recording) - 2, calm
    policy.finish()
    assert len(policy.views) == 2
    assert set(policy.worth) == set(policy.views)


def test_the_page_takes_pictures_at_the_same_share() -> None:
    page = (Path(__file__).parents[2] / "web/src/capture/auto_shutter.ts").read_text()
    found = re.search(r"WORTH_SHARE = ([\d.]+) / (\d+);", page)
    assert found is not None
    assert float(found[1]) / int(found[2]) == WORTH_SHARE


# Backward elimination


def test_who_stands_still_keeps_one_view(tmp_path: Path) -> None:
    walked = lateral_cameras(12, *SIZE_PX)
    cameras = [walked[0]] * 6 + walked[1:]
    write_recording(tmp_path / "still", cameras=cameras)
    still = RecordedFrames(open_recording(tmp_path / "still"), SMALL)
    chosen = select_from(
        still.path(range(len(cameras))), SelectionOptions("peaking", num_views=3), SMALL
    )
    assert sum(i < 6 for i in chosen) <= 1


def test_who_stands_still_keeps_the_sharp_one(tmp_path: Path) -> None:
    walked = lateral_cameras(12, 160, 120)
    cameras = [walked[0]] * 3 + walked[1:]
    root = write_recording(tmp_path / "still", cameras=cameras)
    for number in (0, 2):
        path = root / f"images/frame_{number:05d}.png"
        bgr = cv2.imread(str(path))
        assert bgr is not None
        path.write_bytes(encode_png(np.ascontiguousarray(cv2.blur(bgr, (7, 7))[..., ::-1])))
    options = replace(SMALL, pixels=160 * 120)
    still = RecordedFrames(open_recording(root), options)
    policy = BackwardElimination(11, options)
    decisions = [policy.observe(candidate) for candidate in still.path(range(4)).candidates]
    assert [decision.take for decision in decisions] == [True, True, False, True]
    assert decisions[1].dropped == (0,)
    assert policy.views == (1, 3)


def test_peaking_covers_the_whole_walk(frames: RecordedFrames) -> None:
    chosen = select_from(whole(frames), SelectionOptions("peaking", num_views=4), SMALL)
    assert np.diff([0, *chosen, NUM_FRAMES - 1]).max() <= NUM_FRAMES // 2


@pytest.mark.parametrize("place", [0, 7, 12])
def test_what_one_frame_alone_shows_is_held(tmp_path: Path, place: int) -> None:
    """One look at a part of the wall that nothing else shows, while all else is shown by many."""
    cameras = lateral_cameras(12, *SIZE_PX)
    aside = cameras[0].world_from_cam
    away = Rigid[World, Cam](aside.rotation, aside.translation_m + np.array([9.0, 0.0, 0.0]))
    cameras.insert(place, Camera(cameras[0].pinhole, away))
    once = RecordedFrames(
        open_recording(write_recording(tmp_path / "once", cameras=cameras)), SMALL
    )
    policy = BackwardElimination(4, SMALL)
    for candidate in once.path(range(len(cameras))).candidates:
        policy.observe(candidate)
    policy.finish()
    assert place in policy.views
    assert policy.worth[place].why == "shows what no other does"
    assert policy.worth[place].psnr_db > 1


def test_few_views_of_different_things_are_not_called_enough(tmp_path: Path) -> None:
    first = lateral_cameras(1, *SIZE_PX)[0]
    apart = [
        Camera(first.pinhole, Rigid(np.eye(3), np.array([5.0 * i, 0.0, 0.0]))) for i in range(6)
    ]
    each = RecordedFrames(open_recording(write_recording(tmp_path / "each", cameras=apart)), SMALL)
    chosen = select_from(each.path(range(6)), SelectionOptions("peaking"), SMALL)
    assert chosen == [0, 1, 2, 3, 4, 5]


def test_of_equal_frames_the_first_stays(tmp_path: Path) -> None:
    """Doubled, a walk gives views from as many places, and never the later of two equal frames."""
    walked = lateral_cameras(12, *SIZE_PX)
    doubled = [camera for camera in walked for _ in range(2)]
    twice = RecordedFrames(open_recording(write_recording(tmp_path / "2", cameras=doubled)), SMALL)
    chosen = select_from(twice.path(range(24)), SelectionOptions("peaking", num_views=4), SMALL)
    assert len(chosen) == 4
    assert all(number % 2 == 0 for number in chosen)


def test_frames_that_are_remembered_are_bounded(
    frames: RecordedFrames, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backward_elimination, "MAX_SEEN", 10)
    policy = BackwardElimination(1, SMALL, with_curve=True)
    for candidate in whole(frames).candidates:
        policy.observe(candidate)
    policy.finish()
    assert len(policy.views) == 1
    assert policy.curve[-1].num_views == HELD_PER_VIEW
    assert np.isfinite([point.psnr_db for point in policy.curve]).all()


def test_the_curve_does_not_change_what_is_chosen(frames: RecordedFrames) -> None:
    views: list[tuple[int, ...]] = []
    for with_curve in (False, True):
        policy = BackwardElimination(3, SMALL, with_curve=with_curve)
        views.append(tuple(walk(policy, whole(frames).candidates)))
        assert policy.worth.keys() == set(policy.views)
    assert views[0] == views[1]


def test_coverage_takes_the_far_and_what_is_seen_from_new_directions() -> None:
    found = cover(cameras_at(0.0, 0.1, 0.2, 2.0, 4.0), 1.0, 5)
    assert set(found.places[:3]) == {0, 3, 4}
    assert found.left_m == 0.0
    blind = np.array([1.0, 1.0, 1.0, 1.0, 0.0])
    assert cover(cameras_at(0.0, 0.1, 0.2, 2.0, 4.0), 1.0, 2, worth=blind).places[1] == 3


def test_every_nth_is_even_in_time_and_sharpest_takes_one_of_each_window() -> None:
    class Sharp(Told):
        def sharpness(self) -> float:
            return (0.3, 0.9, 0.1, 0.2, 0.4, 0.8)[self.number]

    path = CandidatePath([Sharp(k, x_m=float(k**3)) for k in range(6)], scene_depth_m=1.0)
    assert select_from(path, SelectionOptions("every-nth", num_views=3)) == [0, 2, 5]
    assert select_from(path, SelectionOptions("sharpest", num_views=3)) == [1, 3, 5]


def test_it_never_holds_more_than_it_may(frames: RecordedFrames) -> None:
    policy = BackwardElimination(2, SMALL)
    for candidate in whole(frames).candidates:
        policy.observe(candidate)
        assert len(policy.views) <= HELD_PER_VIEW * 2
    assert len(policy.finish().dropped) == HELD_PER_VIEW * 2 - 2
    assert len(policy.views) == 2
