"""At least one test for each line of CONVENTIONS.md, in the order of that page."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.depth import complete
from peaking.error_map import compare
from peaking.frame import Frame
from peaking.generators.layered import Layered
from peaking.geometry import Camera, Pinhole, Rigid, World, source_from_target
from peaking.mpi import CELL_PX, TILE_PX, Mpi, tile_grid
from peaking.options import DEFAULT
from peaking.output import encode_png
from peaking.pipeline import Reconstruction
from peaking.rendering import Rendering, render
from peaking.rendering.blending import blend
from recordings import write_recording

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src" / "peaking"
A_FEW_PIXELS = 2 / (64 * 48)
"""Peaked or missing where a pose is rounded another way; measured: 0."""

PINHOLE = Pinhole(40, 30, 50.0, 50.0, 20.0, 15.0)
HERE = Camera(PINHOLE, Rigid.identity())

Test = TypeVar("Test", bound=Callable[..., None])
_held: set[str] = set()


def holds(line: str) -> Callable[[Test], Test]:
    """Say which line of the page a test holds."""

    def mark(test: Test) -> Test:
        _held.add(line)
        return test

    return mark


def one_plane(rgba: np.ndarray, depth_m: float = 2.0) -> Mpi:
    return Mpi.from_dense(rgba[None].astype(np.uint8), np.array([depth_m]), HERE)


@holds("Axes of a camera")
def test_axes_of_a_camera() -> None:
    """What is to the right, below and ahead has growing x, y and depth."""
    pixels, depth_m = HERE.project(np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 2.0]]))
    assert pixels[0, 0] > PINHOLE.cx_px
    assert pixels[1, 1] > PINHOLE.cy_px
    assert depth_m[1] > depth_m[0] > 0


@holds("Axes of a camera")
def test_files_have_opengl_axes_and_are_turned_at_the_door(tmp_path: Path) -> None:
    recording = open_recording(write_recording(tmp_path / "room", num_frames=2))
    stored = json.loads((tmp_path / "room/transforms.json").read_text())["frames"][1]
    opengl = np.array(stored["transform_matrix"])
    camera = recording.cameras[1]
    np.testing.assert_allclose(camera.forward, -opengl[:3, 2], atol=1e-6)
    np.testing.assert_allclose(camera.world_from_cam.rotation[:, 1], -opengl[:3, 1], atol=1e-6)
    np.testing.assert_allclose(camera.position_m, opengl[:3, 3], atol=1e-6)


@holds("Axes of the world")
def test_nothing_depends_on_where_up_is(tmp_path: Path) -> None:
    """The same recording in a world that is turned upside down, askew and moved."""
    folder = write_recording(tmp_path / "room", num_frames=3)
    there = Rigid(cv2.Rodrigues(np.array([2.0, 0.7, -0.4]))[0], np.array([3.0, -20.0, 7.0]))
    shares: list[tuple[float, float]] = []
    for moves in (Rigid.identity(), there):
        scene = Reconstruction(replace(DEFAULT, pixels=64 * 48, num_planes=8))
        frames = [
            replace(
                frame,
                camera=replace(frame.camera, world_from_cam=moves @ frame.camera.world_from_cam),
            )
            for frame in map(open_recording(folder).read, range(3))
        ]
        for frame in frames[:2]:
            scene.add_view(frame)
        errors = scene.compare(frames[2].rgb, frames[2].camera).errors
        shares.append((errors.peaked_share, errors.unseen_share))
    assert shares[0][1] > 0
    np.testing.assert_allclose(shares[0], shares[1], atol=A_FEW_PIXELS)


def moved(frame: Frame, moved_from_world: Rigid[World, World]) -> Frame:
    world_from_cam = moved_from_world @ frame.camera.world_from_cam
    return replace(frame, camera=replace(frame.camera, world_from_cam=world_from_cam))


@holds("Transforms")
def test_transforms_are_target_from_source() -> None:
    there = Camera(PINHOLE, Rigid(np.eye(3), np.array([1.0, 0.0, 0.0])))
    # The origin of `there` lies 1 m to the right, seen from `HERE`.
    moved = source_from_target(HERE, there).apply(np.zeros((1, 3)))
    np.testing.assert_allclose(moved, [[1, 0, 0]])


@holds("Length")
def test_lengths_are_metres() -> None:
    """10 cm to the side move what is 2 m away by 2.5 of 50 pixels of focal length."""
    aside = Camera(PINHOLE, Rigid(np.eye(3), np.array([0.1, 0.0, 0.0])))
    point_m = np.array([[0.0, 0.0, 2.0]])
    moved_px = HERE.project(point_m)[0] - aside.project(point_m)[0]
    np.testing.assert_allclose(moved_px, [[2.5, 0.0]])


@holds("Length")
def test_no_name_has_another_unit_of_length() -> None:
    """Millimetres are on the wire and in a report; nothing else has them."""
    found = {
        name
        for _, tree in modules()
        for node in ast.walk(tree)
        for name in (getattr(node, "id", ""), getattr(node, "arg", ""), getattr(node, "attr", ""))
        if re.search(r"_(mm|cm|km|inch|inches|feet)$", str(name))
    }
    assert found <= {"depth_mm", "mean_error_mm"}


@holds("Pixels")
def test_points_are_x_before_y_and_arrays_rows_before_columns() -> None:
    assert PINHOLE.pixel_centers().shape == (PINHOLE.height_px, PINHOLE.width_px, 2)
    to_the_right, _ = HERE.project(np.array([[0.2, 0.0, 1.0]]))
    np.testing.assert_allclose(to_the_right, [[PINHOLE.cx_px + 10, PINHOLE.cy_px]])


@holds("Pixels")
def test_the_first_pixels_centre_is_at_a_half() -> None:
    np.testing.assert_allclose(PINHOLE.pixel_centers()[0, 0], [0.5, 0.5])
    np.testing.assert_allclose(PINHOLE.pixel_centers()[2, 3], [3.5, 2.5])


@holds("Resizing")
def test_resizing_scales_and_shifts_nothing() -> None:
    twice = PINHOLE.resized(80, 60)
    assert (twice.fx_px, twice.cx_px, twice.cy_px) == (100, 40, 30)


@holds("Depth")
def test_depth_is_along_the_axis_and_not_along_the_ray() -> None:
    rgba = np.full((30, 40, 4), 255)
    seen = render(one_plane(rgba), HERE)
    np.testing.assert_allclose(seen.depth_m, 2.0, atol=1e-5)


@holds("Depth")
def test_depth_on_disk_is_16_bit_millimetres_and_0_is_unknown(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "room", num_frames=1)
    entry = json.loads((folder / "transforms.json").read_text())["frames"][0]
    stored = np.asarray(cv2.imread(str(folder / entry["depth_file_path"]), cv2.IMREAD_UNCHANGED))
    assert stored.dtype == np.uint16
    read = open_recording(folder).read(0).depth_m
    assert read is not None
    np.testing.assert_allclose(read, stored / 1000.0, rtol=1e-6)
    assert (read[stored == 0] == 0).all()


@holds("A depth map")
def test_a_depth_map_covers_the_picture_at_any_size_of_its_aspect() -> None:
    """To within one of the depth map's own pixels; another aspect is another field of view."""
    rgb = np.zeros((60, 80, 3), np.uint8)
    left = np.array([1.0, 1.0, 2.0, 2.0], np.float32)
    for rows, cols in ((60, 80), (30, 40), (15, 20), (15, 21)):
        depth_m = np.tile(np.repeat(left, -(-cols // 4))[:cols], (rows, 1))
        whole = complete(depth_m, rgb)
        assert whole.shape == (60, 80)
        np.testing.assert_allclose(whole[:, :30], 1.0, atol=1e-3)
        np.testing.assert_allclose(whole[:, 50:], 2.0, atol=1e-3)
    with pytest.raises(ValueError, match="need depth of the aspect of 80x60"):
        complete(np.ones((20, 20), np.float32), rgb)


@holds("Colour")
def test_pictures_are_rgb_and_bytes_become_0_to_1(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "room", num_frames=1)
    bgr = np.zeros((48, 64, 3), np.uint8)
    bgr[..., 2] = 255  # OpenCV writes red last
    cv2.imwrite(str(folder / "images/frame_00000.png"), bgr)
    red = open_recording(folder).read(0).rgb
    np.testing.assert_array_equal(red[5, 5], [255, 0, 0])
    rgba = np.dstack([red[:30, :40], np.full((30, 40), 255, np.uint8)])
    np.testing.assert_allclose(render(one_plane(rgba), HERE).rgb()[15, 20], [1, 0, 0])


@holds("Colour")
def test_colours_mix_as_they_are_encoded() -> None:
    """Half of white over black is 0.5, as in the paper; mixed as light it would be 0.735."""
    rgba = np.zeros((2, 30, 40, 4), np.uint8)
    rgba[0, ..., 3] = 255
    rgba[1] = 128
    mpi = Mpi.from_dense(rgba, np.array([2.0, 1.0]), HERE)
    np.testing.assert_allclose(render(mpi, HERE).rgb()[15, 20], 128 / 255, atol=1e-6)


@holds("Alpha")
def test_colours_beside_an_alpha_are_premultiplied() -> None:
    rgba = np.zeros((30, 40, 4))
    rgba[..., 0], rgba[..., 3] = 128, 128  # red of half opacity
    seen = render(one_plane(rgba), HERE)
    np.testing.assert_allclose(seen.rgba[15, 20], [128 / 255, 0, 0, 128 / 255], atol=1e-6)
    np.testing.assert_allclose(seen.rgb()[15, 20], [1, 0, 0], atol=1e-6)


@holds("Order of planes")
def test_planes_are_ordered_from_the_farthest() -> None:
    depth_m = np.linspace(1.0, 3.0, 1200, dtype=np.float32).reshape(30, 40)
    mpi = Layered(num_planes=8)(np.zeros((30, 40, 3), np.uint8), depth_m, HERE)
    assert (np.diff(mpi.plane_depths_m) < 0).all()
    with pytest.raises(ValueError, match="farthest"):
        Mpi(HERE, np.array([1.0, 2.0]), mpi.tile_places[:0], mpi.texels[:0])


@holds("A plane")
def test_the_texels_of_a_plane_are_the_pixels_of_its_camera() -> None:
    """Parallel to the picture: from its own camera a plane is its picture, at any depth."""
    rgba = np.random.default_rng(1).integers(0, 256, (30, 40, 4))
    rgba[..., 3] = 255
    for depth_m in (0.5, 7.0):
        seen = render(one_plane(rgba, depth_m), HERE)
        np.testing.assert_allclose(seen.rgb(), rgba[..., :3] / 255, atol=1e-5)
        np.testing.assert_allclose(seen.depth_m, depth_m, rtol=1e-5)


@holds("Tiles")
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


@holds("Sampling")
def test_outside_the_picture_there_is_transparent_black() -> None:
    rgba = np.full((30, 40, 4), 255)
    half_a_pixel_m = 0.5 * 2.0 / 50.0
    aside = Camera(PINHOLE, Rigid(np.eye(3), np.array([half_a_pixel_m, 0.0, 0.0])))
    seen = render(one_plane(rgba), aside)
    np.testing.assert_allclose(seen.rgba[15, -1], 0.5, atol=0.005)


@holds("Sampling")
def test_between_texels_colours_are_interpolated() -> None:
    rgba = np.full((30, 40, 4), 255)
    rgba[:, 20:, :3] = 0  # white to the left of x = 20, black to the right
    quarter_of_a_pixel_m = 0.25 * 2.0 / 50.0
    aside = Camera(PINHOLE, Rigid(np.eye(3), np.array([quarter_of_a_pixel_m, 0.0, 0.0])))
    row = render(one_plane(rgba), aside).rgb()[15, 18:22, 0]
    np.testing.assert_allclose(row, [1, 0.75, 0, 0], atol=0.005)


@holds("Blending of views")
def test_blending_of_views() -> None:
    rgba = np.array([[0.5, 0, 0, 0.5], [0, 1, 0, 1]], np.float32).reshape(2, 1, 1, 4)
    depth_m = np.ones((2, 1, 1), np.float32)
    seen = blend(rgba, depth_m, [0.5, 0.5], opacity="paper")
    # Σ w α = 0.75; c = (0.25 red + 0.5 green) / 0.75.
    np.testing.assert_allclose(seen.rgb()[0, 0], [1 / 3, 2 / 3, 0], atol=1e-6)
    assert seen.alpha[0, 0] == pytest.approx(0.75)


@holds("Peaked share")
@holds("Error L1")
def test_error_and_peaked_share() -> None:
    rgba = np.zeros((1, 4, 4), np.float32)
    rgba[..., 3] = 1
    live = np.zeros((1, 4, 3), np.uint8)
    live[0, 0] = 255
    errors = compare(
        Rendering(rgba, np.ones((1, 4), np.float32)), live, shift_px=0.0, marks="paper"
    )
    assert errors.error[0, 0] == pytest.approx(3.0)
    assert errors.peaked_share == 0.25


@holds("Mask")
def test_what_is_0_in_a_mask_does_not_count(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=1)
    mask = np.ones((48, 64), np.uint8)
    mask[:, :16] = 0
    (folder / "mask.png").write_bytes(encode_png(mask))
    top = json.loads((folder / "transforms.json").read_text())
    (folder / "transforms.json").write_text(json.dumps(top | {"mask_path": "mask.png"}))
    frame = open_recording(folder).read(0)
    np.testing.assert_array_equal(np.asarray(frame.mask), mask > 0)
    rgba = np.zeros((48, 64, 4), np.float32)
    errors = compare(Rendering(rgba, np.zeros((48, 64), np.float32)), frame.rgb)
    assert errors.peaked_share == 1.0
    assert errors.within(frame.mask).peaked.sum() == mask.sum()
    assert errors.within(frame.mask).peaked_share == 1.0


CLOCKS = {
    "time": {"time", "time_ns", "perf_counter", "perf_counter_ns", "monotonic", "process_time"},
    "datetime": {"now", "utcnow", "today"},
    "date": {"today"},
}
CHANCE = {"random", "secrets", "uuid"}
"""Modules that draw from a generator of their own."""

AT_THE_COMMAND_LINE = ("cli.py", "commands/", "benchmarks/")


@holds("Random numbers and time")
def test_clocks_and_chance_are_handed_in() -> None:
    """A clock may stand as the default of a parameter, where a caller can hand in another one."""
    drawn = [
        f"{path}:{node.lineno}: {ast.unparse(node)}"
        for path, tree in modules()
        if not path.startswith(AT_THE_COMMAND_LINE)
        for node in _from_the_air(tree)
    ]
    assert drawn == []


def test_what_comes_from_the_air_is_found() -> None:
    from_the_air = """
import time, secrets as s
from random import shuffle
from time import perf_counter as now
import numpy as np
a = time.time()
b = np.random.rand(3)
c = np.random.default_rng()
d = s.token_hex(4)
shuffle(a)
e = Stopwatch(now)
"""
    handed_in = """
import time
import numpy as np
def wait(clock=time.time, *, rng: np.random.Generator, seconds_s=np.random.default_rng(1)):
    time.sleep(1)
    return clock()
"""
    assert [node.lineno for node in _from_the_air(ast.parse(from_the_air))] == [*range(6, 12)]
    assert list(_from_the_air(ast.parse(handed_in))) == []


def _from_the_air(tree: ast.Module) -> Iterator[ast.expr]:
    """Yield what reads a clock or a global generator, or names one other than as a default."""
    known = _imported(tree)
    handed = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.arguments)
        for default in (*function.defaults, *function.kw_defaults)
        if default is not None
        for node in ast.walk(default)
    }
    seeded = {id(call.func) for call in ast.walk(tree) if isinstance(call, ast.Call) and call.args}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Name) and id(node) not in handed:
            parts = ast.unparse(node).split(".")
            full = [*known.get(parts[0], "").split("."), *parts[1:]]
            if _is_source(full, seeded=id(node) in seeded):
                yield node


def _is_source(full: list[str], *, seeded: bool) -> bool:
    """Whether a name with its module, such as `numpy.random.rand`, is a clock or a dice."""
    module, last = full[:-1], full[-1]
    if module == ["numpy", "random"]:
        return last.islower() and not (last == "default_rng" and seeded)
    if module and module[0] in CHANCE:
        return True
    return (module == ["os"] and last == "urandom") or (
        bool(module) and last in CLOCKS.get(module[-1], ())
    )


def _imported(tree: ast.Module) -> dict[str, str]:
    """Return what names of imports stand for."""
    found: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                name = alias.asname or alias.name.partition(".")[0]
                found[name] = alias.name if alias.asname else name
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                found[alias.asname or alias.name] = f"{node.module}.{alias.name}"
    return found


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Yield every module of the package: its path in the package, and its syntax tree."""
    for path in sorted(SOURCE.rglob("*.py")):
        yield path.relative_to(SOURCE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def test_every_line_of_the_page_is_held() -> None:
    page = (ROOT / "CONVENTIONS.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| \*\*(.+?)\*\* \|", page, flags=re.MULTILINE)
    assert len(lines) == page.count("\n| **")
    assert _held == set(lines)
