"""The server is killed at random moments; what it acknowledged is there."""

from __future__ import annotations

import http.client
import json
import random
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from peaking.server.sessions import SessionStore

KILLS = 50
PHONES = 3

SERVER = """
import socket, sys
from pathlib import Path
from peaking.server import generation
from peaking.server.app import ServerConfig
from peaking.server.run import bind, serve

# Compiling takes longer than these servers live; what is tested is the disk.
generation.GenerationQueue._work = lambda self: [None for _ in iter(self._waiting.get, None)]
listener = bind("127.0.0.1", int(sys.argv[2]))
serve(
    listener,
    sessions=Path(sys.argv[1]),
    config=ServerConfig(token=None, client_dir=Path("none")),
    started=lambda: print(listener.getsockname()[1], flush=True),
    told=print,
)
"""


class Phone:
    """Sends captures one after the other, and the same again until it is acknowledged."""

    def __init__(self, first: int) -> None:
        self.next = first
        self.acknowledged: list[str] = []

    def shoot(self, port: int, stop: threading.Event) -> None:
        connection = http.client.HTTPConnection("localhost", port, timeout=5)
        try:
            connection.request("PUT", f"/api/v1/sessions/{SESSION_ID}", json.dumps(new_session()))
            connection.getresponse().read()
            while not stop.is_set():
                sent = capture_id(self.next)
                path = f"/api/v1/sessions/{SESSION_ID}/captures/{sent}"
                connection.request("PUT", path, upload(self.next))
                answer = connection.getresponse()
                answer.read()
                assert answer.status in (200, 201), answer.status
                self.acknowledged.append(sent)
                self.next += 1
        except (OSError, http.client.HTTPException):
            return  # the power went
        finally:
            connection.close()


def start(sessions: Path) -> tuple[subprocess.Popen[str], int]:
    process = subprocess.Popen(
        [sys.executable, "-c", SERVER, str(sessions), "0"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, int(process.stdout.readline())


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    return tmp_path / "sessions"


def test_fifty_kills_lose_and_double_nothing(sessions: Path) -> None:
    moments = random.Random(7)
    phones = [Phone(1 + 100_000 * number) for number in range(PHONES)]
    for _ in range(KILLS):
        process, port = start(sessions)
        stop = threading.Event()
        threads = [threading.Thread(target=phone.shoot, args=(port, stop)) for phone in phones]
        for thread in threads:
            thread.start()
        time.sleep(moments.uniform(0.02, 0.25))
        process.kill()
        process.wait(10)
        stop.set()
        for thread in threads:
            thread.join(10)
        assert process.stdout is not None
        process.stdout.close()
    (session,) = SessionStore(sessions).sessions()
    there = [capture.id for capture in session.captures]
    acknowledged = [sent for phone in phones for sent in phone.acknowledged]
    assert len(acknowledged) > KILLS  # it was in the midst of work when it was killed
    assert len(there) == len(set(there))
    assert set(acknowledged) <= set(there)
    # What was not acknowledged may be there: at most one capture of every phone and kill.
    assert len(there) <= len(acknowledged) + KILLS * PHONES
    for capture in session.captures:
        number = int(capture.id[-12:])
        assert session.photo_path(capture.id).read_bytes() == photo(number)
        assert session.frame_of(capture.id).depth_m is not None
