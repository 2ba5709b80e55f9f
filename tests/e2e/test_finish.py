"""Finish: what was got, the best of it as a data set, and no more views until one says so."""

from __future__ import annotations

import csv
import json
import re
import urllib.request
import zipfile
from pathlib import Path

import pycolmap
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize, expect

from e2e.virtual_phone_page import PATIENCE_MS, VirtualPhonePage, keep_picture, moved
from live_server import LiveServer
from peaking.datasets import open_recording

SIZES = {
    "small": ViewportSize(width=360, height=640),
    "large": ViewportSize(width=412, height=915),
}
PLACES_M = (0.0, 0.001, 0.002, 0.3, 0.301, -0.3)
"""Of views, aside: two places are taken again and again."""

FAULTS = """() => {
  const faults = [];
  const sheet = document.querySelector('.sheet');
  if (sheet.scrollWidth > sheet.clientWidth) faults.push('scrolls sideways');
  for (const each of sheet.querySelectorAll('button, input, select, p, svg')) {
    if (!each.checkVisibility()) continue;
    const { left, right, height } = each.getBoundingClientRect();
    const name = each.textContent || each.tagName;
    if (left < 0 || right > innerWidth) faults.push(`${name} is cut off`);
    if (each.matches('button, select') && height < 40) faults.push(`${name} is low: ${height}`);
  }
  return faults;
}"""


def sheet_says(page: Page, text: str | re.Pattern[str]) -> None:
    expect(page.locator(".sheet")).to_contain_text(text, timeout=PATIENCE_MS)


def open_finish(page: Page) -> None:
    page.get_by_role("button", name="Finish the session").click()


def shoot_all(phone: VirtualPhonePage) -> None:
    for x_m in PLACES_M:
        phone.hold(moved(x_m))
        phone.shoot_and_wait()


def downloaded(page: Page, button: str | re.Pattern[str], to: Path) -> Path:
    """Return the folder of a data set that is downloaded by pressing a button."""
    with page.expect_download(timeout=PATIENCE_MS) as download:
        page.get_by_role("button", name=button).click()
    with zipfile.ZipFile(download.value.path()) as archive:
        archive.extractall(to)
    return to


def test_the_best_are_downloaded_and_it_is_closed_until_one_says_so(
    browser: Browser, server: LiveServer, tmp_path: Path
) -> None:
    context = browser.new_context(viewport=SIZES["large"], accept_downloads=True)
    phone = VirtualPhonePage(context.new_page(), server.address)
    page = phone.page
    shoot_all(phone)
    open_finish(page)
    sheet_says(page, re.compile(r"6 views, .*The best \d show"))
    best = page.get_by_role("button", name=re.compile(r"Download the best \d"))
    count = int((best.inner_text()).split()[-1])
    assert 1 <= count < len(PLACES_M)

    recording = open_recording(downloaded(page, "Download the best", tmp_path / "best"))
    assert len(recording) == count
    assert all(recording.read(number).depth_m is not None for number in range(count))
    rows = list(csv.DictReader((tmp_path / "best" / "selection.csv").read_text().splitlines()))
    assert [len(rows), sum(row["kept"] == "1" for row in rows)] == [6, count]
    sheet_says(page, f"Your browser downloads the best {count}")
    all_of_them = open_recording(downloaded(page, "Download all 6", tmp_path / "all"))
    assert len(all_of_them) == 6
    page.get_by_label("Format").select_option("COLMAP")
    model = pycolmap.Reconstruction(downloaded(page, "Download all 6", tmp_path / "m") / "sparse/0")
    assert model.num_reg_images() == 6

    page.get_by_role("button", name="Close").click()
    page.get_by_text("This session is finished").wait_for()
    expect(page.get_by_role("button", name="Take a view")).to_be_disabled()
    page.keyboard.press("Space")
    phone.let_pass(10)
    assert len(phone.views()) == 6

    server.kill()
    server.start()
    session = next(iter(server.sessions.glob("*/.id"))).read_text()
    again = VirtualPhonePage(
        page, server.address, query=f"source=virtual&session={session}", running=False
    )
    page.get_by_text("This session is finished").wait_for()
    open_finish(page)
    expect(page.get_by_role("heading", name="Finished")).to_be_visible()
    page.get_by_role("button", name="Take more views").click()
    again.wait_until_running()
    again.hold(moved(0.15))
    again.shoot_and_wait()
    assert len(again.views()) == 7
    assert again.problems == []
    context.close()


