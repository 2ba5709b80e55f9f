"""Parts of the client's renderer, one by one, against Python: in a real browser."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
from playwright.sync_api import Page

from peaking.datasets import open_recording
from peaking.geometry import Camera, Rigid
from peaking.mpi import Mpi
from peaking.mpi_file import decode, encode
from peaking.options import DEFAULT, Options
from peaking.pipeline import Reconstruction
from peaking.rendering import render
from peaking.server.recordings import wire_of_camera
from peaking.server.wire import options_for_clients
from peaking.view_builder import ViewBuilder

ROOT = Path(__file__).parents[2]
SIZE = (102, 222)
BLACK = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
# Measured with SwiftShader, November 2026: see the comment beside each.
COLOUR_MEAN = 0.7
"""Mean difference of a decoded JPEG's colour, 8-bit steps: browsers interpolate chroma. 0.47."""
COLOUR_FAR = 0.001
"""Share of its texels that differ by more than 24 steps. 0.0005; the largest difference is 58."""
SHRUNK_MEAN = 1.0
"""Mean difference of the live picture made small, 8-bit steps. 0.68 (factor 2.9)."""
SHRUNK_FAR = 12
"""Largest one. 9 (factor 2.9)."""
VIEW_MEAN = 0.5 / 255
"""Mean difference of a rendering; 8-bit targets round at every layer. 0.37 / 255."""
VIEW_WRONG = 0.005
"""Share of its pixels that differ by more than 8 / 255. 0.0039, where MPI and view coincide."""
FLASHES_PER_S = 3.0
"""WCAG 2.3.1; a flash is there and back. 1.5 (a picture that is wrong every 250 ms)."""
SOON_MS = 350.0
"""Until what stays wrong is shown. Analysis: 200 ms · ln 4, and a frame."""

OPTIONS = replace(
    DEFAULT, pixels=SIZE[0] * SIZE[1], compensate_exposure=False, marks="paper", filling_views=0
)


@pytest.fixture(scope="module")
def field() -> Reconstruction:
    """One view of the desk."""
    field = Reconstruction(OPTIONS)
    field.add_view(open_recording(ROOT / "scenes" / "desk").read(0))
    return field


def base64_of(data: bytes) -> str:
    return base64.b64encode(data).decode()


def pixels_of(text: str, width: int, height: int) -> np.ndarray:
    """Return RGBA, top row first, of what GL gives bottom row first."""
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)[::-1]


def scene_of(
    mpis: Sequence[Mpi], camera: Camera, live: np.ndarray, options: Options
) -> dict[str, Any]:
    opaque = np.full((*live.shape[:2], 1), 255, np.uint8)
    rgba = np.ascontiguousarray(np.concatenate([live, opaque], axis=-1)[::-1])
    return {
        "options": msgspec.to_builtins(options_for_clients(options)),
        "camera": msgspec.to_builtins(wire_of_camera(camera)),
        "live": base64_of(rgba.tobytes()),
        "mpis": [
            {
                "camera": msgspec.to_builtins(wire_of_camera(mpi.camera)),
                "file": base64_of(encode(mpi, codec="lossless")),
            }
            for mpi in mpis
        ],
    }


def one_frame(
    page: Page, scene: dict[str, Any], viewport: dict[str, int], size: tuple[int, int]
) -> dict[str, Any]:
    answer = page.evaluate(
        "([scene, viewport, size]) => core.oneFrame(scene, viewport, size)",
        [scene, viewport, {"width": size[0], "height": size[1]}],
    )
    assert answer["gl_error"] == 0
    answer["display"] = pixels_of(answer["display"], *size)
    for name in ("live", "view"):
        answer[name] = pixels_of(answer[name], answer["width"], answer["height"])
    return answer


def whole(size: tuple[int, int]) -> dict[str, int]:
    return {"x": 0, "y": 0, "width": size[0], "height": size[1]}


@pytest.mark.parametrize("codec", ["lossless", "jpeg"])
def test_texels_are_those_of_python(page: Page, field: Reconstruction, codec: Any) -> None:
    data = encode(field.light_field.mpis[0], codec=codec)
    answer = page.evaluate("file => core.decode(file, 1)", base64_of(data))
    atlas = np.frombuffer(base64.b64decode(answer["texels"]), np.uint8)
    rows = answer["height"] // 16
    tiles = atlas.reshape(rows, 16, -1, 16, 4).transpose(0, 2, 1, 3, 4).reshape(-1, 16, 16, 4)
    python = decode(data).texels
    away = np.abs(tiles[: len(python)].astype(int) - python)
    assert answer["num_tiles"] == len(python)
    assert not tiles[len(python) :].any()
    if codec == "lossless":
        assert away.max() == 0
        return
    assert away[..., 3].max() == 0
    assert away[..., :3].mean() <= COLOUR_MEAN
    assert (away[..., :3].max(axis=-1) > 24).mean() <= COLOUR_FAR


