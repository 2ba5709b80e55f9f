"""Where the next view helps, on the live page: a ghost to step into, the map, and what is left."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import BrowserContext

from e2e.test_sizes import FAULTS
from e2e.virtual_phone_page import START, VirtualPhonePage, moved
from live_server import LiveServer

ASIDE_M = 0.25
"""The second view is taken so far aside."""


def guidance(phone: VirtualPhonePage) -> dict[str, Any] | None:
    return phone.page.evaluate("window.peaking.guidance()")


def suggested(phone: VirtualPhonePage) -> dict[str, Any] | None:
    return phone.page.evaluate("window.peaking.suggested()")


def wait_for_views(phone: VirtualPhonePage, views: int) -> dict[str, Any]:
    """Wait until the guidance is about so many views."""
    phone.wait_for(lambda: (guidance(phone) or {"views": 0})["views"] == views)
    found = guidance(phone)
    assert found is not None
    return found


def go_to(phone: VirtualPhonePage, place: dict[str, Any]) -> None:
    """Hold the phone where a place is; the session's origin is not that of the room."""
    captures = phone.page.evaluate(
        """async () => {
          const [{ id }] = await (await fetch('/api/v1/sessions')).json();
          return (await (await fetch(`/api/v1/sessions/${id}`)).json()).captures;
        }"""
    )
    pose = list(place["camera"]["world_from_cam"])
    for axis in (3, 7, 11):
        pose[axis] += START[axis] - captures[0]["camera"]["world_from_cam"][axis]
    phone.hold(pose)


@pytest.fixture
def phone(context: BrowserContext, server: LiveServer) -> VirtualPhonePage:
    page = context.new_page()
    page.set_viewport_size({"width": 412, "height": 915})
    phone = VirtualPhonePage(page, server.address)
    page.get_by_role("button", name="Hide the introduction").click()
    phone.hold(moved())
    phone.shoot_and_wait()
    phone.hold(moved(ASIDE_M))
    phone.shoot_and_wait()
    return phone


def test_following_the_suggestion_leaves_less(phone: VirtualPhonePage) -> None:
    page = phone.page
    before = wait_for_views(phone, 2)
    place = suggested(phone)
    assert place is not None
    phone.let_pass(3)
    shown = page.locator(".ghost, .edge-arrow.next").filter(visible=True)
    assert shown.count() == 1
    assert place["reason"] in page.locator(".next-says").inner_text()
    phone.keep_picture("next-view-suggested")

    go_to(phone, place)
    phone.wait_for(lambda: page.locator(".ghost.reached").is_visible())
    phone.wait_for(lambda: "Take a view" in page.locator(".next-says").inner_text())
    phone.keep_picture("next-view-reached")
    phone.shoot_and_wait()
    after = wait_for_views(phone, 3)
    assert after["score"] > before["score"]
    assert suggested(phone) != place
    phone.keep_picture("next-view-after")
    assert phone.problems == []


def test_switched_off_it_stays_off(phone: VirtualPhonePage) -> None:
    page = phone.page
    wait_for_views(phone, 2)
    assert suggested(phone) is not None
    page.get_by_role("button", name="Suggest no more views").click()
    assert suggested(phone) is None
    page.reload(wait_until="commit")
    phone.wait_until_running()
    wait_for_views(phone, 2)
    phone.let_pass(4)
    assert suggested(phone) is None
    assert page.locator(".ghost, .edge-arrow.next, .next-says").filter(visible=True).count() == 0


def test_what_is_left_is_listed_and_leads_there(phone: VirtualPhonePage) -> None:
    page = phone.page
    found = wait_for_views(phone, 2)
    page.get_by_role("button", name="Suggest no more views").click()
    page.get_by_role("button", name="How complete the capture is").click()
    sheet = page.get_by_role("dialog", name="How complete the capture is")
    assert f"Done {int(100 * found['score'])}" in sheet.inner_text()
    places = sheet.get_by_role("button", name="Lead me there")
    assert places.count() == len(found["left"]) > 0
    phone.keep_picture("next-view-left")
    places.last.click()
    phone.let_pass(4)
    assert sheet.count() == 0
    assert suggested(phone) == found["left"][-1]
    phone.shoot_and_wait()
    phone.wait_for(lambda: suggested(phone) is None)


SIZES = {"phone": (412, 915), "small phone": (360, 640), "phone on its side": (844, 390)}


def test_nothing_covers_a_control(phone: VirtualPhonePage) -> None:
    page = phone.page
    wait_for_views(phone, 2)
    faults: dict[str, list[str]] = {}
    for name, (width, height) in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        phone.let_pass(4)
        faults[name] = page.evaluate(FAULTS.replace(".coach,", ".coach, #overlay .next-says,"))
        phone.keep_picture(f"next-view-{name}")
    assert not any(faults.values()), faults
