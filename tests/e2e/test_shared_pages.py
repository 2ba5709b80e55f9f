"""What `peaking share` and `peaking view` show in a real browser: served, and from the disk."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from e2e.test_viewer import light_field
from e2e.virtual_phone_page import PATIENCE_MS
from live_server import PEAKING
from patience import PATIENCE_S
from peaking.benchmarks.view_material import served
from peaking.cli import main
from peaking.export.splats import write_splats
from peaking.splat.gaussians import Gaussians
from recordings import write_recording
from splat.scenes_of_gaussians import cloud

FLAGS = ["--pixels", "19200", "--licence", "CC BY 4.0, A. Person"]
PICTURED = 15.0
"""Standard deviation of colours within the middle of the page; an empty one has below 5."""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    return write_recording(folder, num_frames=6, width_px=160, height_px=120)


@contextmanager
def viewing(*arguments: object) -> Generator[str]:
    """Run `peaking view`; gives its address."""
    command = [sys.executable, "-c", PEAKING, "view", "--no-open", "--port", "0"]
    process = subprocess.Popen(
        [*command, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    try:
        said: list[str] = []
        for line in process.stdout:
            said.append(line)
            if found := re.search(r"http://localhost:\d+/", line):
                break
        else:
            pytest.fail(f"it did not start: {said}")
        yield found.group()
    finally:
        process.terminate()
        with process.stdout:
            process.stdout.read()
        process.wait(PATIENCE_S)


class Opened:
    """A page, and what went wrong in it."""

    def __init__(self, context: BrowserContext, address: str) -> None:
        self.page: Page = context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.problems: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("requestfailed", lambda request: self.problems.append(request.url))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address)

    def shows_a_picture(self) -> None:
        """Wait until the middle of the page is not empty."""
        self.page.locator("canvas").first.wait_for()
        self.page.add_style_tag(content="img { visibility: hidden !important }")  # the poster
        for _ in range(int(PATIENCE_MS / 250)):
            data = np.frombuffer(self.page.screenshot(), np.uint8)
            picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
            assert picture is not None
            height, width = picture.shape[:2]
            middle = picture[height // 3 : height * 2 // 3, width // 3 : width * 2 // 3]
            if float(middle.astype(float).std()) > PICTURED:
                return
            self.page.wait_for_timeout(250)
        pytest.fail("the page stayed empty")


def test_one_file_opens_from_the_disk(room: Path, context: BrowserContext, tmp_path: Path) -> None:
    out = tmp_path / "room.html"
    main(["share", str(room), "--out", str(out), "--title", "A room", *FLAGS])
    opened = Opened(context, out.as_uri())
    opened.shows_a_picture()
    assert opened.page.title() == "A room"
    assert "CC BY 4.0, A. Person" in opened.page.inner_text("body")
    assert [url for url in opened.asked if not url.startswith(("blob:", "data:"))] == [out.as_uri()]
    assert opened.problems == []


def test_gaussians_open_from_the_disk(room: Path, context: BrowserContext, tmp_path: Path) -> None:
    from peaking.commands.splat import Splat

    Splat(room, tmp_path / "room.ply", iterations=200, previews=0).run()
    out = tmp_path / "room.html"
    splat = ["--as", "splat", "--splat", str(tmp_path / "room.ply")]
    main(["share", str(room), "--out", str(out), *splat, *FLAGS])
    opened = Opened(context, out.as_uri())
    opened.shows_a_picture()
    assert opened.problems == []


def test_a_folder_opens_from_any_web_server(
    room: Path, context: BrowserContext, tmp_path: Path
) -> None:
    out = tmp_path / "room"
    main(["share", str(room), "--out", str(out), *FLAGS])
    with served(out) as address:
        opened = Opened(context, f"{address}/")
        opened.shows_a_picture()
        assert opened.page.title() == "room"
        assert all(url.startswith((address, "blob:", "data:")) for url in opened.asked)
        assert opened.problems == []


def test_a_file_that_was_cut_off_says_so(
    room: Path, context: BrowserContext, tmp_path: Path
) -> None:
    out = tmp_path / "room.html"
    main(["share", str(room), "--out", str(out), *FLAGS])
    page = out.read_text(encoding="utf-8")
    out.write_text(page.replace('id="place">{', 'id="place">{"cut": '), encoding="utf-8")
    opened = Opened(context, out.as_uri())
    problem = opened.page.get_by_role("alert")
    problem.wait_for()
    assert "cannot be read" in problem.inner_text()


def test_a_file_that_is_missing_says_so(
    room: Path, context: BrowserContext, tmp_path: Path
) -> None:
    out = tmp_path / "room.html"
    main(["share", str(room), "--out", str(out), *FLAGS])
    page = out.read_text(encoding="utf-8")
    of_mpis = re.compile(r'<script type="text/plain" data-file="mpis/[^>]*>[^<]*</script>')
    out.write_text(of_mpis.sub("", page), encoding="utf-8")
    opened = Opened(context, out.as_uri())
    said = opened.page.get_by_role("alert").filter(has_text="missing in this page")
    expect(said).to_be_visible(timeout=PATIENCE_MS)


def test_the_address_is_there_to_scan(context: BrowserContext, tmp_path: Path) -> None:
    splat, out = tmp_path / "cloud.ply", tmp_path / "cloud.html"
    write_splats(splat, Gaussians.from_parameters(cloud(400).astype("float32")))
    main(["share", str(splat), "--out", str(out), "--address", "https://example.org/cloud.html"])
    page = Opened(context, out.as_uri()).page
    link = page.get_by_role("link", name="Open https://example.org")
    expect(link).to_be_visible(timeout=PATIENCE_MS)


def test_view_shows_scenes_and_files_at_once(
    room: Path, context: BrowserContext, tmp_path: Path
) -> None:
    with viewing(room) as address:
        opened = Opened(context, address)
        light_field(opened.page)
        assert opened.problems == []
        opened.page.close()
    splat = tmp_path / "cloud.ply"
    write_splats(splat, Gaussians.from_parameters(cloud(400).astype("float32")))
    with viewing(splat) as address:
        opened = Opened(context, address)
        opened.page.wait_for_function(
            "() => window.viewer?.inspection.shown === 'splat'"
            " && viewer.inspection.count() === 400",
            polling=200,
        )
        assert opened.problems == []
