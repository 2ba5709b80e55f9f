"""The pages beside the capture page, /check and /sessions, in a real browser."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize, expect

from e2e.virtual_phone_page import PATIENCE_MS, VirtualPhonePage, keep_picture, moved
from live_server import LiveServer
from peaking.datasets import open_recording

SIZES = {
    "wide": ViewportSize(width=1280, height=860),
    "phone": ViewportSize(width=412, height=915),
}
ANDROID = "Mozilla/5.0 (Linux; Android 15; Pixel 9) AppleWebKit/537.36 Chrome/147.0 Mobile"
IPHONE = "Mozilla/5.0 (iPhone; CPU iPhone OS 26_2 like Mac OS X) Version/26.2 Safari/604.1"


def opened(context: BrowserContext, address: str) -> Page:
    """Open a page; it fails the test when it raises."""
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address, wait_until="commit")
    return page


def finding(page: Page, title: str) -> tuple[str, str]:
    """Return the grade and the sentence of a finding of /check."""
    box = page.locator(".finding", has=page.get_by_text(title, exact=True))
    box.wait_for()
    (grade,) = re.findall("good|warn|bad", box.get_attribute("class") or "")
    return grade, box.locator("p").inner_text()


def choose_session(page: Page) -> None:
    """Open the first session of the list, as one does on a phone; elsewhere it is open already."""
    page.locator("#list > button", has_text="Virtual room").first.click()


def fits(page: Page) -> bool:
    """Nothing sticks out to the side."""
    return page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.parametrize("size", SIZES)
def test_check_says_what_this_browser_can(browser: Browser, server: LiveServer, size: str) -> None:
    context = browser.new_context(viewport=SIZES[size])
    page = opened(context, f"{server.address}/check")
    page.locator(".verdict").wait_for()
    keep_picture(page, f"check-{size}")
    assert "virtual phone" in page.locator(".verdict").inner_text()
    assert finding(page, "Secure page")[0] == "good"
    assert finding(page, "WebGL 2")[0] == "good"
    assert finding(page, "Server")[0] == "good"
    grade, sentence = finding(page, "Augmented reality (WebXR)")
    assert (grade, "virtual phone" in sentence) == ("bad", True)
    assert fits(page)
    page.get_by_role("link", name="Virtual phone").click()
    page.wait_for_url("**/?source=virtual", wait_until="commit")
    context.close()


@pytest.mark.parametrize(
    ("agent", "says"),
    [(ANDROID, "Google Play Services for AR"), (IPHONE, "cannot capture here")],
    ids=["android", "iphone"],
)
def test_check_says_what_to_do_about_what_is_missing(
    browser: Browser, server: LiveServer, agent: str, says: str
) -> None:
    context = browser.new_context(viewport=SIZES["phone"], user_agent=agent)
    page = context.new_page()
    page.add_init_script(
        "HTMLCanvasElement.prototype.getContext = () => null; delete window.OffscreenCanvas;"
        "IDBFactory.prototype.open = () => { throw new Error('private'); };"
    )
    page.goto(f"{server.address}/check", wait_until="commit")
    grade, sentence = finding(page, "Augmented reality (WebXR)")
    assert (grade, says in sentence) == ("bad", True)
    grade, sentence = finding(page, "WebGL 2")
    assert (grade, "hardware acceleration" in sentence) == ("bad", True)
    assert finding(page, "Background work")[0] == "bad"
    grade, sentence = finding(page, "Storage on this device")
    assert (grade, "private window" in sentence) == ("warn", True)
    assert page.locator(".verdict").inner_text().startswith("Not ready")
    keep_picture(page, "check-bad")
    assert fits(page)
    context.close()


def test_a_link_pairs_one_device_which_stays_paired_until_it_is_revoked(
    browser: Browser, tmp_path: Path
) -> None:
    server = LiveServer(tmp_path / "sessions", command=("serve", "--adb")).start()
    phone = browser.new_context(viewport=SIZES["phone"], user_agent=ANDROID)
    other = browser.new_context(viewport=SIZES["wide"])
    try:
        page = opened(phone, f"{server.address}/check")
        grade, sentence = finding(page, "Server")
        assert (grade, "Open the link that it printed" in sentence) == ("bad", True)
        code = code_in(server.said)
        page = opened(phone, f"{server.address}/check#code={code}")
        assert finding(page, "Server")[0] == "good"
        assert "code" not in page.evaluate("location.href")
        assert page.evaluate("document.cookie") == ""  # no script can read it

        page = opened(other, f"{server.address}/devices#code={code}")
        page.get_by_role("alert").get_by_text("was used before").wait_for()
        assert page.locator(".device").count() == 0

        server.kill()
        server.start()  # at the same port
        page = opened(phone, f"{server.address}/devices")
        line = page.locator(".device", has_text="Chrome on Pixel 9")
        line.wait_for()
        assert "This device" in line.inner_text()
        page.get_by_role("button", name="Add a phone").click()
        page.locator("#code img").wait_for()
        keep_picture(page, "devices-phone")
        assert fits(page)

        link = page.locator("#code .link").inner_text().replace("/#", "/devices#")
        desk = opened(other, link)
        desk.locator(".device", has_text="This device").wait_for()
        assert desk.locator(".device").count() == 2
        keep_picture(desk, "devices-wide")
        desk.on("dialog", lambda dialog: dialog.accept())
        desk.get_by_role("button", name="Revoke Chrome on Pixel 9").click()
        expect(desk.locator(".device")).to_have_count(1, timeout=PATIENCE_MS)
        page.get_by_role("alert").get_by_text("Pair this device first").wait_for()
        assert page.locator(".device").count() == 0
    finally:
        phone.close()
        other.close()
        server.stop()


def code_in(said: list[str]) -> str:
    """Return the code of the link that a server printed."""
    found = re.search(r"#code=(\S+)", "".join(said))
    assert found
    return found[1]


@pytest.mark.parametrize("size", SIZES)
def test_the_dashboard_follows_a_live_session(
    browser: Browser, server: LiveServer, tmp_path: Path, size: str
) -> None:
    context = browser.new_context(viewport=SIZES["wide"])
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.hold(moved())
    phone.shoot_and_wait()

    desk = browser.new_context(viewport=SIZES[size], accept_downloads=True)
    page = opened(desk, f"{server.address}/sessions")
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.locator("#list .live", has_text="Virtual room").wait_for()
    choose_session(page)
    page.get_by_text("1 view, 1 ready").wait_for()

    for step in range(1, 4):  # the page is open while the phone goes on
        phone.hold(moved(x_m=0.12 * step, z_m=-0.05 * step))
        if step != 2:
            phone.shoot_and_wait()
    phone.page.keyboard.press("z")
    page.get_by_text("2 views, 2 ready").wait_for()
    assert page.locator(".photos a.ready").count() == 2
    assert page.locator(".photos a").count() == 2
    phone.wait_for(
        lambda: page.locator(".photos img").evaluate_all(
            "images => images.every(i => i.complete && i.naturalWidth > 50)"
        )
    )
    views = page.locator("#above svg path title")
    phone.wait_for(lambda: views.count() == 2)
    phone.wait_for(lambda: page.locator("#above svg path[stroke-linecap]").count() > 2)
    curve = page.locator("#shares svg path[stroke-linejoin]").last  # of the whole
    phone.wait_for(lambda: (curve.get_attribute("d") or "").count("L") > 2)
    keep_picture(page, f"sessions-{size}")
    assert fits(page)

    with page.expect_download() as download:
        page.get_by_role("link", name="Download the data set").click()
    with zipfile.ZipFile(download.value.path()) as archive:
        archive.extractall(tmp_path / "downloaded")
    recording = open_recording(tmp_path / "downloaded")
    assert len(recording) == 2
    assert recording.read(1).depth_m is not None

    phone.page.close()
    if size == "phone":
        page.get_by_role("link", name="All sessions").click()
    page.locator("#list b:not(.live)", has_text="Virtual room").wait_for()
    assert problems == []
    desk.close()
    context.close()


@pytest.mark.parametrize("size", SIZES)
def test_what_was_taken_back_or_deleted_comes_back_and_what_was_erased_does_not(
    browser: Browser, server: LiveServer, size: str
) -> None:
    context = browser.new_context(viewport=SIZES[size])
    phone = VirtualPhonePage(context.new_page(), server.address)
    for step in range(2):
        phone.hold(moved(x_m=0.15 * step))
        phone.shoot_and_wait()
    phone.page.get_by_role("button", name="List of views").click()
    phone.page.get_by_role("button", name="Undo view 1").click()
    phone.page.get_by_role("button", name="Bring back view 1").wait_for()
    keep_picture(phone.page, f"undone-{size}")
    phone.page.get_by_role("button", name="Bring back view 1").click()
    phone.wait_for(lambda: len(phone.views()) == 2)
    phone.page.get_by_role("button", name="Undo view 2").click()
    phone.wait_for(lambda: len(phone.views()) == 1)
    phone.page.get_by_role("button", name="Close").click()
    phone.page.get_by_role("button", name="Finish the session").click()
    phone.page.get_by_text("Finishing deletes the view that you undid").wait_for()

    page = opened(context, f"{server.address}/sessions")
    page.on("dialog", lambda dialog: dialog.accept())
    choose_session(page)
    page.get_by_role("button", name="Bring back view 2").click()
    page.get_by_text("2 views, 2 ready").wait_for()
    phone.wait_for(lambda: len(phone.views()) == 2)
    page.get_by_role("button", name="Delete", exact=True).click()
    page.get_by_text("erased in 30 days").wait_for()
    keep_picture(page, f"deleted-{size}")
    assert fits(page)
    page.get_by_role("button", name="Restore").click()
    choose_session(page)
    page.get_by_text("2 views, 2 ready").wait_for()

    page.get_by_role("button", name="Delete", exact=True).click()
    page.get_by_role("button", name="Erase for good").click()
    page.get_by_text("No sessions yet").wait_for()
    phone.wait_for(lambda: phone.views() == [])
    assert list(server.sessions.rglob("*.jpg")) == []
    context.close()


def test_the_dashboard_without_sessions_says_how_to_begin(
    context: BrowserContext, server: LiveServer
) -> None:
    page = opened(context, f"{server.address}/sessions")
    page.get_by_text("No sessions yet").wait_for()
    keep_picture(page, "sessions-none")
    page.get_by_role("link", name="Virtual phone").click()
    page.wait_for_url("**/?source=virtual", wait_until="commit")
