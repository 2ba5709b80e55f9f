"""Servers in a process of their own, as users start them."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from pathlib import Path

from peaking.errors import PeakingError


@contextlib.contextmanager
def command_server(words: Sequence[str], begin: str = "pass") -> Generator[str, None, None]:
    """Run a command of `peaking` that serves pages, after a line of Python; yield its address.

    Args:
        words: The command and its arguments.
        begin: The line of Python.

    Raises:
        PeakingError: It does not start.
    """
    code = f"{begin}; from peaking.cli import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", code, *words, "--no-open", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            yield _address(process)
        finally:
            process.terminate()
            process.wait(10)


def demo_server(folder: Path, begin: str = "pass") -> contextlib.AbstractContextManager[str]:
    """Run `peaking demo` with its sessions in a folder; see `command_server`."""
    return command_server(["demo", "--sessions", str(folder)], begin)


def _address(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    said: list[str] = []
    for line in process.stdout:
        said.append(line)
        found = re.search(r"http://(localhost|127\.0\.0\.1):\d+", line)
        if found:
            threading.Thread(target=process.stdout.read, daemon=True).start()
            return found.group()
    raise PeakingError(f"the server did not start: {''.join(said).strip()}")
