"""The viewer of a place from a plain web server: what it shows, how it is steered, what it says."""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from e2e.virtual_phone_page import PATIENCE_MS
from patience import PATIENCE_S
from peaking.benchmarks.view_material import served
from peaking.datasets import open_recording
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.light_field import LightField
from peaking.options import DEFAULT
from peaking.server.recordings import wire_of_camera
from places import DESK, add_viewer, write_place

VIEWS = (0, 8, 12, 20, 34)
BETWEEN = 16
"""A frame that is not among the views."""

# Measured with SwiftShader, December 2026: mean 0.29/255, and no pixel off by more than 8/255.
PICTURE_MEAN = 0.6 / 255
PICTURE_LARGE = 8.0 / 255
PICTURE_WRONG = 0.0005

SIZES = {
    "small phone": (360, 640),
    "phone": (412, 915),
    "phone on its side": (844, 390),
    "laptop": (1366, 650),
    "full HD": (1920, 1080),
    "4K": (3840, 2160),
}
FINGER_PX = 44

FAULTS = """least => {
  const shown = Array.from(document.querySelectorAll(
    '.viewer button, .viewer a, .viewer .place-title, .viewer .place-line'))
    .filter((each) => each.checkVisibility({ visibilityProperty: true }))
    .map((each) => ({
      each, name: each.ariaLabel ?? (each.textContent.trim() || each.className),
      box: each.getBoundingClientRect(), strip: each.closest('.place-strip'),
    }))
    .filter(({ box }) => box.width > 0);
  const faults = [];
  for (const { each, name, box, strip } of shown) {
    if (each.matches('button, a') && !strip && (box.width < least || box.height < least)) {
      faults.push(`${name}: ${box.width} x ${box.height}`);
    }
    const sideways = strip ? 1e6 : 1; // the strip scrolls
    if (box.left < -sideways || box.right > innerWidth + sideways || box.top < -1
      || box.bottom > innerHeight + 1) faults.push(`${name} is cut off`);
    if (!each.matches('button, a') || strip) continue;
    const there = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    if (there === null || !each.contains(there)) faults.push(`${name} cannot be pressed`);
  }
  for (const a of shown) for (const b of shown) {
    if (a.each === b.each || a.each.contains(b.each) || b.each.contains(a.each)) continue;
    if (a.strip && b.strip) continue;
    const right = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
    const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
    if (right > 1 && down > 1) faults.push(`${a.name} lies over ${b.name}`);
  }
  return faults;
}"""


@dataclass(frozen=True)
class Desk:
    """A place that is served, and what its light field is."""

    address: str
    field: LightField
    folder: Path


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Generator[Desk, None, None]:
    folder = tmp_path_factory.mktemp("desk")
    field = write_place(folder, VIEWS)
    add_viewer(folder)
    with served(folder) as address:
        yield Desk(address, field, folder)


def opened(context: BrowserContext, address: str) -> Page:
    page = context.new_page()
    page.set_viewport_size({"width": 480, "height": 640})  # fewer pixels take less time
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{address}/index.html", wait_until="commit")
    return page


def light_field(page: Page) -> None:
    """Wait until the light field is drawn, and nothing is to come."""
    page.wait_for_function(
        "() => window.viewer?.inspection.shown === 'light-field'"
        " && viewer.inspection.lightField()?.settled && viewer.inspection.asleep",
        polling=200,
    )


def camera_of(page: Page) -> Camera:
    """Return the camera of the viewer, of the size of its canvas."""
    told = page.evaluate(
        "() => { const { pinhole, worldFromCam } = viewer.inspection.camera();"
        " return { ...pinhole, rows: Array.from(worldFromCam.rows) }; }"
    )
    rows = np.array(told.pop("rows")).reshape(3, 4)
    size = told.pop("width_px"), told.pop("height_px")
    pinhole = Pinhole(*size, **{name: float(value) for name, value in told.items()})
    return Camera(pinhole, Rigid(rows[:, :3].copy(), rows[:, 3].copy()))


