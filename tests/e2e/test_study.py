"""A whole participant of a study in a real browser, with the server killed in the middle."""

from __future__ import annotations

import json
import time
from collections.abc import Generator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route

from e2e.virtual_phone_page import ARTEFACTS, PATIENCE_MS, moved
from live_server import LiveServer
from patience import PATIENCE_S
from peaking.cli import main
from peaking.study.measures import measures_of
from peaking.study.protocol import FILE_NAME
from peaking.study.records import GuideTold, read_participants
from peaking.study.tables import Study, read_study

PROTOCOL = """
version = 1
title = "Two ways to photograph a desk"
design = "within"
order = "ab-ba"
planned_participants = 2
seed = 1
consent = "You photograph a desk twice.\\n\\nYour name is recorded nowhere."
conditions = [
  { name = "free", label = "No guidance", overlay = "none" },
  { name = "peaking", label = "Error peaking", overlay = "peaks" },
]
scenes = [{ name = "desk", label = "Desk" }]
[tasks]
introduction = "The experimenter explains what happens."
[ask]
at_start = ["demographics"]
after_capture = ["paper_before"]
after_review = ["paper_after", "sus", "nasa_tlx"]
at_end = ["comments"]
"""


GUIDED = """
version = 1
title = "Guided"
design = "within"
order = "fixed"
planned_participants = 1
seed = 1
scenes = [{ name = "desk", label = "Desk" }]
[[conditions]]
name = "llff"
label = "Grid"
overlay = "none"
guide = "plenoptic"
area_side_m = 0.3
scan = true
"""


@pytest.fixture
def phone(browser: Browser, server: LiveServer) -> Generator[BrowserContext, None, None]:
    """Return a phone, whose pages are closed before the server is: it would wait for them."""
    context = browser.new_context(
        viewport={"width": 412, "height": 915}, has_touch=True, is_mobile=True
    )
    yield context
    context.close()


@pytest.fixture
def server(tmp_path: Path, request: pytest.FixtureRequest) -> Generator[LiveServer, None, None]:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / FILE_NAME).write_text(getattr(request, "param", PROTOCOL))
    server = LiveServer(folder, command=("study", "serve", "--local")).start()
    yield server
    server.stop()


def picture(page: Page, name: str, *, whole: bool = True) -> None:
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=ARTEFACTS / f"study-{name}.png", full_page=whole)


def open_page(context: BrowserContext, address: str, problems: list[str]) -> Page:
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(address, wait_until="commit")
    return page


def press(console: Page, verb: str, what: str) -> None:
    console.get_by_role("button", name=f"{verb} {what}", exact=True).click()


def pick(page: Page, answers: dict[str, str]) -> None:
    """Answer items of the form that is shown: a point of a scale, or a choice."""
    for item, value in answers.items():
        page.locator(f"#{item}-{value}").check(force=True)


def hand_in(page: Page) -> None:
    page.get_by_role("button", name="Submit").click()


def heading(page: Page, text: str) -> None:
    page.get_by_role("heading", name=text).wait_for()