def test_what_is_on_its_way_is_said_and_waited_for(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.hold(moved())
    phone.shoot_and_wait()
    server.kill()
    phone.hold(moved(0.3))
    phone.shoot()
    open_finish(phone.page)
    sheet_says(phone.page, "1 of 2 views still on the way to the server")
    phone.page.get_by_role("button", name="Download the 1 that have arrived").click()
    sheet_says(phone.page, "cannot be downloaded now: The server does not answer")
    server.start()
    sheet_says(phone.page, "2 views, none blurred, exposure even.")
    expect(phone.page.get_by_role("button", name="Download all 2")).to_be_enabled()
    expect(phone.page.get_by_role("heading", name="Finished")).to_be_visible()


def test_the_list_of_sessions_shows_it_and_goes_on_with_it(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.hold(moved())
    phone.shoot_and_wait()
    open_finish(phone.page)
    phone.page.get_by_role("button", name="Finish without downloading").click()
    sheet_says(phone.page, "Finished. Everything is kept on the server.")
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{server.address}/sessions", wait_until="commit")
    page.locator("#list > button", has_text="finished").click()
    page.get_by_role("button", name="Take more views").click()
    page.wait_for_url("**/?source=virtual&session=*")
    phone.page.bring_to_front()
    expect(phone.page.get_by_role("heading", name="Finish", exact=True)).to_be_visible(
        timeout=PATIENCE_MS
    )


def test_what_was_set_aside_can_be_brought_back(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.hold(moved())
    first = phone.shoot_and_wait()
    phone.hold(moved(0.3))
    phone.shoot_and_wait()
    session = next(iter(server.sessions.glob("*/.id"))).read_text()
    address = f"{server.address}/api/v1/sessions/{session}/captures/{first}"
    change = json.dumps({"ending": "set_aside"}).encode()
    with urllib.request.urlopen(urllib.request.Request(address, change, method="PATCH")):
        pass
    phone.wait_for(lambda: len(phone.views()) == 1)
    open_finish(phone.page)
    sheet_says(phone.page, "1 view, none blurred")
    expect(phone.page.get_by_text("Finishing deletes")).to_have_count(0)
    phone.page.get_by_role("button", name="Finish without downloading").click()
    phone.page.get_by_role("button", name="Close").click()
    phone.page.get_by_role("button", name="List of views").click()
    sheet_says(phone.page, "Set aside: others show the same")
    expect(phone.page.get_by_text("Undone, until you finish")).to_be_hidden()
    phone.page.get_by_role("button", name="Bring back view 1").click()
    phone.wait_for(lambda: phone.states() == ["ready", "ready"])
    assert phone.problems == []


@pytest.mark.parametrize("size", sorted(SIZES))
def test_the_sheet_has_room(browser: Browser, server: LiveServer, size: str) -> None:
    context = browser.new_context(viewport=SIZES[size], has_touch=True, is_mobile=True)
    phone = VirtualPhonePage(context.new_page(), server.address)
    shoot_all(phone)
    open_finish(phone.page)
    sheet_says(phone.page, "The best")
    keep_picture(phone.page, f"finish-{size}")
    assert phone.page.evaluate(FAULTS) == []
    phone.page.get_by_role("button", name="Finish without downloading").click()
    sheet_says(phone.page, "Everything is kept")
    keep_picture(phone.page, f"finished-{size}")
    assert phone.page.evaluate(FAULTS) == []
    context.close()
