"""The light field has no state: the same views and camera give the same rendering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from peaking.datasets import Recording, open_recording
from peaking.light_field import (
    LightField,
    Scratch,
    blend_renderings,
    choose_views,
    compare_with,
    render_views,
)
from peaking.mpi import Mpi
from peaking.options import DEFAULT, PAPER
from peaking.rendering import render
from peaking.view_builder import ViewBuilder
from recordings import write_recording

SMALL = replace(DEFAULT, pixels=64 * 48, num_planes=8)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return open_recording(write_recording(tmp_path_factory.mktemp("field") / "room", num_frames=6))


@pytest.fixture(scope="module")
def mpis(recording: Recording) -> list[Mpi]:
    builder = ViewBuilder(SMALL)
    return [builder.generate(recording.read(i)) for i in range(5)]


def test_looking_elsewhere_in_between_changes_nothing(mpis: list[Mpi]) -> None:
    field, scratch = LightField(mpis, SMALL), Scratch()
    camera = mpis[0].camera
    once = field.render(camera, scratch=scratch)
    rgba = once.rgba.copy()
    field.render(mpis[4].camera, scratch=scratch)
    field.render(camera.resized(31, 17), scratch=scratch)
    np.testing.assert_array_equal(once.rgba, rgba)
    np.testing.assert_array_equal(field.render(camera, scratch=scratch).rgba, rgba)
    np.testing.assert_array_equal(field.render(camera).rgba, rgba)


def test_renderings_that_are_there_blend_to_the_same(mpis: list[Mpi]) -> None:
    camera, weights = mpis[2].camera, [0.5, 0.3, 0.2]
    together = render_views(mpis[:3], weights, camera)
    alone = blend_renderings([render(mpi, camera) for mpi in mpis[:3]], weights)
    np.testing.assert_array_equal(together.rgba, alone.rgba)
    np.testing.assert_array_equal(together.depth_m, alone.depth_m)


def test_one_mpi_is_asked_for_to_choose_views_and_none_by_distance(mpis: list[Mpi]) -> None:
    asked: list[int] = []

    def get_mpi(number: int) -> Mpi:
        asked.append(number)
        return mpis[number]

    cameras = [mpi.camera for mpi in mpis]
    chosen = choose_views(cameras, cameras[3], SMALL, get_mpi=get_mpi)
    assert asked == [3]
    assert chosen[0].index == 3
    by_distance = choose_views(cameras, cameras[3], PAPER, get_mpi=get_mpi)
    assert asked == [3]
    assert len(by_distance) == PAPER.neighbours


def test_a_view_of_a_guessed_scale_is_shown_only_while_it_is_alone(mpis: list[Mpi]) -> None:
    camera = mpis[1].camera
    beside = LightField(mpis[:3], SMALL, guessed=frozenset({1}))
    assert {neighbour.index for neighbour in beside.choose_views(camera)} == {0, 2}
    alone = LightField(mpis[1:2], SMALL, guessed=frozenset({0}))
    assert [neighbour.index for neighbour in alone.choose_views(camera)] == [0]


def test_a_comparison_is_rendering_and_error_map_of_the_same_views(
    recording: Recording, mpis: list[Mpi]
) -> None:
    live = ViewBuilder(SMALL).prepare(recording.read(5))
    field = LightField(mpis[:2], SMALL)
    compared = field.compare(live.rgb, live.camera)
    assert compared.neighbours == field.choose_views(live.camera)
    rendering = field.render(live.camera, neighbours=compared.neighbours)
    np.testing.assert_array_equal(compared.rendering.rgba, rendering.rgba)
    errors = compare_with(SMALL, rendering, live.rgb)
    np.testing.assert_array_equal(compared.errors.peaked, errors.peaked)


def test_without_a_view_there_is_nothing_to_render(mpis: list[Mpi]) -> None:
    with pytest.raises(ValueError, match="at least one captured view"):
        LightField([], SMALL).render(mpis[0].camera)
    with pytest.raises(ValueError, match="one weight per rendering"):
        render_views(mpis[:2], [1.0], mpis[0].camera)
