"""The list of sessions: nothing empty in it, pictures of each, and room enough on a phone."""

from __future__ import annotations

import json
import re
import urllib.request
from uuid import UUID

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize, expect

from capture_uploads import HEIGHT, WIDTH, body_of, depth_mm, header, new_session
from e2e.virtual_phone_page import PATIENCE_MS, VirtualPhonePage, keep_picture
from live_server import LiveServer
from peaking.output import encode_jpeg

SIZES = {
    "phone": ViewportSize(width=390, height=844),
    "phone on its side": ViewportSize(width=844, height=390),
    "small phone": ViewportSize(width=320, height=568),
    "desktop": ViewportSize(width=1280, height=800),
    "4K": ViewportSize(width=3840, height=2160),
}
FINGER_PX = 44

FAULTS = """least => {
  const faults = [];
  if (document.documentElement.scrollWidth > innerWidth) faults.push('scrolls sideways');
  for (const each of document.querySelectorAll('header a, main a, main button, main select')) {
    if (!each.checkVisibility({ visibilityProperty: true })) continue;
    const name = each.textContent.trim() || each.className;
    const { left, right, width, height } = each.getBoundingClientRect();
    if (width < least || height < least) faults.push(`${name}: ${width} x ${height}`);
    if (left < 0 || right > innerWidth) faults.push(`${name} is cut off`);
    const cut = Array.from(each.children).some((child) =>
      child.getBoundingClientRect().right > right + 1);
    if (cut) faults.push(`${name} holds more than it has room for`);
  }
  return faults;
}"""


def put(address: str, body: bytes) -> None:
    """Send something as a phone would."""
    with urllib.request.urlopen(urllib.request.Request(address, body, method="PUT")):
        pass  # it raises where the answer is a refusal


def fill(server: LiveServer, count: int) -> None:
    """Make sessions of 1, 2 … 8, 1, 2 … views, and as many in which there is nothing."""
    for number in range(count):
        for empty in (False, True):
            session = f"{server.address}/api/v1/sessions/{UUID(int=2 * number + empty + 1)}"
            name = f"{'Kitchen' if number % 3 else 'VeryLongNameWithoutABreak' * 3} {number}"
            put(session, json.dumps(new_session(name="Nothing" if empty else name)).encode())
            for view in range(0 if empty else number % 8 + 1):
                hue = np.full((HEIGHT, WIDTH), (40 * number + 9 * view) % 180, np.uint8)
                shade = np.tile(np.linspace(90, 255, WIDTH).astype(np.uint8), (HEIGHT, 1))
                rgb = cv2.cvtColor(np.dstack([hue, hue // 2 + 90, shade]), cv2.COLOR_HSV2RGB)
                photo = encode_jpeg(np.asarray(rgb, np.uint8))
                fields = header(view, photo_bytes=len(photo))
                put(f"{session}/captures/{UUID(int=1000 + view)}",
                    body_of(fields, photo + depth_mm(view).tobytes()))  # fmt: skip


def opened(context: BrowserContext, server: LiveServer) -> Page:
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{server.address}/sessions", wait_until="commit")
    return page


@pytest.mark.parametrize("count", [0, 1, 12])
def test_it_is_of_use_at_every_size(browser: Browser, server: LiveServer, count: int) -> None:
    fill(server, count)
    faults: dict[str, list[str]] = {}
    for name, size in SIZES.items():
        touch = "phone" in name
        context = browser.new_context(viewport=size, has_touch=touch, is_mobile=touch)
        page = opened(context, server)
        problems: list[str] = []
        page.on("pageerror", lambda error, problems=problems: problems.append(str(error)))
        items = page.locator("#list > button")
        if count == 0:
            page.get_by_text("No sessions yet").wait_for()
        expect(items).to_have_count(count, timeout=PATIENCE_MS)
        assert "Nothing" not in page.locator("#list").inner_text()
        found = page.evaluate(FAULTS, FINGER_PX)
        if count:
            pictures = items.first.locator("img")
            assert items.nth(count - 1).locator("img").count() == 1  # the first that was begun
            assert pictures.count() == min((count - 1) % 8 + 1, 4)
            expect(pictures.first).to_have_js_property("complete", True, timeout=PATIENCE_MS)
            assert pictures.first.evaluate("picture => picture.naturalWidth") > 0
            keep_picture(page, f"list-{count}-{name.replace(' ', '-')}")
            items.nth(count // 2).click()
            whole = page.get_by_role("link", name="Download the data set")
            whole.wait_for()
            page.get_by_label("Format").select_option("COLMAP")
            expect(whole).to_have_attribute("href", re.compile(r"/dataset\.zip\?format=colmap$"))
            expect(page.locator("#detail h1")).to_be_in_viewport(timeout=PATIENCE_MS)
            found += page.evaluate(FAULTS, FINGER_PX)
            keep_picture(page, f"session-{count}-{name.replace(' ', '-')}")
            back = page.get_by_role("link", name="All sessions")
            if size["width"] <= 800:  # the session has the whole screen
                expect(items.first).to_be_hidden()
                back.click()
            expect(items.first).to_be_visible()
            expect(back).to_be_hidden()
        else:
            keep_picture(page, f"list-{count}-{name.replace(' ', '-')}")
        faults[name] = found
        assert problems == []
        context.close()
    assert faults == {name: [] for name in SIZES}


def test_a_page_that_is_only_opened_leaves_nothing_in_the_list(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.wait_for(lambda: any(server.sessions.glob("*/log.jsonl")))
    page = opened(context, server)
    page.get_by_text("No sessions yet").wait_for()
    phone.page.bring_to_front()
    phone.shoot_and_wait()
    expect(page.locator("#list > button")).to_have_count(1, timeout=PATIENCE_MS)
    phone.page.keyboard.press("z")
    page.get_by_text("1 view taken back").wait_for()  # it can be brought back, so it is listed


def test_what_somebody_is_about_to_press_stays(context: BrowserContext, server: LiveServer) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.shoot_and_wait()
    phone.page.close()
    page = opened(context, server)
    rename = page.get_by_role("button", name="Rename")
    rename.focus()
    page.evaluate("window.before = document.activeElement")
    session = next(iter(server.sessions.glob("*/log.jsonl"))).parent
    for number in range(3):  # what a phone tells each second changes the line of the list
        sample = {"time_s": number, "peaked_share": number / 4, "views": 1,
                  "world_from_cam": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}  # fmt: skip
        told = json.dumps({"samples": [sample]}).encode()
        session_id = (session / ".id").read_text()
        put(f"{server.address}/api/v1/sessions/{session_id}/peaked/{UUID(int=number)}", told)
        page.locator("#list > button", has_text=f"{[0.0, 25, 50][number]} %").wait_for()
    assert page.evaluate("document.activeElement === window.before")
