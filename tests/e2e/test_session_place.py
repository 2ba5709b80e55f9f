"""A session as a place: it grows while one captures, and is trained on from its page."""

from __future__ import annotations

import json
import urllib.request
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from capture_uploads import SESSION_ID, capture_id, new_session
from desk_uploads import DESK, upload_of_desk
from e2e.test_viewer import camera_of, canvas_of
from e2e.virtual_phone_page import PATIENCE_MS, VirtualPhonePage, keep_picture, moved
from live_server import LiveServer
from peaking.datasets import open_recording
from peaking.export.splats import read_splats
from peaking.splat.rasterise import render

STEPS = 60
TRAINS_SOON = ("demo", "--no-open", "--pixels", "5000", "--training-steps", str(STEPS))
VIEWS = 9

# Measured with SwiftShader, December 2026: mean 1.2/255. Spark packs Gaussians into 16 bytes,
# and sorts them by distance and not by depth.
SPLAT_MEAN = 3.0 / 255


def put(address: str, body: bytes, kind: str = "application/octet-stream") -> None:
    """Send something as a phone would."""
    request = urllib.request.Request(address, body, method="PUT", headers={"Content-Type": kind})
    with urllib.request.urlopen(request):
        pass  # it raises where the answer is a refusal


def fill(server: LiveServer, count: int = VIEWS) -> str:
    """Make a session of the desk; return its address in the API."""
    session = f"{server.address}/api/v1/sessions/{SESSION_ID}"
    put(session, json.dumps(new_session(name="Desk")).encode(), "application/json")
    for number in range(count):
        put(f"{session}/captures/{capture_id(number)}", upload_of_desk(4 * number))
    return session


def told(address: str) -> Any:
    with urllib.request.urlopen(address) as answer:
        return json.load(answer)


def opened(context: BrowserContext, address: str) -> Page:
    page = context.new_page()
    page.set_viewport_size({"width": 480, "height": 640})
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address, wait_until="commit")
    return page


def wait_for(page: Page, holds: str, argument: object = None) -> None:
    """Wait until an expression of the page is true (its CSP forbids playwright's own way)."""
    until = PATIENCE_MS
    while page.evaluate(holds, argument) is not True:
        until -= 200
        assert until > 0, f"it did not come to that: {holds}"
        page.wait_for_timeout(200)


def test_it_grows_while_one_captures(context: BrowserContext, server: LiveServer) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.hold(moved())
    phone.shoot_and_wait()
    sessions = told(f"{server.address}/api/v1/sessions")
    page = opened(context, f"{server.address}/view#{sessions[0]['id']}")
    expect(page.locator(".place-title")).to_contain_text("1 view", timeout=PATIENCE_MS)
    wait_for(page, "() => viewer.inspection.shown === 'place' && viewer.inspection.count() > 300")
    before = page.evaluate("viewer.inspection.count()")
    phone.hold(moved(0.3))
    phone.shoot_and_wait()
    expect(page.locator(".place-title")).to_contain_text("2 views", timeout=PATIENCE_MS)
    expect(page.get_by_role("button", name="Photo 2")).to_be_visible(timeout=PATIENCE_MS)
    wait_for(page, "before => viewer.inspection.count() > before + 300", before)
    assert phone.problems == []


