"""The three marks on the page: shown, counted, explained when touched; phone and recording."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from e2e.virtual_phone_page import VirtualPhonePage, moved
from live_server import LiveServer
from peaking.output import encode_png
from recordings import Room, lateral_cameras, write_recording

TOO_BRIGHT = "Too bright for the camera: lower the exposure or leave it."
MOVEMENT = "Mirror, glass or movement: more photos will not help here."

GLARE = """() => {
  const upload = WebGL2RenderingContext.prototype.texImage2D;
  WebGL2RenderingContext.prototype.texImage2D = function (...args) {
    upload.apply(this, args);
    const { glare } = window;
    if (!glare || !(args.at(-1) instanceof HTMLCanvasElement)) return;
    const [x, y, width, height, brightness] = glare;
    this.pixelStorei(this.UNPACK_FLIP_Y_WEBGL, false);
    this.texSubImage2D(this.TEXTURE_2D, 0, x, y, width, height, this.RGBA, this.UNSIGNED_BYTE,
      new Uint8Array(4 * width * height).fill(brightness));
  };
}"""
"""Puts something bright before the virtual phone's camera: `window.glare` is a rectangle of its
picture, from the bottom left corner, and a brightness."""

PICTURE = (441, 958)
"""Of the virtual phone."""


def place_on_page(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return where on the page a place of the picture is, in shares from its top left corner."""
    found: list[float] = page.evaluate(
        """([x, y]) => {
          const canvas = document.getElementById('picture');
          const box = canvas.getBoundingClientRect();
          const fits = [box.width / canvas.width, box.height / canvas.height];
          const scale = getComputedStyle(canvas).objectFit === 'cover'
            ? Math.max(...fits) : Math.min(...fits);
          return [box.left + box.width / 2 + (x - 0.5) * canvas.width * scale,
            box.top + box.height / 2 + (y - 0.5) * canvas.height * scale];
        }""",
        [x, y],
    )
    return found[0], found[1]


def seen_around(page: Page, x: float, y: float, size_px: int = 30) -> np.ndarray:
    """Return RGB in 0…1 of what the page shows around a place of the picture."""
    left, top = (round(v - size_px / 2) for v in place_on_page(page, x, y))
    png = page.screenshot(clip={"x": left, "y": top, "width": size_px, "height": size_px})
    bgr = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert bgr is not None
    return bgr[..., ::-1] / 255.0


def is_amber(rgb: np.ndarray) -> np.ndarray:
    return (rgb[..., 0] > 0.8) & (np.abs(rgb[..., 1] - 0.66) < 0.16) & (rgb[..., 2] < 0.4)


def is_red(rgb: np.ndarray) -> np.ndarray:
    return (rgb[..., 0] > 0.6) & (rgb[..., 1:] < 0.36).all(axis=-1)


def share_of(phone: VirtualPhonePage, name: str) -> float:
    return phone.page.evaluate("name => window.peaking.seen()[name]", name)


def toast_after(
    phone: VirtualPhonePage, touch: Callable[[float, float], None], x: float, y: float
) -> str:
    """Touch a place of the picture; return what is answered."""
    page = phone.page
    # It hears of the touch after those who answer it.
    page.evaluate("window.heard = false; addEventListener('click', () => { window.heard = true; })")
    touch(*place_on_page(page, x, y))
    phone.until("() => window.heard")
    toast = page.locator(".toast")
    return toast.inner_text() if toast.is_visible() else ""


def test_a_phone_shows_counts_and_explains(browser: Browser, server: LiveServer) -> None:
    context = browser.new_context(
        viewport={"width": 412, "height": 915}, has_touch=True, is_mobile=True
    )
    page = context.new_page()
    page.add_init_script(f"({GLARE})()")
    phone = VirtualPhonePage(page, server.address)
    page.evaluate("window.glare = [60, 620, 320, 260, 224]")
    phone.hold(moved(x_m=0.001))
    phone.shoot_and_wait()
    page.get_by_role("button", name="Hide the introduction").click()
    page.evaluate("window.glare = [80, 700, 160, 120, 255]")
    phone.hold(moved(x_m=0.25))
    phone.let_pass(10)
    touch = page.touchscreen.tap
    middle = (160 / PICTURE[0], 1 - 760 / PICTURE[1])
    seen = page.evaluate("window.peaking.seen()")
    assert 0.03 < seen["unfixableShare"] < 0.06
    assert seen["unseenShare"] > 0.1
    assert seen["wrongShare"] > 0.03  # where the bright thing was before
    apart = seen["wrongShare"] + seen["unseenShare"]
    assert seen["peakedShare"] == pytest.approx(apart, abs=1e-9)
    assert is_amber(seen_around(page, *middle)).mean() > 0.05
    phone.keep_picture("marks-phone")

    views = len(phone.views())
    assert toast_after(phone, touch, *middle) == TOO_BRIGHT
    phone.keep_picture("marks-touched")
    page.locator(".toast").wait_for(state="hidden")
    assert toast_after(phone, touch, 0.3, 0.6) == ""  # shown rightly
    assert toast_after(phone, touch, 0.95, 0.4) == ""  # never seen
    assert len(phone.views()) == views

    page.get_by_role("button", name="Settings").click()
    page.get_by_label("Patterns for every mark").check()
    page.get_by_role("button", name="Close").click()
    phone.let_pass(6)
    phone.keep_picture("marks-patterns")

    # Of a preview that is cropped above and below, only what one sees is counted.
    page.evaluate("window.glare = [80, 800, 160, 80, 255]")
    phone.hold(moved(x_m=0.25, y_m=0.001))
    phone.let_pass(6)
    assert share_of(phone, "unfixableShare") > 0.01
    page.set_viewport_size({"width": 412, "height": 560})
    phone.let_pass(6)
    assert share_of(phone, "unfixableShare") == 0
    phone.keep_picture("marks-cropped")

    phone.wait_for(lambda: any(server.sessions.glob("*/peaked.jsonl")))
    (told,) = server.sessions.glob("*/peaked.jsonl")
    sample = json.loads(told.read_text().splitlines()[-1])
    assert {"peaked_share", "wrong_share", "unseen_share", "unfixable_share"} <= sample.keys()
    assert phone.problems == []
    context.close()


