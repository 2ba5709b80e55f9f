"""What the benchmark of the live loop sends; its figures are in docs/benchmarks.md."""

from __future__ import annotations

import threading
from collections.abc import Generator
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from capture_uploads import upload
from peaking.benchmarks import live_strain
from peaking.benchmarks.live_phone import LivePhone
from peaking.server.upload import parse_upload


def test_a_large_upload_is_a_photo_of_the_same_size_in_pixels() -> None:
    large = live_strain._of_60_mb(upload(1))  # pyright: ignore[reportPrivateUsage]
    assert len(large) == pytest.approx(live_strain.LARGE_BYTES, rel=0.01)
    assert parse_upload(large).header.camera == parse_upload(upload(1)).header.camera


class Busy(BaseHTTPRequestHandler):
    """Is busy twice, then answers."""

    asked = 0

    def do_PUT(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        Busy.asked += 1
        self.send_response(503 if Busy.asked <= 2 else 200)
        self.send_header("Retry-After", "0")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""


@pytest.fixture
def address() -> Generator[str, None, None]:
    with HTTPServer(("127.0.0.1", 0), Busy) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_a_phone_that_is_told_to_wait_asks_again(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LivePhone, "_listen", lambda _: None)  # pyright: ignore[reportUnknownLambdaType, reportUnknownArgumentType]
    phone = LivePhone(address, "a phone")
    phone.close()
    assert Busy.asked == 3
