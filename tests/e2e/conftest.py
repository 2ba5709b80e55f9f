"""A real browser and a real server, for every test of this folder."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext

from live_server import DEMO, LiveServer, chromium


@pytest.fixture(scope="module")
def browser() -> Generator[Browser, None, None]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def context(browser: Browser) -> Generator[BrowserContext, None, None]:
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    yield context
    context.close()


@pytest.fixture
def server(tmp_path: Path, request: pytest.FixtureRequest) -> Generator[LiveServer, None, None]:
    server = LiveServer(tmp_path / "sessions", getattr(request, "param", DEMO)).start()
    yield server
    server.stop()