def picture_of(page: Page) -> np.ndarray:
    """Return what the light field is rendered as: RGBA, premultiplied, 0…1."""
    told = page.evaluate(
        """() => {
          const { width, height, rgba } = viewer.inspection.lightField();
          let text = '';
          for (let i = 0; i < rgba.length; i += 32768) {
            text += String.fromCharCode(...rgba.subarray(i, i + 32768));
          }
          return { width, height, rgba: btoa(text) };
        }"""
    )
    data = np.frombuffer(base64.b64decode(told["rgba"]), np.uint8)
    return data.reshape(told["height"], told["width"], 4)[::-1] / 255.0


def test_it_shows_what_python_renders(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    light_field(page)
    wanted = open_recording(DESK).read(BETWEEN).camera
    wire: Any = msgspec.to_builtins(wire_of_camera(wanted))
    page.evaluate(
        """({ pinhole, world_from_cam }) => viewer.inspection.lookFrom(
          { pinhole, worldFromCam: { rows: Float64Array.from(world_from_cam) } })""",
        wire,
    )
    light_field(page)
    picture = picture_of(page)
    camera = camera_of(page)
    np.testing.assert_allclose(camera.position_m, wanted.position_m, atol=1e-9)
    np.testing.assert_allclose(camera.forward, wanted.forward, atol=1e-9)
    expected = desk.field.render(camera.resized(picture.shape[1], picture.shape[0]))
    difference = np.abs(picture - expected.rgba)
    assert difference.mean() < PICTURE_MEAN
    assert (difference.max(axis=-1) > PICTURE_LARGE).mean() < PICTURE_WRONG
    assert expected.alpha.mean() > 0.4  # there is something to compare


def test_it_sleeps_when_nothing_changes(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    light_field(page)
    before = page.evaluate("viewer.inspection.frames")
    page.wait_for_timeout(500)
    assert page.evaluate("viewer.inspection.frames") == before


def test_it_fetches_only_the_views_it_needs(context: BrowserContext, desk: Desk) -> None:
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    fetched: list[str] = []
    page.on("request", lambda request: fetched.append(request.url.rsplit("/", 1)[-1]))
    page.goto(f"{desk.address}/index.html", wait_until="commit")
    light_field(page)
    assert "0.mpi" in fetched
    assert "points.bin" not in fetched
    assert not any(name.startswith("space_layer") for name in fetched)


def test_keys_alone_steer_it(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    light_field(page)
    left = -camera_of(page).world_from_cam.rotation[:, 0]
    page.keyboard.down("ArrowLeft")
    page.wait_for_function(
        """left => { const { rows } = viewer.inspection.camera().worldFromCam;
          return [2, 6, 10].reduce((sum, at, i) => sum + rows[at] * left[i], 0) > 0.05; }""",
        arg=left.tolist(),
        polling=100,
    )
    page.keyboard.up("ArrowLeft")
    light_field(page)
    turned = camera_of(page)
    page.keyboard.down("KeyW")
    page.wait_for_function(
        """([position, forward]) => { const { rows } = viewer.inspection.camera().worldFromCam;
          return [3, 7, 11].reduce((sum, at, i) =>
            sum + (rows[at] - position[i]) * forward[i], 0) > 0.01; }""",
        arg=[turned.position_m.tolist(), turned.forward.tolist()],
        polling=100,
    )
    page.keyboard.up("KeyW")
    tab = page.get_by_role("tab", name="Overview")
    for _ in range(30):
        page.keyboard.press("Tab")
        if tab.evaluate("each => each === document.activeElement"):
            break
    page.keyboard.press("Enter")
    page.wait_for_function("() => viewer.inspection.shown === 'place'")


def test_the_border_of_what_was_captured_is_said(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    light_field(page)
    expect(page.get_by_role("status").filter(has_text="This is the edge")).to_have_count(0)
    page.keyboard.down("KeyS")
    expect(page.get_by_text("This is the edge of what was captured.")).to_be_visible(
        timeout=PATIENCE_MS
    )
    page.keyboard.up("KeyS")
    light_field(page)
    views = np.array([mpi.camera.position_m for mpi in desk.field.mpis])
    away_m = np.linalg.norm(views - camera_of(page).position_m, axis=1).min()
    extent_m = np.linalg.norm(np.ptp(views, axis=0))
    assert away_m < extent_m


def test_the_overview_leads_to_a_photo(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    page.get_by_role("tab", name="Overview").click()
    page.wait_for_function("() => viewer.inspection.count() > 1000")
    expect(page.locator(".place-title")).to_contain_text("5 views")
    expect(page.locator(".place-title")).to_contain_text("m high")
    page.get_by_role("button", name="Photo 3").click()
    wanted = open_recording(DESK).read(VIEWS[2]).camera.position_m.tolist()
    page.wait_for_function(
        """wanted => { const { rows } = viewer.inspection.camera().worldFromCam;
          return Math.hypot(rows[3] - wanted[0], rows[7] - wanted[1], rows[11] - wanted[2]) < 1e-6
            && viewer.inspection.asleep; }""",
        arg=wanted,
    )
    # The photo stands before the camera: what is seen is what was taken.
    photo = cv2.imread(str(desk.folder / "2.jpg"))
    assert photo is not None
    taken = shrunk(photo[..., ::-1] / 255.0)
    until = time.monotonic() + PATIENCE_S
    while (away := np.abs(shrunk(middle_of(canvas_of(page), photo.shape)) - taken).mean()) > 0.02:
        assert time.monotonic() < until, f"the photo is not what is seen: {away}"
        page.wait_for_timeout(200)


def middle_of(shown: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the part of a screen that a picture of this shape fills."""
    height, width = shown.shape[:2]
    scale = min(width / shape[1], height / shape[0])
    half_x, half_y = round(scale * shape[1] / 2), round(scale * shape[0] / 2)
    rows = slice(height // 2 - half_y, height // 2 + half_y)
    return shown[rows, width // 2 - half_x : width // 2 + half_x, :3]


def shrunk(rgb: np.ndarray) -> np.ndarray:
    """Return it so small that how it was scaled does not matter."""
    return cv2.resize(np.asarray(rgb, np.float32), (40, 60), interpolation=cv2.INTER_AREA)


def canvas_of(page: Page) -> np.ndarray:
    """Return the picture of the visible canvas: RGBA, 0…1."""
    url = page.evaluate("document.querySelector('.viewer canvas').toDataURL()")
    data = np.frombuffer(base64.b64decode(url.partition(",")[2]), np.uint8)
    picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture[..., [2, 1, 0, 3]] / 255.0


def test_controls_are_whole_and_in_reach(context: BrowserContext, desk: Desk) -> None:
    page = opened(context, desk.address)
    light_field(page)
    faults: dict[str, list[str]] = {}
    for tab in ("Light field", "Overview"):
        page.get_by_role("tab", name=tab).click()
        for name, (width, height) in SIZES.items():
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(300)
            found = page.evaluate(FAULTS, FINGER_PX)
            if found:
                faults[f"{tab}, {name}"] = found
    assert faults == {}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("no json", "place.json"),
        ("another version", "version 2"),
        ("no such file", "place.json is missing"),
        ("broken mpi", "not an .mpi file"),
    ],
)
def test_what_is_broken_is_said(
    context: BrowserContext, tmp_path: Path, change: str, said: str
) -> None:
    write_place(tmp_path, (0,))
    add_viewer(tmp_path)
    place = tmp_path / "place.json"
    if change == "no json":
        place.write_text("<html>")
    elif change == "another version":
        place.write_text(json.dumps(json.loads(place.read_text()) | {"version": 2}))
    elif change == "no such file":
        place.unlink()
    else:
        (tmp_path / "0.mpi").write_bytes(b"something else, and long enough")
    with served(tmp_path) as address:
        page = opened(context, address)
        expect(page.get_by_role("alert").filter(has_text=said)).to_be_visible()


def test_a_light_field_of_one_view_stands(context: BrowserContext, tmp_path: Path) -> None:
    write_place(tmp_path, (12,), DEFAULT, points=None)
    add_viewer(tmp_path)
    with served(tmp_path) as address:
        page = opened(context, address)
        light_field(page)
        assert page.evaluate("viewer.inspection.lightField().viewIds") == ["frame 12"]