@pytest.mark.parametrize("factor", [1.0, 1.7, 2.0, 2.9, 5.3])
def test_the_live_picture_is_shrunk_as_python_does(page: Page, factor: float) -> None:
    photo = open_recording(ROOT / "scenes" / "desk").read(30)
    width, height = (round(side * factor) for side in SIZE)
    big = cv2.resize(photo.rgb, (width, height), interpolation=cv2.INTER_CUBIC)
    camera = photo.camera.resized(width, height)
    mpi = ViewBuilder(OPTIONS).generate(photo)
    scene = scene_of([mpi], camera, np.asarray(big, np.uint8), OPTIONS)
    answer = one_frame(page, scene, whole(SIZE), SIZE)
    assert (answer["width"], answer["height"]) == SIZE
    python = cv2.resize(big, SIZE, interpolation=cv2.INTER_AREA)
    away = np.abs(answer["live"][..., :3].astype(int) - python)
    assert away.mean() <= SHRUNK_MEAN
    assert away.max() <= SHRUNK_FAR


@pytest.mark.parametrize(("long_side_px", "size"), [(9999, (168, 366)), (275, (126, 275))])
def test_a_photo_is_upright_and_as_large_as_is_asked(
    page: Page, long_side_px: int, size: tuple[int, int]
) -> None:
    photo = open_recording(ROOT / "scenes" / "desk").read(30)
    big = np.asarray(cv2.resize(photo.rgb, (168, 366), interpolation=cv2.INTER_AREA), np.uint8)
    camera = photo.camera.resized(168, 366)
    opaque = np.full((366, 168, 1), 255, np.uint8)
    live = base64_of(np.concatenate([big, opaque], axis=-1)[::-1].tobytes())
    told = msgspec.to_builtins(wire_of_camera(camera))
    answer = page.evaluate("asked => core.photoOf(...asked)", [told, live, long_side_px])
    assert answer["error"] == 0
    small = camera.resized(*size).pinhole
    assert (answer["pinhole"]["width_px"], answer["pinhole"]["height_px"]) == size
    assert answer["pinhole"]["fx_px"] == pytest.approx(small.fx_px)
    assert answer["pinhole"]["cy_px"] == pytest.approx(small.cy_px)
    pixels = np.frombuffer(base64.b64decode(answer["pixels"]), np.uint8)
    shown = pixels.reshape(size[1], size[0], 4)[..., :3].astype(int)
    python = cv2.resize(big, size, interpolation=cv2.INTER_LINEAR)
    away = np.abs(shown - python)
    assert away.mean() <= (0 if size == (168, 366) else SHRUNK_MEAN), away.mean()


@pytest.mark.parametrize(
    ("forward_m", "turned_deg"),
    [(0.0, 0.0), (0.8, 0.0), (1.1, 50.0), (1.1, 120.0), (0.5, 180.0), (9.0, 0.0), (2.0, 90.0)],
)
def test_planes_are_drawn_from_before_them_only(
    page: Page, field: Reconstruction, forward_m: float, turned_deg: float
) -> None:
    mpi = field.light_field.mpis[0]
    c, s = np.cos(np.deg2rad(turned_deg)), np.sin(np.deg2rad(turned_deg))
    turn: Rigid[Any, Any] = Rigid(
        np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([0.02, 0.01, forward_m])
    )
    camera = Camera(mpi.camera.pinhole, mpi.camera.world_from_cam @ turn)
    scene = scene_of([mpi], camera, BLACK, OPTIONS)
    answer = one_frame(page, scene, whole(SIZE), SIZE)
    python = render(mpi, camera, backend="numpy").rgba
    away = np.abs(answer["view"] / 255.0 - python)
    assert away.mean() <= VIEW_MEAN
    assert (away.max(axis=-1) > 8 / 255).mean() <= VIEW_WRONG


def test_only_the_viewport_is_drawn_into(page: Page, field: Reconstruction) -> None:
    camera = field.light_field.mpis[0].camera
    scene = scene_of(field.light_field.mpis, camera, BLACK, OPTIONS)
    viewport = {"x": 20, "y": 30, "width": 51, "height": 111}
    display = one_frame(page, scene, viewport, (100, 200))["display"]
    inside = np.zeros((200, 100), bool)
    inside[200 - 30 - 111 : 200 - 30, 20 : 20 + 51] = True
    green = (display[..., :3] == [0, 255, 0]).all(axis=-1)
    assert green[~inside].all()
    assert not green[inside].any()


