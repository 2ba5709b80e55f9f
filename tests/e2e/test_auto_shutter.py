"""The automatic shutter on the live page: it takes views where they are missing, or says why."""

from __future__ import annotations

import json

from playwright.sync_api import BrowserContext

from e2e.virtual_phone_page import VirtualPhonePage, moved
from live_server import LiveServer

FAR_M = 0.35
"""So far aside much is new."""


def says(phone: VirtualPhonePage) -> str:
    return phone.page.locator(".meter .auto-says").inner_text()


def is_calm(phone: VirtualPhonePage) -> bool:
    """Return whether the picture is shown rightly, all views taking part."""
    return says(phone) == "Auto: nothing new from here" and set(phone.states()) == {"ready"}


def automatic(server: LiveServer) -> list[bool]:
    """Return, of each capture that the server has, whether the automatic shutter took it."""
    log = next(iter(server.sessions.glob("*/log.jsonl")))
    events = [json.loads(line) for line in log.read_text().splitlines()]
    return [event["automatic"] for event in events if event["type"] == "CaptureStored"]


def test_it_takes_views_until_nothing_is_new(context: BrowserContext, server: LiveServer) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address)
    button = page.get_by_role("button", name="Automatic shutter")
    assert button.get_attribute("aria-pressed") == "false"
    button.click()
    phone.wait_for(lambda: says(phone) == "Auto: begins after your first view")
    phone.hold(moved())
    assert phone.views() == []
    phone.shoot_and_wait()
    phone.wait_for(lambda: is_calm(phone))
    before = len(phone.views())

    phone.hold(moved(FAR_M))
    phone.wait_for(lambda: len(phone.views()) > before)
    phone.wait_for(lambda: is_calm(phone))
    assert phone.peaked_share() < 0.02
    phone.keep_picture("auto-shutter")

    taken = len(phone.views())
    assert automatic(server) == [False] * before + [True] * (taken - before)
    button.click()
    phone.hold(moved(-FAR_M))
    phone.let_pass(60)
    assert phone.peaked_share() > 0.02
    assert len(phone.views()) == taken
    assert phone.problems == []


def test_it_takes_no_views_of_a_finished_session(
    context: BrowserContext, server: LiveServer
) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address, query="source=virtual&auto=on")
    phone.hold(moved())
    phone.shoot_and_wait()
    phone.wait_for(lambda: is_calm(phone))
    taken = len(phone.views())
    page.get_by_role("button", name="Finish the session").click()
    page.get_by_role("button", name="Finish without downloading").click()
    phone.hold(moved(FAR_M))
    phone.wait_for(lambda: says(phone) == "Auto: waits")
    phone.let_pass(60)
    assert len(phone.views()) == taken


def test_pictures_in_the_dark_are_said_and_not_taken(
    context: BrowserContext, server: LiveServer
) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address, query="source=virtual&auto=on")
    phone.hold(moved())
    phone.shoot_and_wait()
    phone.wait_for(lambda: is_calm(phone))
    taken = len(phone.views())
    notice = page.locator(".notice:not(.toast)")
    assert notice.is_hidden()

    page.evaluate("window.peaking.phone.setLight(0.04)")
    phone.hold(moved(FAR_M))
    phone.wait_for(lambda: says(phone) == "Auto: too dark")
    phone.wait_for(lambda: notice.is_visible() and notice.inner_text().startswith("Too dark"))
    phone.let_pass(30)
    assert len(phone.views()) == taken

    # Who presses gets the picture, and hears what is wrong with it.
    phone.shoot()
    take_back = page.get_by_role("button", name="Take it back")
    take_back.wait_for()
    phone.keep_picture("too-dark")
    take_back.click()
    phone.wait_for(lambda: len(phone.views()) == taken)
    assert page.locator(".toast").is_hidden()

    page.evaluate("window.peaking.phone.setLight(1)")
    phone.let_pass(2)
    phone.wait_for(lambda: len(phone.views()) > taken)
    phone.wait_for(lambda: notice.is_hidden())
    assert phone.problems == []
