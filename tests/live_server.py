"""A real server in a process of its own, and a real browser; for the end-to-end tests."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from patience import PATIENCE_S

CLIENT = Path(__file__).parents[1] / "src" / "peaking" / "server" / "client" / "index.html"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PEAKING = "from peaking.cli import main; main()"
FULL_SIZE = ("demo", "--no-open")
DEMO = (*FULL_SIZE, "--pixels", str(147 * 320))
"""A quarter of the usual pixels: drawing takes as much less time, which counts without a card."""
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",  # what holds the picture is put together by the processor: faster
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--no-first-run",
)


def browser_path() -> str:
    """Return the Chromium to test in; fails, and does not skip, when there is none."""
    named = os.environ.get("PEAKING_BROWSER")
    for name in (named,) if named else BROWSERS:
        found = shutil.which(name)
        if found:
            return found
    pytest.fail("no Chromium found; run: scripts/install_browser")


@contextmanager
def chromium() -> Generator[Browser, None, None]:
    """Run a headless Chromium whose WebGL works without a graphics card."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=browser_path(), headless=True, args=list(FLAGS)
        )
        yield browser
        browser.close()


@dataclass
class LiveServer:
    """`peaking demo` or `peaking serve`, which can be killed and started again at its address."""

    sessions: Path
    command: Sequence[str] = DEMO
    port: int = 0
    wrapped_in: Sequence[str] = ()
    """A command that runs the server's command, such as one that mounts something for it."""
    program: str = PEAKING
    said: list[str] = field(default_factory=list[str])
    address: str = ""

    def start(self) -> LiveServer:
        """Start it, and wait until it says its address."""
        if not CLIENT.is_file():
            pytest.fail("the web client is not built; run: make client")
        folder = ["--sessions"] if self.command[0] == "demo" else []
        arguments = [*self.command, "--port", str(self.port), *folder, str(self.sessions)]
        self.process = subprocess.Popen(
            [*self.wrapped_in, sys.executable, "-c", self.program, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
        assert self.process.stdout is not None
        self.said.clear()
        for line in self.process.stdout:
            self.said.append(line)
            found = re.search(r"https?://(localhost|127\.0\.0\.1):(\d+)", line)
            if found:
                self.address, self.port = found.group(), int(found.group(2))
                self._drainer = threading.Thread(target=self._drain, daemon=True)
                self._drainer.start()
                return self
        self.process.wait(PATIENCE_S)
        pytest.fail(f"the server did not start: {''.join(self.said)}")

    def kill(self) -> None:
        """End it as a power cut would."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        self._drainer.join(PATIENCE_S)

    def stop(self) -> None:
        """End it as Ctrl-C does."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(PATIENCE_S)
        self._drainer.join(PATIENCE_S)

    def _drain(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            self.said.extend(lines)
