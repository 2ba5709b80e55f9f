"""The live loop under strain: a slow disk, phones that flood, connections that only wait."""

from __future__ import annotations

import contextlib
import http.client
import socket
import struct
import threading
import time
import uuid
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
import numpy as np

from peaking.benchmarks.live_phone import LivePhone
from peaking.server.connections import limits_of_this_process

LARGE_BYTES = 60_000_000
LARGE_UPLOADS = 4
SEGMENT_BYTES = 65_533

PHONES = 100
PERIOD_S = 2.0
FAIR_S = 40.0
FLOODING_SESSIONS = 12
FLOODER = "127.0.0.2"
"""Another address of this machine: another device."""

IDLE = 2_000
SLOW_BODIES = 100
IDLE_S = 40.0
VIEW_S = 0.25

Told = Callable[[str], None]


def loop_stall(
    address: str, bodies: Sequence[bytes], lateness: Path, told: Told
) -> dict[str, object]:
    """Measure the longest stall of a loop whose disk flushes for 150 ms, under uploads of 60 MB.

    Args:
        address: Of a server that `slow_disk` has begun.
        bodies: Uploads of usual size; four phones send them meanwhile.
        lateness: Where that server writes.
        told: Hears what is going on.
    """
    told(f"{LARGE_UPLOADS} uploads of 60 MB to a disk that flushes for 150 ms")
    phone = LivePhone(address, "warm up")
    phone.capture(bodies[0])
    lateness.write_text("")  # from here on
    ended = threading.Event()

    def shoot() -> None:
        other = LivePhone(address, "meanwhile")
        while not ended.is_set():
            other.capture(bodies[1])
        other.close()

    others = [threading.Thread(target=shoot) for _ in range(4)]
    for other in others:
        other.start()
    large = _of_60_mb(bodies[0])
    for _ in range(LARGE_UPLOADS):
        phone.capture(large, fetch=False)
    ended.set()
    for other in others:
        other.join()
    phone.close()
    return {"loop_stall_max_ms": max(map(float, lateness.read_text().split()), default=0.0)}


def fair_turns(address: str, bodies: Sequence[bytes], told: Told) -> dict[str, object]:
    """Compare the worst of 100 phones with the median one, while another device floods."""
    told(f"{PHONES} phones and a flooder for {FAIR_S:.0f} s")
    took_ms: list[list[float]] = [[] for _ in range(PHONES)]
    errors: list[str] = []

    def shoot(number: int) -> None:
        try:
            phone = LivePhone(address, f"phone {number}")
            due_s = time.perf_counter() + number * PERIOD_S / PHONES
            for turn in range(int(FAIR_S / PERIOD_S)):
                time.sleep(max(due_s + turn * PERIOD_S - time.perf_counter(), 0.0))
                capture = phone.capture(bodies[(number + turn) % len(bodies)], fetch=False)
                took_ms[number].append(capture.upload_to_ready_ms)
            phone.close()
        except (OSError, RuntimeError, TimeoutError) as error:
            errors.append(f"phone {number}: {error}")

    with _flood(address, bodies[0]) as kept:
        phones = [threading.Thread(target=shoot, args=(number,)) for number in range(PHONES)]
        for phone in phones:
            phone.start()
        for phone in phones:
            phone.join()
    p95_ms = [float(np.percentile(times, 95)) for times in took_ms if times]
    return {
        "fair_errors": len(errors),
        "fair_problems": errors[:5],
        "fair_captures": sum(map(len, took_ms)),
        "fair_flooded": kept[0],
        "fair_p95_median_ms": round(float(np.median(p95_ms)), 1),
        "fair_p95_worst_ms": round(max(p95_ms), 1),
        "fair_p95_ratio": round(max(p95_ms) / float(np.median(p95_ms)), 2),
    }


