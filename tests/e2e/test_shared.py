"""What `peaking share` and `peaking view` write, in a real browser: from the disk, and served."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from e2e.test_viewer import light_field
from e2e.virtual_phone_page import PATIENCE_MS, keep_picture
from live_server import PEAKING
from patience import PATIENCE_S
from peaking.export.splats import write_splats
from peaking.splat.gaussians import Gaussians
from places import DESK, served
from splat.scenes_of_gaussians import cloud


def share(*arguments: object) -> None:
    """Run `peaking share`."""
    command = [sys.executable, "-c", PEAKING, "share", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr


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


def opened(context: BrowserContext, address: str) -> tuple[Page, list[str]]:
    """Open a page; return what it fetches and what goes wrong in it, as it comes."""
    page = context.new_page()
    seen: list[str] = []
    page.on("request", lambda request: seen.append(request.url))
    page.on("pageerror", lambda error: seen.append(f"error {error}"))
    page.set_viewport_size({"width": 480, "height": 640})
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address, wait_until="commit")
    return page, seen


def shows_gaussians(page: Page) -> None:
    page.wait_for_function(
        "() => window.viewer?.inspection.shown === 'splat' && viewer.inspection.count() > 0",
        polling=200,
    )


def gaussians_in(path: Path) -> None:
    write_splats(path, Gaussians.from_parameters(cloud(400).astype("float32")))


def test_a_light_field_opens_from_the_disk(context: BrowserContext, tmp_path: Path) -> None:
    out = tmp_path / "desk.html"
    share(DESK, "--out", out, "--views", 6, "--licence", "CC BY 4.0", "--title", "My desk")
    assert out.stat().st_size < 20e6
    page, seen = opened(context, out.as_uri())
    light_field(page)
    expect(page).to_have_title("My desk")
    expect(page.get_by_text("CC BY 4.0")).to_be_visible()
    foreign = [url for url in seen if not url.startswith((out.as_uri(), "blob:", "data:"))]
    assert foreign == []
    page.keyboard.down("ArrowLeft")
    page.wait_for_timeout(500)
    page.keyboard.up("ArrowLeft")
    light_field(page)
    keep_picture(page, "shared_light_field")


def test_gaussians_open_from_the_disk(context: BrowserContext, tmp_path: Path) -> None:
    splat, out = tmp_path / "cloud.ply", tmp_path / "cloud.html"
    gaussians_in(splat)
    share(splat, "--out", out, "--address", "https://example.org/cloud.html")
    page, seen = opened(context, out.as_uri())
    shows_gaussians(page)
    page.set_viewport_size({"width": 900, "height": 700})
    expect(page.get_by_role("link", name="Open https://example.org")).to_be_visible()
    foreign = [url for url in seen if not url.startswith((out.as_uri(), "blob:", "data:"))]
    assert foreign == []


def test_a_folder_opens_from_any_web_server(context: BrowserContext, tmp_path: Path) -> None:
    out = tmp_path / "desk"
    share(DESK, "--out", out, "--views", 4)
    with served(out) as address:
        page, seen = opened(context, f"{address}/index.html")
        light_field(page)
        page.get_by_role("tab", name="Overview").click()
        page.wait_for_function("() => viewer.inspection.count() > 100", polling=200)
    assert [url for url in seen if not url.startswith((address, "blob:", "data:"))] == []


def test_a_page_that_is_cut_off_says_so(context: BrowserContext, tmp_path: Path) -> None:
    out = tmp_path / "desk.html"
    share(DESK, "--out", out, "--views", 2)
    html = out.read_text()
    (script,) = re.findall(
        r'<script type="text/plain" data-file="mpis/[^"]*">[^<]*</script>', html
    )[:1]
    out.write_text(html.replace(script, ""))
    page, _ = opened(context, out.as_uri())
    expect(page.get_by_role("alert").filter(has_text="missing in this page")).to_be_visible()


def test_view_shows_scenes_and_files_at_once(context: BrowserContext, tmp_path: Path) -> None:
    with viewing(DESK) as address:
        page, _ = opened(context, address)
        light_field(page)
        page.close()
    splat = tmp_path / "cloud.ply"
    gaussians_in(splat)
    with viewing(splat) as address:
        page, seen = opened(context, address)
        shows_gaussians(page)
        assert not any("error" in each for each in seen)
