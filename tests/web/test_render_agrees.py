"""The client renders, compares and chooses as Python does; in a real browser, with real shaders."""

from __future__ import annotations

import base64
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from playwright.sync_api import Page

from peaking.datasets import open_recording
from peaking.error_map import compare
from peaking.geometry import Camera, Rigid
from peaking.light_field import LightField
from peaking.mpi_file import encode
from peaking.options import PRESETS, Options
from peaking.pipeline import Reconstruction
from peaking.rendering import Rendering, render
from peaking.rendering.blending import blend
from peaking.server.recordings import wire_of_camera
from peaking.view_weights import Neighbour, nearest_by_distance, nearest_by_overlap
from web.conftest import opened_page

ROOT = Path(__file__).parents[2]
SIZE = (102, 222)
PIXELS = SIZE[0] * SIZE[1]

# Measured with SwiftShader, November 2026: mean 0.28/255, no pixel off by more than 8/255;
# of the mask's pixels 0.06 % differ (paper) and 0.01 % (default).
VIEW_MEAN = 0.5 / 255
"""Mean difference of the view's RGBA; 8-bit targets round at every layer."""
VIEW_LARGE = 8.0 / 255
"""A larger difference than this counts as a wrong pixel."""
VIEW_WRONG = 0.0005
"""Share of the wrong pixels."""
PEAKED_WRONG = 0.002
"""Share of pixels on which the two do not agree whether they are peaked."""

DEPTH_MEAN = 0.001
"""Mean difference of depths, as a share of them; they are added up in half floats."""
DEPTH_WRONG = 0.005
"""Share of the depths that are off by more than 1 %: at edges, alpha is rounded to 8 bits."""


@pytest.fixture(scope="module")
def page(pages: str) -> Generator[Page, None, None]:
    with opened_page(pages, "agreement", "renderFixture") as page:
        yield page


@pytest.fixture(scope="module")
def scene() -> tuple[Reconstruction, Any]:
    """Three views of the desk, and a frame between them."""
    recording = open_recording(ROOT / "scenes" / "desk")
    field = Reconstruction(replace(PRESETS["default"], pixels=PIXELS))
    for index in (0, 8, 20):
        field.add_view(recording.read(index))
    return field, field.prepare(recording.read(12))


def wire(camera: Camera) -> dict[str, Any]:
    return msgspec.to_builtins(wire_of_camera(camera))


def base64_of(data: bytes) -> str:
    return base64.b64encode(data).decode()


def in_the_browser(
    page: Page, field: Reconstruction, live: Any, options: Options, overlay: str
) -> dict[str, Any]:
    alpha = np.full((*live.rgb.shape[:2], 1), 255, np.uint8)
    rgba = np.concatenate([live.rgb, alpha], axis=-1)[::-1]
    wanted = [
        "pixels",
        "num_planes",
        "neighbours",
        "blend_weights",
        "opacity",
        "filling_views",
        "error_threshold",
        "shift_px",
        "compensate_exposure",
        "marks",
    ]
    answer = page.evaluate(
        "fixture => renderFixture(fixture)",
        {
            "mpis": [
                {"camera": wire(mpi.camera), "file": base64_of(encode(mpi, codec="lossless"))}
                for mpi in field.light_field.mpis
            ],
            "camera": wire(live.camera),
            "live": base64_of(np.ascontiguousarray(rgba).tobytes()),
            "options": {name: getattr(options, name) for name in wanted},
            "look": {
                "overlay": overlay,
                "threshold": options.error_threshold,
                "peakOpacity": 1,
                "pattern": False,
            },
        },
    )
    height, width = live.rgb.shape[:2]
    for name in ("view", "result", "display"):
        pixels = np.frombuffer(base64.b64decode(answer[name]), np.uint8)
        answer[name] = pixels.reshape(height, width, 4)[::-1] / 255.0
    return answer


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_view_and_peaks_agree(page: Page, scene: tuple[Reconstruction, Any], preset: Any) -> None:
    field, live = scene
    options = replace(PRESETS[preset], pixels=PIXELS)
    answer = in_the_browser(page, field, live, options, "peaks")
    cameras = [mpi.camera for mpi in field.light_field.mpis]
    if options.blend_weights == "paper":
        near = nearest_by_distance(cameras, live.camera, count=options.neighbours)
    else:
        closest = nearest_by_distance(cameras, live.camera, count=1)[0].index
        depth_m = float(np.median(field.light_field.mpis[closest].plane_depths_m))
        near = nearest_by_overlap(cameras, live.camera, depth_m, count=options.neighbours)
    renderings = [
        render(field.light_field.mpis[n.index], live.camera, backend="numpy") for n in near
    ]
    view = blend(
        np.stack([r.rgba for r in renderings]),
        np.stack([r.depth_m for r in renderings]),
        [n.weight for n in near],
        opacity=options.opacity,
        backend="numpy",
    )
    errors = compare(
        view,
        live.rgb,
        threshold=options.error_threshold,
        shift_px=options.shift_px,
        compensate_exposure=options.compensate_exposure,
        marks=options.marks,
        backend="numpy",
    )

    assert answer["gl_error"] == 0
    assert answer["viewIds"] == [str(n.index) for n in near]
    difference = np.abs(answer["view"] - view.rgba)
    assert difference.mean() < VIEW_MEAN
    assert (difference.max(axis=-1) > VIEW_LARGE).mean() < VIEW_WRONG
    peaked = answer["result"][..., 0] > 0.5
    assert (peaked != errors.peaked).mean() < PEAKED_WRONG
    assert 0.005 < errors.peaked_share < 0.9  # there is something to agree on
    assert answer["peakedShare"] == pytest.approx(peaked.mean(), abs=1e-9)
    assert answer["unseenShare"] == pytest.approx(errors.unseen_share, abs=0.01)
    assert_small_pictures_agree(answer, view, live.rgb)
    shown = answer["display"][..., :3]
    if options.marks == "paper":
        red = (shown == [1, 0, 0]).all(axis=-1)
        assert red[peaked].mean() > 0.8  # red ends softly, half a pixel around
    else:
        # Two thirds of what is there are red; a light contour runs along the border.
        inside = eroded(peaked & ~errors.unseen)
        red = (shown[..., 0] > 0.66) & (shown[..., 1:] < 0.34).all(axis=-1)
        assert inside.sum() > 50
        assert red[inside].mean() > 0.8
    assert red[~peaked].mean() < 0.02