def idle_connections(address: str, bodies: Sequence[bytes], told: Told) -> dict[str, object]:
    """Compare a phone with itself while 2,000 connections wait and 100 bodies come slowly."""
    limits_of_this_process()
    phone = LivePhone(address, "one phone")

    def p95_ms() -> float:
        took_ms: list[float] = []
        until_s = time.perf_counter() + IDLE_S
        while time.perf_counter() < until_s:
            took_ms.append(phone.capture(bodies[len(took_ms) % len(bodies)]).upload_to_ready_ms)
            time.sleep(VIEW_S)
        return float(np.percentile(took_ms, 95))

    told(f"one phone for {IDLE_S:.0f} s")
    usual_ms = p95_ms()
    told(f"the same with {IDLE:,} idle connections and {SLOW_BODIES} slow bodies")
    with _strangers(address) as made:
        strained_ms = p95_ms()
    phone.close()
    return {
        "idle_connections_made": made[0],
        "idle_connections_usual_p95_ms": round(usual_ms, 1),
        "idle_connections_p95_ms": round(strained_ms, 1),
        "idle_connections_p95_ratio": round(strained_ms / usual_ms, 2),
    }


def _of_60_mb(body: bytes) -> bytes:
    """Return an upload whose photo has been filled up with comments."""
    (length,) = struct.unpack_from("<I", body)
    header = msgspec.json.decode(body[4 : 4 + length])
    photo, rest = body[4 + length :][: header["photo_bytes"]], body[4 + length :]
    comment = b"\xff\xfe" + struct.pack(">H", SEGMENT_BYTES + 2) + bytes(SEGMENT_BYTES)
    filled = photo[:2] + comment * (LARGE_BYTES // len(comment)) + photo[2:]
    text = msgspec.json.encode(header | {"photo_bytes": len(filled)})
    return struct.pack("<I", len(text)) + text + filled + rest[len(photo) :]


@contextlib.contextmanager
def _flood(address: str, body: bytes) -> Generator[list[int], None, None]:
    """Upload without a pause, to a dozen sessions of another device; yield how many were kept."""
    parts = urlsplit(address)
    ended, kept = threading.Event(), [0]

    def flood() -> None:
        session = LivePhone(address, "flooder").session_id
        connection = http.client.HTTPConnection(
            "127.0.0.1", parts.port, source_address=(FLOODER, 0), timeout=60
        )
        with contextlib.suppress(OSError, http.client.HTTPException):
            while not ended.is_set():
                path = f"/api/v1/sessions/{session}/captures/{uuid.uuid4()}"
                connection.request("PUT", path, body)
                answer = connection.getresponse()
                answer.read()
                kept[0] += answer.status == 201
                if answer.status == 503:
                    time.sleep(0.2)  # asks much sooner than it was told
        connection.close()

    threads = [threading.Thread(target=flood, daemon=True) for _ in range(FLOODING_SESSIONS)]
    for thread in threads:
        thread.start()
    try:
        yield kept
    finally:
        ended.set()
        for thread in threads:
            thread.join(60)


@contextlib.contextmanager
def _strangers(address: str) -> Generator[list[int], None, None]:
    """Keep connections open that say nothing, or a body slowly; open what was closed again."""
    port = urlsplit(address).port or 80
    ended, made = threading.Event(), [0]
    slow = b"POST /api/v1/pair HTTP/1.1\r\nHost: elsewhere\r\nContent-Length: 1000000\r\n\r\n"

    def open_one(first: bytes) -> socket.socket:
        made[0] += 1
        connection = socket.create_connection(("127.0.0.1", port), timeout=10)
        connection.setblocking(False)
        connection.send(first)
        return connection

    def alive(connection: socket.socket, says: bytes) -> bool:
        try:
            if says:
                connection.send(says)
            while connection.recv(65_536):
                pass
        except BlockingIOError:
            return True
        except OSError:
            pass
        connection.close()
        return False

    def hold() -> None:
        said = [b""] * IDLE + [slow] * SLOW_BODIES
        held: list[socket.socket | None] = [None] * len(said)
        while not ended.is_set():
            for place, first in enumerate(said):
                connection = held[place]
                if connection is None or not alive(connection, first[:1] and b"x"):
                    with contextlib.suppress(OSError):
                        held[place] = open_one(first)
            ended.wait(0.5)
        for connection in held:
            if connection is not None:
                connection.close()

    thread = threading.Thread(target=hold)
    thread.start()
    try:
        yield made
    finally:
        ended.set()
        thread.join()
