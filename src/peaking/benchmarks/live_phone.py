"""A simulated phone: uploads captures over HTTP and is told when their MPIs are ready."""

from __future__ import annotations

import http.client
import json
import struct
import threading
import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, cast
from urllib.parse import urlsplit

import numpy as np

from peaking.datasets import Recording
from peaking.frame import Frame
from peaking.output import depth_mm, encode_jpeg
from peaking.server import wire

PHOTO_QUALITY = 95
PATIENCE_S = 60.0


@dataclass(frozen=True)
class LiveCapture:
    """When one capture was sent, acknowledged and ready, in seconds of one clock."""

    capture_id: str
    sent_s: float
    acknowledged_s: float
    ready_s: float
    bytes_up: int
    bytes_down: int

    @property
    def upload_to_ready_ms(self) -> float:
        """From the last byte of the upload handed over to the news that the MPI can be fetched."""
        return (self.ready_s - self.sent_s) * 1e3


def upload_body(frame: Frame) -> bytes:
    """Return a frame as the body of an upload; see `peaking.server.wire.CaptureHeader`."""
    k = frame.camera.pinhole
    photo = encode_jpeg(frame.rgb, quality=PHOTO_QUALITY)
    pose = frame.camera.world_from_cam.matrix()[:3].reshape(-1).tolist()
    header: dict[str, Any] = {
        "protocol": wire.PROTOCOL,
        "camera": {
            "pinhole": {
                "width_px": k.width_px,
                "height_px": k.height_px,
                "fx_px": k.fx_px,
                "fy_px": k.fy_px,
                "cx_px": k.cx_px,
                "cy_px": k.cy_px,
            },
            "world_from_cam": pose,
        },
        "time_s": frame.timestamp_s or 0.0,
        "photo_bytes": len(photo),
        "depth": None,
    }
    depth = b""
    if frame.depth_m is not None:
        height, width = frame.depth_m.shape
        header["depth"] = {"width_px": width, "height_px": height}
        depth = depth_mm(frame.depth_m).astype("<u2").tobytes()
    text = json.dumps(header).encode()
    return struct.pack("<I", len(text)) + text + photo + depth


def upload_bodies(recordings: Sequence[Recording], count: int) -> list[bytes]:
    """Return `count` uploads of frames spread evenly over the recordings."""
    each = -(-count // len(recordings))
    bodies: list[bytes] = []
    for recording in recordings:
        indices = np.linspace(0, len(recording) - 1, min(each, len(recording))).astype(int)
        bodies += [upload_body(recording.read(int(index))) for index in indices]
    return bodies[:count]


@dataclass
class LivePhone:
    """One session on a server, with a connection for uploads and one for news.

    Every wait ends after `PATIENCE_S` with a `TimeoutError`.
    """

    address: str
    name: str
    session_id: str = field(default_factory=lambda: str(uuid.uuid4()))

    def __post_init__(self) -> None:
        self._ready: dict[str, tuple[float, Mapping[str, Any]]] = {}
        self._news = threading.Condition()
        self._closed = False
        parts = urlsplit(self.address)
        self._host, self._port = parts.hostname or "localhost", parts.port or 80
        self._connection = http.client.HTTPConnection(self._host, self._port, timeout=PATIENCE_S)
        self.request(
            "PUT",
            f"/api/v1/sessions/{self.session_id}",
            json.dumps(
                {
                    "protocol": wire.PROTOCOL,
                    "name": self.name,
                    "source": "other",
                    "device": "peaking bench live",
                }
            ).encode(),
            content="application/json",
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def close(self) -> None:
        """Hang up."""
        self._closed = True
        self._connection.close()

    def request(
        self,
        method: Literal["GET", "PUT", "DELETE"],
        path: str,
        body: bytes | None = None,
        *,
        content: str = "application/octet-stream",
    ) -> tuple[int, bytes]:
        """Send one request, again for as long as the server is busy; return status and body.

        Raises:
            RuntimeError: The server answered with 400 or above.
        """
        headers = {"Content-Type": content} if body is not None else {}
        try:
            self._connection.request(method, path, body, headers)
            answer = self._connection.getresponse()
        except ConnectionError:
            # The server hangs up on idle connections; everything can be sent twice, by its id.
            self._connection.close()
            self._connection.request(method, path, body, headers)
            answer = self._connection.getresponse()
        data = answer.read()
        if answer.status == 503 and (wait := answer.headers.get("Retry-After")):
            time.sleep(float(wait))
            return self.request(method, path, body, content=content)
        if answer.status >= 400:
            raise RuntimeError(f"{method} {path}: {answer.status} {data[:300]!r}")
        return answer.status, data

    def capture(self, body: bytes, *, fetch: bool = True) -> LiveCapture:
        """Upload a capture, wait until its MPI is ready, and fetch it.

        Raises:
            RuntimeError: The server refused it, or could not make its MPI.
            TimeoutError: The news did not come.
        """
        capture_id = str(uuid.uuid4())
        path = f"/api/v1/sessions/{self.session_id}/captures/{capture_id}"
        sent_s = time.perf_counter()
        self.request("PUT", path, body)
        acknowledged_s = time.perf_counter()
        ready_s = self._wait_for(capture_id)
        data = self.request("GET", f"{path}/mpi")[1] if fetch else b""
        return LiveCapture(capture_id, sent_s, acknowledged_s, ready_s, len(body), len(data))

    def _wait_for(self, capture_id: str) -> float:
        with self._news:
            if not self._news.wait_for(lambda: capture_id in self._ready, PATIENCE_S):
                raise TimeoutError(f"no news of capture {capture_id} within {PATIENCE_S:.0f} s")
            when_s, capture = self._ready.pop(capture_id)
        if capture["state"] != "ready":
            raise RuntimeError(f"capture {capture_id}: {capture['state']}: {capture['problem']}")
        return when_s

    def _listen(self) -> None:
        connection = http.client.HTTPConnection(self._host, self._port, timeout=PATIENCE_S)
        connection.request("GET", f"/api/v1/sessions/{self.session_id}/events")
        stream = connection.getresponse()
        while not self._closed:
            line = stream.readline()
            if not line:
                return
            if line.startswith(b"data:"):
                self._hear(json.loads(line[5:]), time.perf_counter())

    def _hear(self, event: Mapping[str, Any], now_s: float) -> None:
        captures: Sequence[Any] = ()
        if event["type"] == "SessionState":
            captures = cast(Sequence[Any], event["session"]["captures"])
        elif event["type"] == "CaptureChanged":
            captures = (event["capture"],)
        with self._news:
            for capture in captures:
                if capture["state"] != "queued":
                    self._ready.setdefault(capture["id"], (now_s, capture))
            self._news.notify_all()
