"""The whole loop in a real browser: the virtual phone, the real server, and what comes between."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Route

from adampi_checkpoints import write_checkpoint
from e2e.virtual_phone_page import VirtualPhonePage, moved
from full_disks import any_full_disk
from live_server import DEMO, FULL_SIZE, LiveServer
from peaking.datasets import open_recording


def only_session(sessions: Path) -> Path:
    (log,) = sessions.glob("*/log.jsonl")
    return log.parent


def stored_ids(sessions: Path) -> list[str]:
    """Return the ids of all captures that the session's log has, in order, repetitions too."""
    lines = (only_session(sessions) / "log.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in lines]
    return [event["id"] for event in events if event["type"] == "CaptureStored"]


@pytest.mark.parametrize("server", [FULL_SIZE], indirect=True)
def test_the_red_goes_when_a_view_is_taken_and_comes_back_when_it_is_undone(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.keep_picture("1-start")
    phone.hold(moved())
    phone.shoot_and_wait()
    phone.keep_picture("2-first-view")
    at_home = phone.peaked_share()
    phone.page.evaluate("document.querySelector('.thumb').dataset.kept = 'yes'")

    phone.hold(moved(x_m=0.35))
    before = phone.peaked_share()
    phone.keep_picture("3-moved")
    assert before > at_home

    phone.shoot_and_wait()
    after = phone.peaked_share()
    phone.keep_picture("4-second-view")
    assert after < before
    # Of a long session the strip is long: what is there is not made again.
    assert phone.page.locator(".thumb").count() == 2
    assert phone.page.locator(".thumb").first.get_attribute("data-kept") == "yes"

    phone.page.keyboard.press("z")
    phone.wait_for(lambda: len(phone.views()) == 1)
    phone.let_pass(6)
    undone = phone.peaked_share()
    phone.keep_picture("5-undone")
    assert undone > after

    session = only_session(server.sessions)
    phone.wait_for(lambda: len(open_recording(session)) == 1)
    recording = open_recording(session)
    assert recording.read(0).depth_m is not None
    assert phone.problems == []


def test_the_list_of_views_says_who_made_them(context: BrowserContext, tmp_path: Path) -> None:
    checkpoint = write_checkpoint(tmp_path / "adampi_4p.pth")
    learned = ("--generator", "adampi", "--checkpoint", str(checkpoint), "--num-planes", "4")
    small = ("--pixels", str(130 * 278), "--device", "cpu")
    server = LiveServer(tmp_path / "sessions", command=("demo", "--no-open", *learned, *small))
    server.start()
    try:
        phone = VirtualPhonePage(context.new_page(), server.address)
        phone.shoot()
        phone.page.get_by_role("button", name="List of views").click()
        note = phone.page.get_by_role("dialog", name="Views").locator("small")
        phone.wait_for(lambda: "made by" in note.inner_text())
        assert "ready · made by" in note.inner_text()
        phone.keep_picture("views-first")
        phone.wait_for(lambda: note.inner_text().endswith("made by adampi"))
        phone.let_pass(6)
        phone.keep_picture("views-learned")
        assert phone.states() == ["ready"]
        assert phone.problems == []
    finally:
        server.stop()


def test_offline_for_a_minute_with_five_captures(
    context: BrowserContext, server: LiveServer
) -> None:
    page = context.new_page()
    page.clock.install()  # the minute passes in leaps; all else takes its time
    phone = VirtualPhonePage(page, server.address)
    phone.shoot_and_wait()
    context.set_offline(True)
    ids = []
    for step in range(5):
        phone.hold(moved(x_m=0.05 * (step + 1)))
        ids.append(phone.shoot())
    tried: list[str] = []
    page.on("requestfailed", lambda request: tried.append(request.url))
    began_ms: float = page.evaluate("Date.now()")
    while page.evaluate("Date.now()") < began_ms + 60_000:
        page.clock.fast_forward(2_000)
        page.wait_for_timeout(50)  # what is due by then is tried, and fails
    assert any(ids[0] in url for url in tried)
    assert set(phone.states()[1:]) <= {"waiting", "uploading"}
    phone.keep_picture("offline")
    context.set_offline(False)
    phone.wait_for(lambda: phone.states() == ["ready"] * 6)
    assert stored_ids(server.sessions)[1:] == ids
    assert phone.problems == []


def test_a_reload_in_the_middle_loses_nothing(context: BrowserContext, server: LiveServer) -> None:
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address)
    phone.shoot_and_wait()

    def cut(route: Route) -> None:
        route.abort("connectionfailed")

    page.route("**/captures/*", cut)
    ids = [phone.shoot(), phone.shoot()]
    page.reload(wait_until="commit")
    phone.wait_until_running()
    assert [view["id"] for view in phone.views()[1:]] == ids
    page.unroute("**/captures/*")
    phone.wait_for(lambda: phone.states() == ["ready"] * 3)
    assert stored_ids(server.sessions)[1:] == ids
    assert len(set(stored_ids(server.sessions))) == 3


def test_a_lost_graphics_context_loses_no_view(context: BrowserContext, server: LiveServer) -> None:
    """The page is loaded anew then, and goes on with its session."""
    page = context.new_page()
    phone = VirtualPhonePage(page, server.address)
    first = phone.shoot_and_wait()
    page.route("**/captures/*", lambda route: route.abort("connectionfailed"))
    second = phone.shoot()
    with page.expect_event("load"):
        page.evaluate(
            "document.getElementById('picture').getContext('webgl2')"
            ".getExtension('WEBGL_lose_context').loseContext()"
        )
    phone.wait_until_running()
    assert [view["id"] for view in phone.views()] == [first, second]
    page.unroute("**/captures/*")
    phone.wait_for(lambda: phone.states() == ["ready"] * 2)
    phone.until("() => window.peaking.resident().views === 2")
    phone.let_pass(6)
    assert phone.page.evaluate("window.peaking.seen().viewIds.length") == 2
    assert stored_ids(server.sessions) == [first, second]


def test_the_server_may_be_killed_and_started_again(
    context: BrowserContext, server: LiveServer
) -> None:
    phone = VirtualPhonePage(context.new_page(), server.address)
    first = phone.shoot_and_wait()
    server.kill()
    second = phone.shoot()
    phone.page.get_by_text("does not answer").first.wait_for()
    assert phone.states()[1] in ("waiting", "uploading")
    server.start()
    phone.wait_for(lambda: phone.states() == ["ready"] * 2)
    assert stored_ids(server.sessions) == [first, second]
    phone.let_pass(3)
    assert phone.problems == []


def test_a_full_disk_keeps_the_capture_on_the_phone(
    context: BrowserContext, tmp_path: Path
) -> None:
    disk = any_full_disk(tmp_path)
    sessions = tmp_path / "sessions"
    server = LiveServer(sessions, wrapped_in=disk.wrap(sessions)).start()
    try:
        page = context.new_page()
        phone = VirtualPhonePage(page, server.address)
        first = phone.shoot_and_wait()
        disk.fill(server)
        second = phone.shoot()
        page.get_by_text("disk", exact=False).first.wait_for()
        phone.keep_picture("disk-full")
        assert phone.states() == ["ready", "waiting"]
        page.reload(wait_until="commit")  # it is on the phone's disk, not only in its memory
        phone.wait_until_running()
        page.get_by_text("disk", exact=False).first.wait_for()
        assert [view["id"] for view in phone.views()] == [first, second]
        assert phone.states()[1] == "waiting"
        disk.free(server)
        phone.wait_for(lambda: phone.states() == ["ready"] * 2)
        assert stored_ids(disk.sessions(server)) == [first, second]
    finally:
        server.stop()


def test_it_works_on_a_small_screen(browser: Browser, server: LiveServer) -> None:
    context = browser.new_context(
        viewport={"width": 412, "height": 915}, has_touch=True, is_mobile=True
    )
    phone = VirtualPhonePage(context.new_page(), server.address)
    phone.shoot_and_wait()
    phone.hold(moved(x_m=0.3))
    phone.keep_picture("small-screen")
    assert phone.peaked_share() > 0
    context.close()


def test_a_recording_plays_as_the_camera(browser: Browser, tmp_path: Path) -> None:
    desk = Path(__file__).parents[2] / "scenes" / "desk"
    server = LiveServer(tmp_path / "sessions", (*DEMO, str(desk))).start()
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        phone = VirtualPhonePage(context.new_page(), server.address, query="source=replay")
        phone.shoot_and_wait()
        phone.keep_picture("replay")
        assert phone.states() == ["ready"]
        context.close()
    finally:
        server.stop()