def wait_for(page: Page, holds: str, argument: object = None) -> None:
    """Wait until a function of the page returns true; pages may come and go meanwhile."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        try:
            if page.evaluate(holds, argument) is True:
                return
        except Exception:  # the page was just left
            pass
        page.wait_for_timeout(100)
    pytest.fail(f"waited in vain: {holds}")


def shoot(page: Page, views: int) -> None:
    wait_for(page, "() => window.peaking?.canShoot() === true")
    page.get_by_role("button", name="Take a view (space)").click()
    wait_for(
        page,
        "n => window.peaking.timeline().filter(c => c.times.drawn !== undefined).length >= n",
        views,
    )


def fill_tlx(page: Page) -> None:
    heading(page, "How it was to do the task")
    for scale in ("mental", "physical", "temporal", "performance", "effort", "frustration"):
        page.locator(f"#{scale}").press("ArrowRight")
    names = page.locator("fieldset input[type=radio]").evaluate_all(
        "radios => [...new Set(radios.map(r => r.name))]"
    )
    for name in names:
        page.locator(f"input[name={name}]").first.check(force=True)
    hand_in(page)


def read(server: LiveServer) -> Study:
    return read_study(server.sessions)


def test_a_whole_participant(
    browser: Browser, phone: BrowserContext, server: LiveServer, tmp_path: Path
) -> None:
    problems: list[str] = []
    desktop = browser.new_context(viewport={"width": 1280, "height": 860})
    console = open_page(desktop, f"{server.address}/study", problems)
    console.get_by_role("button", name="Add participant").click()
    console.get_by_role("heading", name="P01").wait_for()
    page = open_page(
        phone, f"{server.address}/participant?participant=P01&source=virtual", problems
    )

    heading(page, "Before we begin")
    picture(page, "1-consent")
    page.get_by_role("button", name="Continue").click()
    heading(page, "Some answers are missing")
    assert page.evaluate("document.activeElement.className") == "summary"
    pick(page, {"agreed": "yes", "images": "yes"})
    page.get_by_role("button", name="Continue").click()

    # Half filled in, reloaded, and filled in to the end; the server is killed in between.
    heading(page, "About you")
    page.locator("#age").fill("27")
    pick(page, {"hand": "right", "vision": "normal"})
    page.get_by_text("Saved", exact=True).wait_for()
    server.kill()
    pick(page, {"red_green": "no"})
    server.start()
    page.reload()
    heading(page, "About you")
    assert page.locator("#age").input_value() == "27"
    assert page.locator("#red_green-no").is_checked()
    hand_in(page)
    heading(page, "Some answers are missing")
    picture(page, "3-demographics-incomplete")
    # A second tab has what the first one has, and does not undo it.
    tab = open_page(phone, page.url, problems)
    heading(tab, "About you")
    assert tab.locator("#age").input_value() == "27"
    pick(tab, {"ar": "3"})
    tab.get_by_text("Saved", exact=True).wait_for()
    wait_for(page, "() => document.querySelector('#ar-3').checked")
    pick(page, {"photography": "2"})
    hand_in(page)

    heading(page, "Introduction")
    heading(tab, "Introduction")
    tab.close()
    press(console, "Start", "introduction")
    press(console, "Stop", "introduction")

    for trial in ("t1", "t2"):
        red = read(server).participants[0].trials[int(trial[1]) - 1].trial.condition == "peaking"
        press(console, "Start", "capture")
        page.get_by_role("link", name="Open the camera").click()
        shoot(page, 1)
        if trial == "t1":
            server.kill()  # the phone goes on, and tells later
        page.evaluate("pose => window.peaking.phone.setPose(pose)", moved(x_m=0.3))
        frames = page.evaluate("window.peaking.frames()")
        wait_for(page, "frames => window.peaking.frames() > frames + 6", frames)
        if red:
            page.get_by_text("wrong", exact=True).wait_for()
        assert page.locator(".meter").is_visible() == red
        picture(page, f"5-capture-{'red' if red else 'free'}", whole=False)
        if trial == "t1":
            server.start()
        shoot(page, 2)
        if trial == "t2":
            page.reload()
            wait_for(page, "() => window.peaking?.views().length === 2")
            wait_for(page, "() => window.peaking?.canShoot() === true")
        if trial == "t2":
            picture(console, "console")
        page.locator(".shoot .side:last-child button").click()
        page.locator(".study-sheet .primary").click()
        heading(page, "Before you see the result")
        if trial == "t1":
            picture(page, "6-over-the-camera", whole=False)
        pick(page, {"s_conf": "6", "scene_focus": "5"})
        hand_in(page)
        press(console, "Start", "review")
        wait_for(page, "() => document.querySelector('.study-sheet').hidden")
        assert not page.get_by_role("button", name="Take a view (space)").is_visible()
        page.locator(".shoot .side:last-child button").click()
        heading(page, "Now that you have seen the result")
        pick(page, {"satis": "6"})
        hand_in(page)
        heading(page, "Using the system")
        easy = page.get_by_role("group", name="I thought the system was easy to use.")
        easy.get_by_role("radio", name="5: Strongly agree").focus()
        page.keyboard.press("ArrowLeft")
        assert easy.get_by_role("radio", name="4", exact=True).is_checked()
        pick(page, {f"q{i}": "4" if i % 2 else "2" for i in range(1, 11) if i != 3})
        page.get_by_role("button", name="Submit").dblclick()
        fill_tlx(page)

    heading(page, "In your own words")
    page.locator("#liked").fill("The red.")
    hand_in(page)
    heading(page, "Thank you")
    console.get_by_text("All data is saved").wait_for()
    desktop.close()

    study = read(server)
    (participant,) = study.counting
    assert participant.answers["demographics"]["age"] == 27
    assert participant.answers["comments"]["liked"] == "The red."
    for trial in participant.trials:
        found = measures_of(trial, study.protocol)
        assert found["captures"] == 2
        assert found["sus"] == 75.0
        assert found["s_conf"] == 6
        assert found["satis"] == 6
        assert found["tlx_raw"] == 55.0
        assert found["tlx_weighted"] == 55.0
        tct_s, nct_s, waiting_s = found["tct_s"], found["nct_s"], found["waiting_s"]
        assert tct_s is not None
        assert nct_s is not None
        assert waiting_s is not None
        assert 0 < nct_s <= tct_s < PATIENCE_S
        assert (waiting_s > 0) == (trial.trial.condition == "peaking")
        assert found["peaked_last"] is not None
    second = measures_of(participant.trials[1], study.protocol)
    assert (second["interrupted_s"] or 0) > 0
    lines = (server.sessions / "participants" / "P01" / "events.jsonl").read_text().splitlines()
    kinds = [json.loads(line)["type"] for line in lines]
    assert kinds.count("Answered") == 1 + 2 * 4 + 1
    assert kinds.count("CaptureBegun") == 2
    assert problems == []

    main(["study", "analyse", str(server.sessions), "--out", str(tmp_path / "results")])
    assert (tmp_path / "results" / "report.html").is_file()


@pytest.mark.parametrize("server", [GUIDED], indirect=True)
def test_a_guided_trial_scans_first(phone: BrowserContext, server: LiveServer) -> None:
    problems: list[str] = []
    console = open_page(phone, f"{server.address}/study", problems)
    console.get_by_role("button", name="Add participant").click()
    press(console, "Start", "scan")
    page = open_page(phone, f"{server.address}/participant?participant=P01", problems)
    page.get_by_role("link", name="Open the camera").click()
    wait_for(page, "() => window.peaking?.canShoot() === true")
    step = 0
    while page.evaluate("window.peaking.guide().zMin_m === null"):
        page.evaluate("pose => window.peaking.phone.setPose(pose)", moved(x_m=0.02 * (step % 5)))
        page.wait_for_timeout(150)
        step += 1
    picture(page, "guide-1-scan", whole=False)
    page.get_by_role("button", name="Take a view (space)").click()
    page.get_by_text("The experimenter will start the next part.").wait_for()
    console.bring_to_front()
    press(console, "Start", "capture")
    page.bring_to_front()
    wait_for(page, "() => document.querySelector('.study-sheet').hidden")
    picture(page, "guide-2-capture", whole=False)
    shoot(page, 1)
    page.locator(".shoot .side:last-child button").click()
    page.locator(".study-sheet .primary").click()
    page.get_by_text("The experimenter will start the next part.").wait_for()
    console.bring_to_front()
    press(console, "Start", "review")
    page.bring_to_front()
    wait_for(page, "() => document.querySelector('.study-sheet').hidden")
    picture(page, "guide-3-review", whole=False)
    assert not page.locator(".guide").is_visible()
    page.locator(".shoot .side:last-child button").click()
    heading(page, "Thank you")

    study = read(server)
    (trial,) = study.counting[0].trials
    found = measures_of(trial, study.protocol)
    assert found["captures"] == 1
    assert (found["scan_s"] or 0) > 0
    assert found["nct_s"] == found["tct_s"]
    told = {e.name: e.value for e in trial.events if isinstance(e, GuideTold)}
    assert told["z_min_m"] > 0
    assert told["area_side_m"] == 0.3
    assert told["views_needed"] >= 1
    assert problems == []


def test_an_order_whose_answer_is_lost_counts_once(
    phone: BrowserContext, server: LiveServer
) -> None:
    problems: list[str] = []
    console = open_page(phone, f"{server.address}/study", problems)
    lost: list[str] = []

    def lose_the_first_answer(route: Route) -> None:
        if route.request.method != "PUT" or route.request.url in lost:
            route.continue_()
            return
        lost.append(route.request.url)
        assert route.fetch().ok
        route.abort()

    console.route("**/study/console/participants/**", lose_the_first_answer)
    console.get_by_role("button", name="Add participant").click()
    console.get_by_role("heading", name="P01").wait_for()
    wait_for(console, "() => document.querySelector('.add').disabled === false")
    console.get_by_label("Note").fill("late")
    with console.expect_response(lambda answer: "/notes/" in answer.url and answer.ok):
        console.get_by_role("button", name="Save note").click()
    console.get_by_role("listitem").filter(has_text="late").wait_for()
    assert len(lost) == 2
    (only,) = read_participants(server.sessions)
    assert only.notes == ["late"]
    assert problems == []


def test_the_console_and_a_phone_are_paired_by_links_that_work_once(
    browser: Browser, tmp_path: Path
) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / FILE_NAME).write_text(PROTOCOL)
    server = LiveServer(folder, command=("study", "serve", "--adb")).start()
    desk, phone, stranger = (browser.new_context() for _ in range(3))
    problems: list[str] = []
    try:
        (link,) = (line.strip() for line in server.said if "/study#code=" in line)
        console = open_page(desk, link, problems)
        console.get_by_role("button", name="Add participant").click()
        shown = console.locator(".phone-link a")
        wait_for(console, "() => document.querySelector('.phone-link a')?.href.includes('#code=')")
        wait_for(console, "() => document.querySelector('.phone-link img')?.naturalWidth > 50")
        first = shown.first.get_attribute("href")
        assert first
        assert "#code" not in shown.first.inner_text()  # nobody reads it over a shoulder
        page = open_page(phone, first, problems)
        heading(page, "Before we begin")
        # It is used up, so the console shows another one.
        wait_for(console, "old => document.querySelector('.phone-link a')?.href !== old", first)
        late = open_page(stranger, first, problems)
        late.get_by_text("was used before").wait_for()
        page = open_page(phone, f"{server.address}/study", problems)
        page.get_by_text("This browser has no access to the console").wait_for()
        assert problems == []
    finally:
        for context in (desk, phone, stranger):
            context.close()
        server.stop()
