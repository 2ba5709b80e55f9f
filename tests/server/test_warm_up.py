"""The first start: how far it is can be asked, and captures are served whatever comes of it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from peaking.commands.serving import preparation_said
from peaking.options import DEFAULT
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore
from peaking.server.warm_up import KERNELS, WarmUp
from peaking.view_builder import ViewBuilder

START = (
    "from peaking.server.warm_up import WarmUp; from peaking.view_builder import ViewBuilder; "
    "WarmUp(print).run(ViewBuilder())"
)


class NoBuilder(ViewBuilder):
    """Builds nothing."""

    def generate(self, frame: object) -> object:  # type: ignore[override]
        raise MemoryError


def test_the_kernels_of_a_first_start_are_counted(tmp_path: Path) -> None:
    starts: list[list[float]] = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", START],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        starts.append([float(line) for line in done.stdout.split()])
    first, later = starts
    assert (first[0], first[-1]) == (0.0, 1.0)
    assert first == sorted(first)
    assert first[-2] == KERNELS / (KERNELS + 1)
    assert later == [1.0]  # from the cache


def test_it_ends_whatever_happens(caplog: pytest.LogCaptureFixture) -> None:
    warm_up = WarmUp()
    assert (warm_up.done, warm_up.share) == (False, 0.0)
    warm_up.run(NoBuilder(DEFAULT))
    assert (warm_up.done, warm_up.share) == (True, 1.0)
    assert "kernels" in caplog.text


def test_a_client_is_told_how_far_it_is(tmp_path: Path) -> None:
    begun, go_on = threading.Event(), threading.Event()

    class Held(WarmUp):
        """Has compiled half of the kernels, and waits."""

        def run(self, builder: ViewBuilder) -> None:
            self._compiled = KERNELS // 2
            begun.set()
            go_on.wait()
            super().run(builder)

    warm_up = Held()
    config = ServerOptions(devices=None, client_dir=tmp_path)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config, warm_up=warm_up)
    with TestClient(app, base_url="http://localhost") as client:
        begun.wait()
        info = client.get("/api/v1/server").json()
        assert (info["warm"], round(info["warm_share"], 1)) == (False, 0.5)
        go_on.set()
        while not warm_up.done:
            time.sleep(0.01)
        info = client.get("/api/v1/server").json()
        assert (info["warm"], info["warm_share"]) == (True, 1.0)


def test_the_terminal_says_it_too(capsys: pytest.CaptureFixture[str]) -> None:
    reachable = threading.Event()
    say_share = preparation_said(reachable)
    say_share(0.0)
    assert capsys.readouterr().out == ""  # first comes how the server is reached
    reachable.set()
    for kernels in range(KERNELS + 1):
        say_share(kernels / (KERNELS + 1))
    say_share(1.0)
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[-2] for line in said[:-1]] == [str(10 * tenth) for tenth in range(10)]
    assert said[-1].startswith("Ready")

    preparation_said(reachable)(1.0)  # all was in the cache
    assert capsys.readouterr().out == ""
