"""One test for each line of CONVENTIONS.md that code can break, in the order of that page."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.error_map import compare
from peaking.generators.layered import Layered
from peaking.geometry import Camera, Pinhole, Rigid, source_from_target
from peaking.mpi import CELL_PX, TILE_PX, Mpi, tile_grid
from peaking.rendering import Rendering, render
from peaking.rendering.blend import blend
from recordings import write_recording

PINHOLE = Pinhole(40, 30, 50.0, 50.0, 20.0, 15.0)
HERE = Camera(PINHOLE, Rigid.identity())


def one_plane(rgba: np.ndarray, depth_m: float = 2.0) -> Mpi:
    return Mpi.from_dense(rgba[None].astype(np.uint8), np.array([depth_m]), HERE)


def test_axes_of_a_camera() -> None:
    """What is to the right, below and ahead has growing x, y and depth."""
    pixels, depth_m = HERE.project(np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 2.0]]))
    assert pixels[0, 0] > PINHOLE.cx_px
    assert pixels[1, 1] > PINHOLE.cy_px
    assert depth_m[1] > depth_m[0] > 0


def test_files_have_opengl_axes_and_are_turned_at_the_door(tmp_path: Path) -> None:
    recording = open_recording(write_recording(tmp_path / "room", num_frames=2))
    stored = json.loads((tmp_path / "room/transforms.json").read_text())["frames"][1]
    opengl = np.array(stored["transform_matrix"])
    camera = recording.cameras[1]
    np.testing.assert_allclose(camera.forward, -opengl[:3, 2], atol=1e-6)
    np.testing.assert_allclose(camera.world_from_cam.rotation[:, 1], -opengl[:3, 1], atol=1e-6)
    np.testing.assert_allclose(camera.position_m, opengl[:3, 3], atol=1e-6)


def test_transforms_are_target_from_source() -> None:
    there = Camera(PINHOLE, Rigid(np.eye(3), np.array([1.0, 0.0, 0.0])))
    # The origin of `there` lies 1 m to the right, seen from `HERE`.
    moved = source_from_target(HERE, there).apply(np.zeros((1, 3)))
    np.testing.assert_allclose(moved, [[1, 0, 0]])


def test_the_first_pixels_centre_is_at_a_half() -> None:
    np.testing.assert_allclose(PINHOLE.pixel_centers()[0, 0], [0.5, 0.5])
    np.testing.assert_allclose(PINHOLE.pixel_centers()[2, 3], [3.5, 2.5])


def test_resizing_scales_and_shifts_nothing() -> None:
    twice = PINHOLE.resized(80, 60)
    assert (twice.fx_px, twice.cx_px, twice.cy_px) == (100, 40, 30)


def test_depth_is_along_the_axis_and_not_along_the_ray() -> None:
    rgba = np.full((30, 40, 4), 255)
    seen = render(one_plane(rgba), HERE)
    np.testing.assert_allclose(seen.depth_m, 2.0, atol=1e-5)


def test_depth_on_disk_is_16_bit_millimetres_and_0_is_unknown(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "room", num_frames=1)
    entry = json.loads((folder / "transforms.json").read_text())["frames"][0]
    stored = np.asarray(cv2.imread(str(folder / entry["depth_file_path"]), cv2.IMREAD_UNCHANGED))
    assert stored.dtype == np.uint16
    read = open_recording(folder).read(0).depth_m
    assert read is not None
    np.testing.assert_allclose(read, stored / 1000.0, rtol=1e-6)
    assert (read[stored == 0] == 0).all()


def test_colours_beside_an_alpha_are_premultiplied() -> None:
    rgba = np.zeros((30, 40, 4))
    rgba[..., 0], rgba[..., 3] = 128, 128  # red of half opacity
    seen = render(one_plane(rgba), HERE)
    np.testing.assert_allclose(seen.rgba[15, 20], [128 / 255, 0, 0, 128 / 255], atol=1e-6)
    np.testing.assert_allclose(seen.rgb()[15, 20], [1, 0, 0], atol=1e-6)


def test_planes_are_ordered_from_the_farthest() -> None:
    depth_m = np.linspace(1.0, 3.0, 1200, dtype=np.float32).reshape(30, 40)
    mpi = Layered(num_planes=8)(np.zeros((30, 40, 3), np.uint8), depth_m, HERE)
    assert (np.diff(mpi.plane_depths_m) < 0).all()
    with pytest.raises(ValueError, match="farthest"):
        Mpi(HERE, np.array([1.0, 2.0]), mpi.tile_places[:0], mpi.texels[:0])


def test_tiles_own_15_texels_and_start_one_outside_the_picture() -> None:
    assert (CELL_PX, TILE_PX) == (15, 16)
    assert tile_grid(14, 14) == (1, 1)
    assert tile_grid(15, 14) == (1, 2)
    rgba = np.zeros((30, 40, 4))
    rgba[0, 0] = 255
    mpi = one_plane(rgba)
    np.testing.assert_array_equal(mpi.tile_places, [[0, 0, 0]])
    assert mpi.texels[0, 1, 1, 3] == 255
    rgba = np.zeros((30, 40, 4))
    rgba[14, 14] = 255  # first texel of cell (1, 1), and in the aprons of the three before it
    mpi = one_plane(rgba)
    np.testing.assert_array_equal(mpi.tile_places[:, 1:], [[0, 0], [0, 1], [1, 0], [1, 1]])
    places = [np.argwhere(tile[..., 3])[0].tolist() for tile in mpi.texels]
    assert places == [[15, 15], [15, 0], [0, 15], [0, 0]]


def test_outside_the_picture_there_is_transparent_black() -> None:
    rgba = np.full((30, 40, 4), 255)
    half_a_pixel_m = 0.5 * 2.0 / 50.0
    aside = Camera(PINHOLE, Rigid(np.eye(3), np.array([half_a_pixel_m, 0.0, 0.0])))
    seen = render(one_plane(rgba), aside)
    np.testing.assert_allclose(seen.rgba[15, -1], 0.5, atol=0.005)


def test_blending_of_views() -> None:
    rgba = np.array([[0.5, 0, 0, 0.5], [0, 1, 0, 1]], np.float32).reshape(2, 1, 1, 4)
    depth_m = np.ones((2, 1, 1), np.float32)
    seen = blend(rgba, depth_m, [0.5, 0.5], opacity="paper")
    # Σ w α = 0.75; c = (0.25 red + 0.5 green) / 0.75.
    np.testing.assert_allclose(seen.rgb()[0, 0], [1 / 3, 2 / 3, 0], atol=1e-6)
    assert seen.alpha[0, 0] == pytest.approx(0.75)


def test_error_and_peaked_share() -> None:
    rgba = np.zeros((1, 4, 4), np.float32)
    rgba[..., 3] = 1
    live = np.zeros((1, 4, 3), np.uint8)
    live[0, 0] = 255
    errors = compare(Rendering(rgba, np.ones((1, 4), np.float32)), live, shift_px=0)
    assert errors.error[0, 0] == pytest.approx(3.0)
    assert errors.peaked_share == 0.25