@pytest.mark.parametrize("server", [TRAINS_SOON], indirect=True)
def test_a_splat_is_trained_and_turned(
    context: BrowserContext, server: LiveServer, tmp_path: Path
) -> None:
    session = fill(server)
    page = opened(context, f"{server.address}/view#{SESSION_ID}")
    page.get_by_role("button", name="Train a splat").click()
    # What comes first is shown by itself.
    wait_for(page, "() => viewer.inspection.shown === 'splat' && viewer.inspection.count() > 500")
    details = page.locator(".place-details")
    expect(details).to_contain_text("dB on 2 photos kept out", timeout=PATIENCE_MS)
    worst = details.get_by_role("button")
    expect(worst).to_have_count(3)
    training = told(f"{session}/training")
    worst.first.click()  # and it is looked from there
    wanted = open_recording(DESK).read(4 * int(training["worst"][0]["capture"][-12:])).camera
    wait_for(
        page,
        """wanted => { const { rows } = viewer.inspection.camera().worldFromCam;
          return Math.hypot(rows[3] - wanted[0], rows[7] - wanted[1], rows[11] - wanted[2]) < 1e-5
            && viewer.inspection.asleep; }""",
        wanted.position_m.tolist(),
    )
    assert training["state"] == "done"
    wait_for(page, "count => viewer.inspection.count() === count", training["gaussians"])
    keep_picture(page, "trained")
    # It looks as Python renders it.
    with urllib.request.urlopen(f"{session}/training/splat/{training['splat_version']}") as file:
        path = tmp_path / f"splat.{training['splat_format']}"
        path.write_bytes(file.read())
    wait_for(page, "() => viewer.inspection.asleep")
    camera = camera_of(page)
    picture = canvas_of(page)
    shown = picture[..., :3] * picture[..., 3:]
    expected = np.clip(render(read_splats(path), camera).rgb, 0, 1)
    assert np.abs(shown - expected).mean() < SPLAT_MEAN
    assert expected.mean() > 0.1  # there is something to compare
    # And it is turned.
    page.keyboard.down("ArrowLeft")
    wait_for(
        page,
        """forward => { const { rows } = viewer.inspection.camera().worldFromCam;
          return rows[2] * forward[0] + rows[6] * forward[1] + rows[10] * forward[2] < 0.999; }""",
        camera.forward.tolist(),
    )
    page.keyboard.up("ArrowLeft")


@pytest.mark.parametrize("server", [TRAINS_SOON], indirect=True)
def test_the_dashboard_opens_a_session_as_a_place(
    context: BrowserContext, server: LiveServer
) -> None:
    fill(server, 4)
    page = opened(context, f"{server.address}/sessions#{SESSION_ID}")
    page.set_viewport_size({"width": 1280, "height": 900})
    place = page.locator("section.place")
    expect(place.locator("canvas")).to_be_visible(timeout=PATIENCE_MS)
    expect(place).to_contain_text("4 views")
    place.get_by_role("tab", name="Light field").click(timeout=PATIENCE_MS)
    shown = place.get_by_role("application", name="The light field of Desk, from 4 views")
    expect(shown).to_be_visible(timeout=PATIENCE_MS)
    place.get_by_role("link", name="Full screen").click()
    page.wait_for_url("**/view#*")
    expect(page.get_by_role("link", name="Session")).to_be_visible(timeout=PATIENCE_MS)


def test_a_session_that_is_not_there_is_said(context: BrowserContext, server: LiveServer) -> None:
    page = opened(context, f"{server.address}/view#{SESSION_ID}")
    expect(page.get_by_role("alert")).to_contain_text("session", timeout=PATIENCE_MS)


def test_the_place_stands_beside_the_picture_where_there_is_room(
    context: BrowserContext, server: LiveServer
) -> None:
    page = context.new_page()
    page.set_viewport_size({"width": 1600, "height": 900})
    phone = VirtualPhonePage(page, server.address)
    beside = page.locator("#beside")
    expect(beside).to_be_visible()
    phone.hold(moved())
    phone.shoot()
    expect(beside).to_contain_text("1 view", timeout=PATIENCE_MS)
    expect(beside.locator("canvas")).to_be_visible(timeout=PATIENCE_MS)
    boxes = [page.locator(each).bounding_box() for each in (".about", ".phone", "#beside")]
    for box, after in pairwise(boxes):
        assert box is not None
        assert after is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= after["x"]
        assert after["x"] + after["width"] <= 1600
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(beside).to_be_hidden()
    assert phone.problems == []
