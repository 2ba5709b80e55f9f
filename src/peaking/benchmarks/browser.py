"""Headless Chromium, as every benchmark of a page starts and asks it."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Generator
from typing import Any

from peaking.errors import BackendUnavailable, ToolMissing

PATIENCE_MS = 120_000
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--enable-precise-memory-info",
    "--js-flags=--expose-gc",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


@contextlib.contextmanager
def chromium(instead: str) -> Generator[Any, None, None]:
    """Yield a browser.

    Args:
        instead: What the user may do without one, for complaints.

    Raises:
        BackendUnavailable: playwright is not installed.
        ToolMissing: There is no Chromium.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise BackendUnavailable(
            f"playwright is not installed; pip install playwright, or {instead}"
        ) from error
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=_path(instead), headless=True, args=list(FLAGS)
        )
        try:
            yield browser
        finally:
            browser.close()


def until(page: Any, holds: str) -> None:
    """Wait until a function of the page returns true; its CSP forbids playwright's own way.

    Raises:
        TimeoutError: It does not.
    """
    until_s = time.monotonic() + PATIENCE_MS / 1e3
    while page.evaluate(holds) is not True:
        if time.monotonic() > until_s:
            raise TimeoutError(f"waited {PATIENCE_MS / 1e3:.0f} s for {holds}")
        page.wait_for_timeout(20)


def heap_bytes(page: Any) -> int:
    """Return the bytes that the page's scripts hold, after what nobody needs is gone."""
    return page.evaluate("(globalThis.gc?.(), performance.memory.usedJSHeapSize)")


def _path(instead: str) -> str:
    named = os.environ.get("PEAKING_BROWSER")
    for name in (named,) if named else BROWSERS:
        found = shutil.which(name)
        if found:
            return found
    raise ToolMissing(f"no Chromium found; run scripts/install_browser, or {instead}")
