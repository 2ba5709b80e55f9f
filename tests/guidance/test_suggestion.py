"""Poses around the path, the one that is suggested, and whether it stays."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from peaking.geometry import Camera, Pinhole, Rigid
from peaking.guidance.completeness import BESIDE, ENOUGH, Scored, score, scored, verdict
from peaking.guidance.foresight import GOOD, NOTHING, Foresight
from peaking.guidance.next_view import (
    BETTER,
    MIN_HELP,
    MOST_NEW,
    Suggestion,
    apart,
    keep_or_change,
    suggestions,
)
from peaking.guidance.virtual_cameras import (
    CLEARANCE,
    MAX_CAMERAS,
    Moved,
    VirtualCamera,
    poses_around,
    step_length_m,
)

PINHOLE = Pinhole(30, 40, 40.0, 40.0, 15.0, 20.0)
NOWHERE = np.empty((0, 3), np.float32)


def at(x_m: float, y_m: float = 0.0, z_m: float = 0.0) -> Camera:
    return Camera(PINHOLE, Rigid(np.eye(3), np.array([x_m, y_m, z_m])))


def foresight(
    *, new: float = 0.0, wrong: float = 0.0, one_side: float = 0.0, lost: float = 0.0
) -> Foresight:
    error = GOOD + NOTHING * new + 0.01 * wrong
    return Foresight(error, new, wrong, one_side, lost, (0.8, 0.1))


def virtual(x_m: float, moved: Moved = "left") -> VirtualCamera:
    return VirtualCamera(at(x_m), moved)


def test_around_a_view_one_can_step_and_turn() -> None:
    found = poses_around([at(0.0)], [], NOWHERE, 0.25)
    assert [each.moved for each in found] == [
        "here",
        *("left", "right", "up", "down", "closer", "back"),
        *("turned left", "turned right", "turned up", "turned down"),
    ]
    left, down, closer = found[1].camera, found[4].camera, found[5].camera
    np.testing.assert_allclose(left.position_m, [-0.25, 0, 0])
    np.testing.assert_allclose(down.position_m, [0, 0.25, 0])
    np.testing.assert_allclose(closer.position_m, [0, 0, 0.25])
    turned_left, turned_up = found[7].camera, found[9].camera
    assert turned_left.forward[0] < -0.2
    assert turned_up.forward[1] < -0.2
    assert {each.moved for each in found if each.walked} == {"here"}


def test_half_way_between_views_is_looked_at() -> None:
    found = poses_around([at(0.0), at(1.0)], [], NOWHERE, 0.25)
    (between,) = [each.camera for each in found if each.moved == "between"]
    np.testing.assert_allclose(between.position_m, [0.5, 0, 0])


def test_nobody_is_sent_into_a_wall_or_through_it() -> None:
    """A wall 0.3 m to the right; a thin pole half a step ahead."""
    y, z = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    wall = np.stack([np.full_like(y, 0.3), y, z], axis=-1).reshape(-1, 3)
    pole = np.stack([np.zeros(41), np.linspace(-1, 1, 41), np.full(41, 0.2)], axis=-1)
    surface_m = np.concatenate([wall, pole]).astype(np.float32)
    found = poses_around([at(0.0)], [], surface_m, 0.25)
    assert {"right", "closer"}.isdisjoint({each.moved for each in found})
    assert {"left", "back"} <= {each.moved for each in found}
    for each in found[1:]:
        clear_m = np.linalg.norm(wall - each.camera.position_m, axis=1).min()
        assert clear_m >= CLEARANCE * 0.25


def test_however_long_the_walk_there_are_not_too_many() -> None:
    path = [at(0.1 * k, 0.01 * (k % 7)).world_from_cam for k in range(2000)]
    found = poses_around([at(0.0)], path, NOWHERE, 0.1)
    assert 0.1 * MAX_CAMERAS < len(found) <= MAX_CAMERAS
    for a, b in itertools.combinations(found[:40], 2):
        same_way = a.camera.forward @ b.camera.forward > 0.999
        assert not same_way or np.linalg.norm(a.camera.position_m - b.camera.position_m) > 0.09


def test_a_step_suits_the_scene_and_stays_while_it_grows() -> None:
    assert step_length_m(1.0) == pytest.approx(0.15, rel=0.2)
    assert step_length_m(100.0) == pytest.approx(0.5)
    assert step_length_m(1.7) == step_length_m(1.75)
    with pytest.raises(ValueError, match="scene_depth_m > 0"):
        step_length_m(0.0)


def found(*each: tuple[float, Foresight]) -> list[Suggestion]:
    """Rank poses that are all scored."""
    poses = [virtual(x_m) for x_m, _ in each]
    foreseen = [foreseen for _, foreseen in each]
    pictures = [Scored(pose.camera, one) for pose, one in zip(poses, foreseen, strict=True)]
    return suggestions(poses, foreseen, pictures, step_m=0.1)


def test_most_help_comes_first_and_little_is_not_worth_it() -> None:
    ranked = found(
        (0.0, foresight(wrong=0.1)),
        (1.0, foresight(new=0.3)),
        (2.0, foresight(wrong=0.9 * MIN_HELP)),
        (3.0, foresight(wrong=0.4, lost=0.4)),
        (4.0, foresight(new=MOST_NEW + 0.1)),
    )
    assert [s.camera.position_m[0] for s in ranked] == [1.0, 0.0]


def test_what_is_far_is_worth_less() -> None:
    poses = [virtual(0.0), virtual(5.0)]
    help_ = [foresight(new=0.2), foresight(new=0.25)]
    near = suggestions(poses, help_, [], step_m=0.1, here=at(0.1))
    assert near[0].camera.position_m[0] == 0.0
    assert suggestions(poses, help_, [], step_m=0.1)[0].camera.position_m[0] == 5.0


def test_a_view_is_worth_what_it_mends_of_the_walk() -> None:
    """Of two poses with as much to mend in their own picture, the one that more was walked by."""
    poses = [virtual(0.0), virtual(5.0)]
    help_ = [foresight(new=0.2), foresight(new=0.2)]
    walked = [Scored(at(5.0 + 0.02 * k), foresight(new=0.2)) for k in range(5)]
    ranked = suggestions(poses, help_, [Scored(at(0.0), foresight(new=0.2)), *walked], step_m=0.1)
    assert ranked[0].camera.position_m[0] == 5.0
    calm = [Scored(each.camera, foresight()) for each in walked]
    ranked = suggestions(poses, help_, [Scored(at(0.0), foresight(new=0.2)), *calm], step_m=0.1)
    assert ranked[0].camera.position_m[0] == 0.0


def test_one_is_sent_where_nothing_was_seen_only_if_one_was_there() -> None:
    new = foresight(new=MOST_NEW + 0.1)
    expected: dict[Moved, int] = {"here": 1, "between": 1, "left": 0, "turned left": 0}
    for moved, count in expected.items():
        assert len(suggestions([virtual(0.0, moved)], [new], [], step_m=0.1)) == count


def suggestion(x_m: float, gain: float) -> Suggestion:
    return Suggestion(virtual(x_m), foresight(new=0.2), gain)


def test_a_suggestion_stays_until_another_helps_much_more() -> None:
    before = suggestion(0.0, 0.3)
    here, there = suggestion(0.0, 0.2), suggestion(1.0, 0.99 * BETTER * 0.2)
    assert keep_or_change(before, [there, here]) is here
    much = suggestion(1.0, 1.01 * BETTER * 0.2)
    assert keep_or_change(before, [much, here]) is much
    assert keep_or_change(before, [there]) is there  # it was taken
    assert keep_or_change(None, [there, here]) is there
    assert keep_or_change(before, []) is None


def test_reasons_are_in_plain_words() -> None:
    (new,) = found((0.0, foresight(new=0.3)))
    (alone,) = found((0.0, foresight(wrong=0.3, one_side=0.2)))
    (differ,) = found((0.0, foresight(wrong=0.3, one_side=0.1)))
    assert new.reason == "new: on the right"
    assert alone.reason == "wrong: seen from one side only"
    assert differ.reason == "wrong: your views differ there"


def test_what_is_left_is_at_different_places() -> None:
    ranked = found(*((x_m, foresight(new=0.3 - 0.1 * x_m)) for x_m in (0.0, 0.05, 1.0)))
    kept = apart(ranked, 3, step_m=0.1)
    assert sorted(s.camera.position_m[0] for s in kept) == [0.0, 1.0]
    assert len(apart(ranked, 1, step_m=0.1)) == 1


def test_the_verdict() -> None:
    assert verdict(ENOUGH, helps=True) == "enough"
    assert verdict(0.7, helps=True) == "go on"
    assert verdict(0.7, helps=False) == "no more help"


def test_who_has_hardly_moved_is_not_done() -> None:
    good = foresight()
    bad = Foresight(NOTHING + GOOD, 1.0, 0.0, 0.0, 0.0, (0.0, 0.0))
    assert score([]) == 0.0
    walk, aside = [(at(0.0), good)] * 2, [(at(0.1), bad)]
    assert score(scored(walk, aside)) == pytest.approx(2 / (2 + BESIDE) * good.complete, abs=1e-6)
    assert score(scored(walk * 32, aside * 5)) > 0.8 * good.complete
    assert score(scored(walk)) == pytest.approx(good.complete)


def test_what_no_view_will_mend_is_not_missing() -> None:
    assert Scored(at(0.0), foresight(new=0.3, lost=0.3)).missing == 0
    whole = Scored(at(0.0), foresight(new=0.3)).missing
    assert Scored(at(0.0), foresight(new=0.3, lost=0.15)).missing == pytest.approx(whole / 2)
    assert whole == pytest.approx(1 - foresight(new=0.3).complete)
