"""What `peaking share` writes, opened in a real browser: from a plain web server, and from disk."""

from __future__ import annotations

import functools
import threading
from collections.abc import Generator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page

from e2e.virtual_phone_page import PATIENCE_MS
from peaking.cli import main
from recordings import write_recording

FLAGS = ["--pixels", "19200", "--licence", "CC BY 4.0, A. Person"]
PICTURED = 15.0
"""Standard deviation of colours within the middle of the page; an empty one has below 5."""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    return write_recording(folder, num_frames=6, width_px=160, height_px=120)


@contextmanager
def web_server(folder: Path) -> Generator[str]:
    """Serve a folder as any web server does; yield its address."""
    handler = functools.partial(SimpleHTTPRequestHandler, directory=folder)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/"
        finally:
            server.shutdown()
            thread.join()


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
    with web_server(out) as address:
        opened = Opened(context, address)
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
