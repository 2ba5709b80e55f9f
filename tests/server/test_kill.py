"""The server is killed at random moments; what it acknowledged is there."""

from __future__ import annotations

import http.client
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from patience import PATIENCE_S
from peaking.server.sessions import SessionStore

KILLS = 50
PHONES = 3
BUSY = 503

SERVERS = """
import os, sys
from pathlib import Path
from peaking.server import generation
from peaking.server.app import ServerOptions
from peaking.server.serving import bind, serve

# Compiling takes longer than these servers live; what is tested is the disk.
generation.GenerationQueue._work = lambda self: [None for _ in iter(self._waiting.get, None)]

# Each server is a process of its own; only importing, which is not tested, is done once for all.
for _ in sys.stdin:
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        print("ended", flush=True)
        continue
    listener = bind("127.0.0.1", 0)
    serve(
        listener,
        sessions=Path(sys.argv[1]),
        config=ServerOptions(devices=None, client_dir=Path("none")),
        started=lambda: print(os.getpid(), listener.getsockname()[1], flush=True),
        told=lambda _: None,
    )
"""


class Phone:
    """Sends captures one after the other, and the same again until it is acknowledged."""

    def __init__(self, first: int) -> None:
        self.next = first
        self.acknowledged: list[str] = []

    def shoot(self, port: int, stop: threading.Event) -> None:
        connection = http.client.HTTPConnection("localhost", port, timeout=PATIENCE_S)
        try:
            connection.request("PUT", f"/api/v1/sessions/{SESSION_ID}", json.dumps(new_session()))
            connection.getresponse().read()
            while not stop.is_set():
                sent = capture_id(self.next)
                path = f"/api/v1/sessions/{SESSION_ID}/captures/{sent}"
                connection.request("PUT", path, upload(self.next))
                answer = connection.getresponse()
                answer.read()
                if answer.status == BUSY:  # sending again is always right
                    stop.wait(0.01)
                    continue
                assert answer.status in (200, 201), answer.status
                self.acknowledged.append(sent)
                self.next += 1
        except (OSError, http.client.HTTPException):
            return  # the power went
        finally:
            connection.close()


class Servers:
    """Starts servers, one after the other, and kills them."""

    def __init__(self, sessions: Path) -> None:
        self._forks = subprocess.Popen(
            [sys.executable, "-c", SERVERS, str(sessions)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def start(self) -> tuple[int, int]:
        """Return the process and the port of a server that answers."""
        assert self._forks.stdin is not None
        self._forks.stdin.write("start\n")
        self._forks.stdin.flush()
        process, port = self._line().split()
        return int(process), int(port)

    def kill(self, process: int) -> None:
        """End it as a power cut would, and wait until it is gone."""
        os.kill(process, signal.SIGKILL)
        assert self._line() == "ended"

    def close(self) -> None:
        assert self._forks.stdin is not None
        self._forks.stdin.close()
        assert self._forks.wait(PATIENCE_S) == 0
        assert self._forks.stdout is not None
        self._forks.stdout.close()

    def _line(self) -> str:
        assert self._forks.stdout is not None
        return self._forks.stdout.readline().strip()


def count_acknowledged(phones: list[Phone]) -> int:
    return sum(len(phone.acknowledged) for phone in phones)


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    return tmp_path / "sessions"


def test_fifty_kills_lose_and_double_nothing(sessions: Path) -> None:
    moments = random.Random(7)
    phones = [Phone(1 + 100_000 * number) for number in range(PHONES)]
    servers = Servers(sessions)
    for kill in range(KILLS):
        process, port = servers.start()
        before = count_acknowledged(phones)
        stop = threading.Event()
        threads = [threading.Thread(target=phone.shoot, args=(port, stop)) for phone in phones]
        for thread in threads:
            thread.start()
        if kill % 5:  # every fifth may be killed before it has acknowledged anything
            until_s = time.monotonic() + PATIENCE_S
            while count_acknowledged(phones) == before and time.monotonic() < until_s:
                time.sleep(0.002)
        time.sleep(moments.uniform(0.0, 0.1))
        servers.kill(process)
        stop.set()
        for thread in threads:
            thread.join(PATIENCE_S)
    servers.close()
    (session,) = SessionStore(sessions).sessions()
    there = [capture.id for capture in session.captures]
    acknowledged = [sent for phone in phones for sent in phone.acknowledged]
    assert len(acknowledged) >= 0.8 * KILLS  # it was in the midst of work when it was killed
    assert len(there) == len(set(there))
    assert set(acknowledged) <= set(there)
    # What was not acknowledged may be there: at most one capture of every phone and kill.
    assert len(there) <= len(acknowledged) + KILLS * PHONES
    for capture in session.captures:
        number = int(capture.id[-12:])
        assert session.photo_path(capture).read_bytes() == photo(number)
        assert session.frame_of(capture.id).depth_m is not None
