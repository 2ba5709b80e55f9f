"""A server that is not ready: the page says so, and asks for nothing that would have to wait."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import BrowserContext, Route

from e2e.virtual_phone_page import VirtualPhonePage
from live_server import PEAKING, LiveServer

HELD_BACK = f"""
import time
from pathlib import Path
from peaking.server.warm_up import KERNELS, WarmUp

def run(self, builder, run=WarmUp.run):
    self._compiled = KERNELS // 2
    while not Path({{go_on!r}}).exists():
        time.sleep(0.05)
    run(self, builder)

WarmUp.run = run
{PEAKING}
"""


def test_the_page_says_that_the_server_is_getting_ready(
    context: BrowserContext, tmp_path: Path
) -> None:
    go_on = tmp_path / "go on"
    program = HELD_BACK.format(go_on=str(go_on))
    server = LiveServer(tmp_path / "sessions", program=program).start()
    try:
        phone = VirtualPhonePage(context.new_page(), server.address, running=False)
        page = phone.page
        phone.until("() => window.peaking?.frames() > 20")
        notice = page.locator(".notice:not(.toast)")
        assert "getting ready" in notice.inner_text()
        assert 0.4 < page.locator(".notice progress").evaluate("bar => bar.value") < 0.6
        assert page.locator(".shutter").is_disabled()
        assert not page.locator(".coach").is_visible()
        phone.keep_picture("getting-ready")
        page.keyboard.press("Space")
        phone.let_pass(6)
        assert phone.views() == []

        go_on.touch()
        phone.wait_until_running()
        phone.let_pass(2)
        assert page.locator(".shutter").is_enabled()
        assert not notice.is_visible()
        assert "Take a first view" in page.locator(".coach").inner_text()
        phone.shoot_and_wait()
        assert "Take a first view" not in page.locator(".coach").inner_text()
        assert phone.problems == []
    finally:
        server.stop()


def test_the_page_says_that_it_is_loading(context: BrowserContext, server: LiveServer) -> None:
    page = context.new_page()
    held: list[Route] = []

    def hold_the_first(route: Route) -> None:
        if held:
            route.continue_()
        held.append(route)

    page.route("**/api/v1/server", hold_the_first)
    phone = VirtualPhonePage(page, server.address, running=False)
    phone.wait_for(lambda: len(held) == 1)
    loading = page.get_by_text("Loading …")
    assert loading.is_visible()
    phone.keep_picture("loading")
    held[0].continue_()
    phone.wait_until_running()
    assert not loading.is_visible()
    assert phone.problems == []
