"""What the views have seen, for any camera: by the cells alone, and by live depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.memory import Memory, _numba, _numpy
from peaking.memory.cells import PER_DEPTH, cells_at, centres_m, sizes_m
from peaking.memory.depth_maps import DepthMaps
from peaking.mpi import Mpi
from peaking.options import DEFAULT
from peaking.pipeline import Reconstruction
from peaking.view_builder import ViewBuilder
from recordings import Room

PINHOLE = Pinhole(96, 72, 80.0, 80.0, 48.0, 36.0)
OPTIONS = replace(DEFAULT, pixels=96 * 72, num_planes=16)
ROOM = Room()


def camera(x_m: float, y_m: float = 0.0, z_m: float = 0.0) -> Camera:
    return Camera(PINHOLE, Rigid(np.eye(3), np.array([x_m, y_m, z_m])))


def frame(at: Camera) -> Frame:
    rgb, depth_m = ROOM.photographed(at)
    return Frame("view", rgb, at, depth_m)


def view(at: Camera) -> Mpi:
    return ViewBuilder(OPTIONS).generate(frame(at))


@pytest.fixture(scope="module")
def two() -> list[Mpi]:
    return [view(camera(0.0)), view(camera(0.3))]


def truly_unseen(at: Camera, views: list[Mpi]) -> np.ndarray:
    """Return where the surface is in none of the views: outside their pictures, or hidden."""
    depth_m = ROOM.photographed(at)[1]
    points_m = at.world_from_cam.apply((at.pinhole.rays() * depth_m[..., None]).reshape(-1, 3))
    seen = np.zeros(len(points_m), np.bool_)
    for mpi in views:
        xy_px, z_m = mpi.camera.project(points_m)
        inside = mpi.camera.sees(points_m)
        x, y = np.where(inside[:, None], xy_px, 0.0).astype(int).T
        theirs_m = ROOM.photographed(mpi.camera)[1]
        seen |= inside & (z_m < 1.02 * theirs_m[np.minimum(y, 71), np.minimum(x, 95)])
    return ~seen.reshape(depth_m.shape)


BESIDE = [camera(0.8), camera(-0.5), camera(0.0, 0.4), camera(0.0, 0.0, -0.6)]


@pytest.mark.parametrize("at", BESIDE, ids=["right", "left", "below", "behind"])
@pytest.mark.parametrize("live", [True, False])
def test_what_no_view_saw_is_told(two: list[Mpi], at: Camera, live: bool) -> None:
    truth = truly_unseen(at, two)
    assert 0.03 < truth.mean() < 0.9
    depth_m = ROOM.photographed(at)[1]
    unseen = Memory(two).look(at, depth_m if live else None).unseen_at(96, 72)
    assert (unseen & truth).sum() / unseen.sum() > 0.9
    assert (unseen & truth).sum() / truth.sum() > 0.9


def test_where_a_view_was_taken_everything_was_seen(two: list[Mpi]) -> None:
    for mpi in two:
        assert Memory(two).look(mpi.camera).unseen.mean() < 0.05  # the rim of the picture
        depth_m = ROOM.photographed(mpi.camera)[1]
        assert Memory(two).look(mpi.camera, depth_m).unseen.mean() < 0.02


def test_a_thing_that_was_never_seen_is_told_by_live_depth_alone() -> None:
    """A box stands where views saw through to the wall."""
    empty = Room(box_m=None)
    rgb, depth_m = empty.photographed(camera(0.0))
    mpi = ViewBuilder(OPTIONS).generate(Frame("view", rgb, camera(0.0), depth_m))
    live_m = ROOM.photographed(camera(0.0))[1]
    box = live_m < 1.5
    memory = Memory([mpi])
    assert memory.look(camera(0.0)).unseen_at(96, 72)[box].mean() < 0.05
    # It stands in free space, which the view has seen through: that it came later is an error's
    # business, not a gap of what was seen.
    assert memory.look(camera(0.0), live_m).unseen_at(96, 72)[box].mean() < 0.05


def test_forgetting_is_as_if_it_had_never_been(two: list[Mpi]) -> None:
    third = view(camera(-0.2, 0.1))
    memory = Memory([*two, third])
    memory.follow(two)
    never = Memory(two)
    assert len(memory) == len(never)
    np.testing.assert_array_equal(memory.views, never.views)
    for at in BESIDE:
        depth_m = ROOM.photographed(at)[1]
        for live_m in (None, depth_m):
            np.testing.assert_array_equal(
                memory.look(at, live_m).unseen, never.look(at, live_m).unseen
            )


def test_the_first_view_can_be_forgotten(two: list[Mpi]) -> None:
    memory = Memory(two)
    memory.follow(two[1:])
    assert memory.look(two[1].camera).unseen.mean() < 0.05
    memory.follow([])
    assert len(memory) == 0
    assert memory.look(two[1].camera, ROOM.photographed(two[1].camera)[1]).unseen.all()


def test_a_cell_is_kept_once_however_many_views_saw_it(two: list[Mpi]) -> None:
    one, again = Memory(two[:1]), Memory([two[0], replace(two[0])])
    assert len(one) == len(again)
    np.testing.assert_array_equal(again.views, 2 * one.views)


def test_a_world_far_from_its_origin_is_the_same_world() -> None:
    away = Rigid(np.eye(3), np.array([448262.0, 5411932.0, 120.0]))

    def there(at: Camera) -> Camera:
        return Camera(at.pinhole, away @ at.world_from_cam)

    near = [view(camera(0.0)), view(camera(0.3))]
    far = [replace(mpi, camera=there(mpi.camera)) for mpi in near]
    for at in BESIDE:
        depth_m = ROOM.photographed(at)[1]
        here = Memory(near).look(at, depth_m).unseen
        assert (here != Memory(far).look(there(at), depth_m).unseen).mean() < 0.005


@given(seed=st.integers(0, 2**31))
@settings(max_examples=30)
def test_the_centre_of_a_cell_is_within_half_its_size(seed: int) -> None:
    random = np.random.default_rng(seed)
    depth_m = np.exp(random.uniform(-2, 4, 50))
    points_m = random.normal(size=(50, 3)) * depth_m[:, None]
    cells = cells_at(points_m, depth_m)
    size_m = sizes_m(cells)
    assert len(cells) == 50
    assert (np.abs(centres_m(cells) - points_m) <= (0.5 + 1e-3) * size_m[:, None]).all()
    assert ((size_m <= depth_m / PER_DEPTH) & (size_m > 0.5 * depth_m / PER_DEPTH)).all()
    np.testing.assert_array_equal(cells_at(centres_m(cells).astype(np.float64), depth_m), cells)


@pytest.mark.parametrize("seed", range(3))
def test_both_backends_see_the_same(seed: int) -> None:
    random = np.random.default_rng(seed)
    points_m = random.normal(size=(400, 3)).astype(np.float32) + np.array([0, 0, 2], np.float32)
    radius_m = random.uniform(0.005, 0.05, 400).astype(np.float32)
    arguments = points_m, radius_m, np.eye(3), np.array([0.1, 0.0, 0.2]), PINHOLE
    slow, fast = _numpy.look(*arguments), _numba.look(*arguments)
    same = slow[1] == fast[1]
    assert same.mean() > 0.999  # a rim that falls on a pixel's centre may be rounded either way
    np.testing.assert_allclose(slow[0][same], fast[0][same], rtol=1e-5)


def test_both_backends_ask_views_the_same(two: list[Mpi]) -> None:
    maps = DepthMaps()
    for mpi in two:
        maps.add(mpi.camera, ROOM.photographed(mpi.camera)[1])
    for at in BESIDE:
        live_m = ROOM.photographed(at)[1]
        asked = maps.asked_by(at, 2.0)
        slow = _numpy.behind(live_m, at.pinhole, asked)
        fast = _numba.behind(live_m, at.pinhole, asked)
        same = np.isclose(np.maximum(slow, 0), np.maximum(fast, 0), atol=1e-4)
        assert same.mean() > 0.998


def before_the_box() -> tuple[list[Mpi], Memory]:
    """Views of the room while there was no box in it, and what they have seen."""
    empty = Room(box_m=None)
    mpis: list[Mpi] = []
    for x_m in (0.0, 0.3, -0.3):
        rgb, depth_m = empty.photographed(camera(x_m))
        mpis.append(ViewBuilder(OPTIONS).generate(Frame("view", rgb, camera(x_m), depth_m)))
    return mpis, Memory(mpis)


def test_what_came_later_has_moved() -> None:
    """A box stands where views looked through to the wall."""
    _, memory = before_the_box()
    live_m = ROOM.photographed(camera(0.1))[1]
    box = live_m < 1.5
    everything = np.ones_like(box)
    moved = memory.moved(camera(0.1), everything, live_m)
    assert moved[box].mean() > 0.8
    assert moved[~box].mean() < 0.1
    assert not memory.moved(camera(0.1), ~everything, live_m).any()
    assert not memory.moved(camera(0.1), everything, None).any()
    assert not memory.moved(camera(0.1), everything, np.zeros_like(live_m)).any()


@pytest.mark.parametrize("at", [camera(0.15), *BESIDE])
def test_what_stands_still_has_not_moved(two: list[Mpi], at: Camera) -> None:
    """However wrong it is shown, and whatever of it was hidden."""
    live_m = ROOM.photographed(at)[1]
    assert Memory(two).moved(at, np.ones((72, 96), np.bool_), live_m).mean() < 0.01


def test_one_view_alone_tells_of_no_movement() -> None:
    """It may be wrong itself."""
    mpis, _ = before_the_box()
    live_m = ROOM.photographed(camera(0.1))[1]
    assert not Memory(mpis[:1]).moved(camera(0.1), np.ones((72, 96), np.bool_), live_m).any()


def test_both_backends_look_through_the_same() -> None:
    maps = DepthMaps()
    for x_m in (0.0, 0.3):
        maps.add(camera(x_m), Room(box_m=None).photographed(camera(x_m))[1])
    for at in [camera(0.1), *BESIDE]:
        live_m = ROOM.photographed(at)[1]
        asked = maps.asked_by(at, 2.0)
        slow = _numpy.looked_through(live_m, at.pinhole, asked)
        fast = _numba.looked_through(live_m, at.pinhole, asked)
        assert (slow == fast).mean() > 0.998
        box = live_m < 0.9 * Room(box_m=None).photographed(at)[1]
        assert (slow[box].mean() > 0.5) == box.any()


def test_what_has_moved_asks_for_no_view() -> None:
    scene = Reconstruction(OPTIONS)
    for x_m in (0.0, 0.3, -0.3):
        rgb, depth_m = Room(box_m=None).photographed(camera(x_m))
        scene.add_view(Frame("view", rgb, camera(x_m), depth_m))
    live = frame(camera(0.1))
    said = scene.compare(live.rgb, live.camera, depth_m=live.depth_m).errors
    without_depth = scene.compare(live.rgb, live.camera).errors
    assert said.unfixable_share > 0.02
    assert said.wrong_share < 0.3 * without_depth.wrong_share
    assert not (said.unfixable & (said.peaked | said.wrong)).any()
    assert without_depth.unfixable_share == 0.0


def test_a_reconstruction_remembers_what_it_was_given() -> None:
    scene = Reconstruction(OPTIONS)
    scene.add_view(frame(camera(0.0)))
    aside = frame(camera(0.8))
    before = scene.compare(aside.rgb, aside.camera, depth_m=aside.depth_m).errors
    scene.add_view(aside)
    after = scene.compare(aside.rgb, aside.camera, depth_m=aside.depth_m).errors
    scene.remove_view(1)
    undone = scene.compare(aside.rgb, aside.camera, depth_m=aside.depth_m).errors
    assert before.unseen_share > 0.2 > 0.02 > after.unseen_share
    np.testing.assert_array_equal(before.unseen, undone.unseen)
