"""A guided capture in a real browser: scan, place the targets, walk to them, see them disappear."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext

from e2e.virtual_phone_page import VirtualPhonePage, moved
from live_server import DEMO, FULL_SIZE, LiveServer

ORANGE = (255, 168, 26)
"""COLOURS.right of web/src/guidance/marks.ts, of the next target, which is drawn opaque."""

GRID = "source=virtual&guide=plenoptic&area=0.12&depth=exact"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Generator[LiveServer, None, None]:
    server = LiveServer(tmp_path_factory.mktemp("guided") / "sessions", FULL_SIZE).start()
    yield server
    server.stop()


class GuidedPage(VirtualPhonePage):
    """The capture page with a guide."""

    def guide(self) -> dict[str, Any]:
        """Return what the page says of the guide; targets as [R | t] with 12 numbers each."""
        return self.page.evaluate(
            "(g => ({...g, targets: (g.guide?.targets ?? []).map(t => Array.from(t.rows))}))"
            "(window.peaking.guide())"
        )

    def scan(self) -> dict[str, Any]:
        """Look around until the nearest depth is known, and come back."""
        for x_m in (-0.1, -0.05, 0.0, 0.05, 0.1, 0.0):
            self.hold(moved(x_m=x_m))
            self.let_pass(6)
        self.wait_for(lambda: self.guide()["zMin_m"] is not None)
        return self.guide()

    def place(self) -> dict[str, Any]:
        """Place the targets around where the phone is."""
        self.wait_until_running()
        self.page.keyboard.press("Space")
        self.wait_for(lambda: self.guide()["phase"] == "capture")
        return self.guide()

    def axes_px(self) -> int:
        """Count the pixels of the picture that have the orange of the marks' first axis."""
        shot = cv2.imdecode(np.frombuffer(self.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
        assert shot is not None
        away = np.abs(shot[..., ::-1].astype(int) - ORANGE).max(axis=-1)
        return int((away < 6).sum())

    def poses_of(self, targets: list[list[float]]) -> list[list[float]]:
        """Return where to hold the phone for each target of a grid that was placed at `moved()`.

        The session's world has another origin than the room, and the same axes.
        """
        middle = np.mean(targets, axis=0)
        return [[*np.array(moved()) + np.array(target) - middle] for target in targets]


def test_targets_disappear_one_by_one(context: BrowserContext, server: LiveServer) -> None:
    phone = GuidedPage(context.new_page(), server.address, query=GRID)
    phone.keep_picture("guide-1-scan")
    scanned = phone.scan()
    phone.keep_picture("guide-2-scanned")
    assert 0.2 < scanned["zMin_m"] < 1.5
    assert phone.views() == []

    without_axes_px = phone.axes_px()
    placed = phone.place()
    targets = placed["targets"]
    focal_px = 294 / 2 / placed["bound"]["tanHalfFov"]
    assert placed["bound"]["spacing_m"] == pytest.approx(32 * scanned["zMin_m"] / focal_px)
    assert len(targets) == placed["bound"]["viewsPerSide"] ** 2 == 4
    phone.let_pass(6)
    phone.keep_picture("guide-3-targets")
    assert phone.axes_px() > without_axes_px
    for count, target in enumerate(phone.poses_of(targets), start=1):
        phone.hold(target)
        assert phone.guide()["reach"] == count - 1
        if count == 2:
            phone.keep_picture("guide-4-at-a-target")
        phone.shoot()
        phone.wait_for(lambda count=count: phone.guide()["taken"] == count)
    assert phone.guide()["phase"] == "done"
    phone.hold(moved())
    phone.keep_picture("guide-5-done")
    assert phone.axes_px() <= without_axes_px
    assert phone.problems == []


def test_the_automatic_shutter_takes_a_view_where_the_phone_is_held(
    browser: Browser, server: LiveServer
) -> None:
    context = browser.new_context(
        viewport={"width": 412, "height": 915}, has_touch=True, is_mobile=True
    )
    query = "source=virtual&guide=planes&area=0.12&depth=exact&shutter=auto"
    phone = GuidedPage(context.new_page(), server.address, query=query)
    phone.scan()
    placed = phone.place()
    phone.let_pass(6)
    phone.keep_picture("guide-planes")
    # The first plane of 2 × 2 is the anchor's.
    first_plane = placed["targets"][:4]
    for count, pose in enumerate(phone.poses_of(first_plane)[:2], start=1):
        phone.hold(pose)
        phone.wait_for(lambda count=count: phone.guide()["taken"] == count)
    assert len(phone.views()) == 2
    phone.page.reload(wait_until="commit")
    phone.wait_until_running()
    phone.wait_for(lambda: phone.guide()["taken"] == 2)
    assert phone.guide()["zMin_m"] == placed["zMin_m"]
    assert phone.problems == []
    context.close()


def test_a_view_that_is_undone_opens_its_target_again(
    context: BrowserContext, server: LiveServer
) -> None:
    query = "source=virtual&guide=hemisphere&step=15&extent=30&near=0.05&depth=exact"
    phone = GuidedPage(context.new_page(), server.address, query=query)
    phone.scan()
    placed = phone.place()
    assert len(placed["targets"]) == 1 + 7 + 12
    phone.let_pass(6)
    phone.keep_picture("guide-hemisphere")
    phone.hold(moved())
    assert phone.guide()["reach"] == 0
    phone.shoot()
    phone.wait_for(lambda: phone.guide()["taken"] == 1)
    phone.page.keyboard.press("z")
    phone.wait_for(lambda: phone.guide()["taken"] == 0)
    phone.page.get_by_role("button", name="Remove the targets and scan again").click()
    phone.wait_for(lambda: phone.guide()["phase"] == "scan")
    assert phone.problems == []


def test_a_recording_can_be_guided_too(browser: Browser, tmp_path: Path) -> None:
    desk = Path(__file__).parents[2] / "scenes" / "desk"
    server = LiveServer(tmp_path / "sessions", (*DEMO, str(desk))).start()
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        query = "source=replay&guide=plenoptic&near=0.03&angle=25"
        phone = GuidedPage(context.new_page(), server.address, query=query)
        for _ in range(12):
            phone.page.keyboard.press(".")
            phone.let_pass(8)
        phone.wait_for(lambda: phone.guide()["zMin_m"] is not None)
        placed = phone.place()
        phone.let_pass(6)
        phone.keep_picture("guide-replay")
        assert len(placed["targets"]) == placed["bound"]["viewsPerSide"] ** 2
        assert phone.problems == []
        context.close()
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("query", "says"),
    [("guide=grid", "Unknown guide"), ("guide=planes&area=-1", "area must be"),
     ("guide=planes&shutter=x", "Unknown shutter")],
)  # fmt: skip
def test_an_address_that_asks_for_no_guide_is_told_so(
    context: BrowserContext, server: LiveServer, query: str, says: str
) -> None:
    page = context.new_page()
    page.goto(f"{server.address}/?source=virtual&{query}")
    page.get_by_role("alert").filter(has_text=says).wait_for()
