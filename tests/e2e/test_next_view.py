"""Where the next view helps, on the live page: a ghost to step into, the map, and what is left."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import BrowserContext

from e2e.virtual_phone_page import VirtualPhonePage, moved
from live_server import LiveServer

ASIDE_M = 0.25
"""The second view is taken so far aside."""

PORTRAIT = {"width": 412, "height": 915}


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


def left(found: dict[str, Any]) -> float:
    return sum(place["share"] for place in found["left"])


@pytest.fixture
def phone(context: BrowserContext, server: LiveServer) -> VirtualPhonePage:
    page = context.new_page()
    page.set_viewport_size(PORTRAIT)
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

    phone.hold(place["camera"]["world_from_cam"])
    assert page.locator(".ghost.reached").is_visible()
    phone.wait_for(lambda: "Take a view" in page.locator(".next-says").inner_text())
    phone.keep_picture("next-view-reached")
    phone.shoot_and_wait()
    after = wait_for_views(phone, 3)
    assert after["score"] > before["score"]
    assert suggested(phone) != place
    phone.keep_picture("next-view-after")
    assert phone.problems == []
