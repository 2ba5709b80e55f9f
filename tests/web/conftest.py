"""The pages that tests ask for parts of the renderer."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page

from live_server import chromium
from patience import PATIENCE_S

ROOT = Path(__file__).parents[2]


@contextmanager
def opened_page(name: str, ready: str) -> Generator[Page, None, None]:
    """Open a page of `web/tests/pages` in a browser; `ready` is what it puts into the window."""
    command = [ROOT / "scripts" / "with_node", "vite", "--port", "0", "--host", "127.0.0.1"]
    vite = subprocess.Popen(
        command, cwd=ROOT / "web", stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert vite.stdout is not None
    try:
        said, address = "", None
        while address is None:
            line = vite.stdout.readline()
            assert line, f"vite did not start: {said}"
            said += line
            address = re.search(r"http://127\.0\.0\.1:\d+", re.sub(r"\x1b\[[0-9;]*m", "", line))
        with chromium() as browser:
            page = browser.new_page()
            page.set_default_timeout(1e3 * PATIENCE_S)
            page.goto(f"{address.group()}/tests/pages/{name}.html", wait_until="commit")
            page.wait_for_function(f"window.{ready} !== undefined")
            yield page
    finally:
        vite.terminate()
        vite.wait(PATIENCE_S)
        vite.stdout.close()


@pytest.fixture(scope="module")
def page() -> Generator[Page, None, None]:
    with opened_page("core", "core") as page:
        yield page