CAMERAS = lateral_cameras(13, 150, 320)
MOVED = Room(box_m=((-0.25, -0.9, 1.0), (0.25, -0.5, 1.3)))
"""The thing before the wall, higher up: views saw the wall where it is now."""


def write_changes(folder: Path) -> Path:
    """A recording: a view; the same, dazzled and with a thing recoloured; one from aside; moved."""
    write_recording(folder, cameras=[CAMERAS[6], CAMERAS[6], CAMERAS[12], CAMERAS[8]])
    for index, brightness in ((0, 224), (1, 255)):
        path = folder / "images" / f"frame_{index:05d}.png"
        picture = cv2.imread(str(path))
        assert picture is not None
        rgb = np.ascontiguousarray(picture[..., ::-1])
        rgb[60:110, 40:100] = brightness
        if index == 1:
            rgb[140:180, 50:100] = 255 - rgb[140:180, 50:100]
        path.write_bytes(encode_png(rgb))
    rgb, depth_m = MOVED.photographed(CAMERAS[8])
    (folder / "images" / "frame_00003.png").write_bytes(encode_png(rgb))
    depth_mm = np.round(1000 * depth_m).astype(np.uint16)
    (folder / "depths" / "frame_00003.png").write_bytes(encode_png(depth_mm))
    return folder


@pytest.fixture(scope="module")
def changes(tmp_path_factory: pytest.TempPathFactory) -> Generator[str, None, None]:
    """The address of a server with that recording."""
    folder = tmp_path_factory.mktemp("changes")
    recording = str(write_changes(folder / "recording"))
    command = ("demo", recording, "--no-open", "--pixels", "30000")
    server = LiveServer(folder / "sessions", command=command).start()
    yield server.address
    server.stop()


def test_a_recording_shows_all_three(context: BrowserContext, changes: str) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, changes, query="source=replay")
    phone.shoot_and_wait()
    page.get_by_role("button", name="Hide the introduction").click()
    page.keyboard.press(".")
    phone.let_pass(12)
    bright, wrong = (70 / 150, 85 / 320), (75 / 150, 160 / 320)
    amber = seen_around(page, *bright)
    assert is_amber(amber).mean() > 0.05
    assert not is_red(amber).any()
    assert is_red(seen_around(page, *wrong)).mean() > 0.8
    phone.keep_picture("marks-recording")
    assert toast_after(phone, page.mouse.click, *bright) == TOO_BRIGHT
    page.locator(".toast").wait_for(state="hidden")
    assert toast_after(phone, page.mouse.click, *wrong) == ""
    numbers = page.locator(".meter .shares").inner_text()
    assert "wrong" in numbers
    assert "new" in numbers

    page.keyboard.press(".")
    phone.let_pass(12)
    assert share_of(phone, "unseenShare") > 0.03
    phone.keep_picture("marks-recording-aside")
    assert phone.problems == []


def test_what_has_moved_is_told(context: BrowserContext, changes: str) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, changes, query="source=replay")
    phone.shoot_and_wait()
    page.get_by_role("button", name="Hide the introduction").click()
    for _ in range(2):
        page.keyboard.press(".")
    phone.let_pass(12)
    phone.shoot_and_wait()
    assert share_of(phone, "unfixableShare") < 0.002
    page.keyboard.press(".")
    phone.let_pass(12)
    pixel, _ = CAMERAS[8].project(np.array([0.0, -0.7, 1.0]))  # the middle of its front
    now = (float(pixel[0]) / 150, float(pixel[1]) / 320)
    amber = seen_around(page, *now)
    assert is_amber(amber).mean() > 0.05
    assert not is_red(amber).any()
    assert share_of(phone, "unfixableShare") > 0.05
    assert toast_after(phone, page.mouse.click, *now) == MOVEMENT
    phone.keep_picture("marks-moved")
    assert phone.problems == []