def test_what_did_not_change_is_not_computed_again(page: Page, field: Reconstruction) -> None:
    camera = field.light_field.mpis[0].camera
    dark, bright = (np.full((SIZE[1], SIZE[0], 3), v, np.uint8) for v in (0, 200))
    scene = scene_of(field.light_field.mpis, camera, dark, OPTIONS)
    other = scene_of([], camera, bright, OPTIONS)["live"]
    frames = page.evaluate("([scene, other]) => core.stillFrames(scene, other)", [scene, other])
    assert all(frame["same"] for frame in frames)
    passes = [frame["passes"] for frame in frames]
    # settle and display; with a new picture also shrink and compare, and mostly count
    assert passes[2] == passes[5] == 2
    assert passes[0] > passes[3] >= 4
    assert passes[6] in (3, 4)


def changes(shown: list[bool]) -> int:
    return sum(one != other for one, other in pairwise(shown))


@pytest.mark.parametrize("frame_ms", [8.0, 16.7, 33.3, 100.0, 250.0])
@pytest.mark.parametrize("half_period", [1, 2, 5])
def test_nothing_flashes(
    page: Page, field: Reconstruction, frame_ms: float, half_period: int
) -> None:
    seconds = 3.0
    frames = int(seconds * 1000 / frame_ms)
    wrong = [(i // half_period) % 2 == 0 for i in range(frames)]
    scene = scene_of(
        field.light_field.mpis,
        field.light_field.mpis[0].camera,
        BLACK,
        OPTIONS,
    )
    shown = page.evaluate("([s, w, ms]) => core.flicker(s, w, ms)", [scene, wrong, frame_ms])
    assert changes(shown) / 2 / seconds < FLASHES_PER_S


def test_what_stays_wrong_is_shown_soon_and_goes_soon(page: Page, field: Reconstruction) -> None:
    scene = scene_of(
        field.light_field.mpis,
        field.light_field.mpis[0].camera,
        BLACK,
        OPTIONS,
    )
    wrong = [False] * 10 + [True] * 30 + [False] * 30
    shown = page.evaluate("([s, w, ms]) => core.flicker(s, w, ms)", [scene, wrong, 33.3])
    assert changes(shown) == 2
    assert (shown.index(True) - 10) * 33.3 < SOON_MS
    assert (70 - shown[::-1].index(True) - 40) * 33.3 < SOON_MS


def test_a_shader_that_does_not_compile_says_where(page: Page) -> None:
    message = page.evaluate("core.brokenShader()")
    assert "nonsense" in message
    assert "  3   gl_Position = nonsense;" in message


def depth_on_the_card(kind: str, layers: int | None, turn: str) -> dict[str, Any]:
    """Return depth of 6 × 4 texels with what devices give in the place of unknown distances."""
    random = np.random.default_rng(3)
    mm = random.integers(1, 65536, (4, 6))
    mm[0, :4] = (0, 255, 256, 65535)
    data: np.ndarray = mm.astype("<u2")
    if kind == "float32":
        data = (mm / 1000).astype("<f4")
        data[1, :4] = (np.nan, np.inf, -1.0, 66.0)
    matrix = {  # columns of a 4 × 4 matrix: from the picture to the buffer
        "as it is": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
        "turned": [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1],
        "turned and cropped": [0, -0.6, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0.8, 0, 1],
        "beyond": [1.4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -0.2, 0, 0, 1],
    }[turn]
    return {
        "format": kind,
        "layers": layers,
        "width": 6,
        "height": 4,
        "data": base64_of(data.tobytes()),
        "raw_value_to_meters": 1.0 if kind == "float32" else 0.001,
        "matrix": matrix,
        "aspect": 4 / 6 if turn.startswith("turned") else 6 / 4,
    }


@pytest.mark.parametrize("turn", ["as it is", "turned", "turned and cropped", "beyond"])
@pytest.mark.parametrize("layers", [None, 2])
@pytest.mark.parametrize("kind", ["luminance-alpha", "unsigned-short", "float32"])
def test_depth_that_is_only_a_texture_is_read_as_depth_in_memory(
    page: Page, kind: str, layers: int | None, turn: str
) -> None:
    depth = depth_on_the_card(kind, layers, turn)
    answer = page.evaluate("depth => core.headsetDepth(depth)", depth)
    assert answer["gl_error"] == 0
    assert answer["asked"]["depthSensing"]["usagePreference"] == ["cpu-optimized", "gpu-optimized"]
    assert answer["read"] == answer["in_memory"]
    assert sum(mm > 0 for mm in answer["read"]["depth_mm"]) > 6
    if turn == "beyond":
        assert answer["read"]["depth_mm"][0] == 0
    if turn == "as it is" and kind != "float32":
        assert answer["read"]["depth_mm"][:4] == [0, 255, 256, 0]