def eroded(mask: np.ndarray) -> np.ndarray:
    """Return the pixels whose neighbours are all in the mask."""
    around = [np.roll(mask, (dy, dx), (0, 1)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return np.logical_and.reduce(around)


def test_holes_are_filled_alike(page: Page, scene: tuple[Reconstruction, Any]) -> None:
    """One view is blended; what it leaves empty, the other two have seen."""
    field, _ = scene
    recording = open_recording(ROOT / "scenes" / "desk")
    live = field.prepare(recording.read(34))
    options = replace(PRESETS["default"], pixels=PIXELS, neighbours=1, align_poses=False)
    mpis = field.light_field.mpis
    unfilled = LightField(mpis, replace(options, filling_views=0)).render(live.camera)
    filled = LightField(mpis, options).render(live.camera)
    assert (filled.alpha - unfilled.alpha).mean() > 0.005
    answer = in_the_browser(page, field, live, options, "mpi")
    difference = np.abs(answer["view"] - filled.rgba)
    assert difference.mean() < VIEW_MEAN
    assert (difference.max(axis=-1) > VIEW_LARGE).mean() < VIEW_WRONG


def assert_small_pictures_agree(answer: dict[str, Any], view: Rendering, live: np.ndarray) -> None:
    """What the alignment gets, here at the size of the view: colours, depth, live picture."""
    width, height = answer["align_size"]
    assert (height, width) == live.shape[:2]
    packed = np.frombuffer(base64.b64decode(answer["align"]), np.uint8)
    colours, depth, picture = packed.reshape(3, height, width, 4)[:, ::-1].astype(np.float64)
    assert np.abs(colours / 255 - view.rgba).mean() < VIEW_MEAN
    np.testing.assert_allclose(picture[..., :3], live, atol=1)
    depth_m = (depth[..., 0] + 256 * depth[..., 1] + 65536 * depth[..., 2]) / 10_000
    opaque = view.alpha >= 0.95
    away = np.abs(depth_m / np.where(opaque, view.depth_m, 1.0) - 1)[opaque]
    assert away.mean() < DEPTH_MEAN
    assert (away > 0.01).mean() < DEPTH_WRONG


def test_the_three_overlays_show_what_they_should(
    page: Page, scene: tuple[Reconstruction, Any]
) -> None:
    field, live = scene
    options = replace(PRESETS["default"], pixels=PIXELS)
    mpi = in_the_browser(page, field, live, options, "mpi")
    np.testing.assert_allclose(mpi["display"][..., :3], mpi["view"][..., :3], atol=1.5 / 255)
    video = in_the_browser(page, field, live, options, "video")
    calm = video["result"][..., 0] < 0.5
    far_from_red = np.ones_like(calm)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            far_from_red &= np.roll(calm, (dy, dx), (0, 1))
    shown = video["display"][..., :3][far_from_red]
    np.testing.assert_allclose(shown, (live.rgb / 255.0)[far_from_red], atol=1.5 / 255)


def test_neighbours_agree(page: Page, scene: tuple[Reconstruction, Any]) -> None:
    random = np.random.default_rng(5)
    _, live = scene

    def somewhere() -> Camera:
        axis, angle = random.normal(size=3), random.uniform(0, 1.5)
        x, y, z = axis / np.linalg.norm(axis)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        return Camera(live.camera.pinhole, Rigid(rotation, random.uniform(-1, 1, 3)))

    for count in (1, 3, 4):
        cameras, target = [somewhere() for _ in range(90)], somewhere()
        for depth_m in (None, 1.3):
            ours: tuple[Neighbour, ...] = (
                nearest_by_distance(cameras, target, count=count)
                if depth_m is None
                else nearest_by_overlap(cameras, target, depth_m, count=count)
            )
            theirs = page.evaluate(
                "([cameras, target, depth, count]) => nearest(cameras, target, depth, count)",
                [[wire(c) for c in cameras], wire(target), depth_m, count],
            )
            assert [n["index"] for n in theirs] == [n.index for n in ours]
            for one, other in zip(theirs, ours, strict=True):
                assert one["weight"] == pytest.approx(other.weight, rel=1e-9)
