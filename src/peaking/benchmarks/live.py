"""Time the live loop: a real server, real bytes over loopback, and the client in a real browser."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from peaking.benchmarks import live_strain
from peaking.benchmarks.live_phone import LiveCapture, LivePhone, upload_bodies
from peaking.benchmarks.measure import machine
from peaking.benchmarks.servers import demo_server
from peaking.datasets import Recording

PHONES = 20
PHONE_PERIOD_S = 2.0
PHONES_FOR_S = 60.0
LONG_SESSION = 300
WARM_UP_CAPTURES = 5


@dataclass(frozen=True)
class LiveOptions:
    """What to time.

    Attributes:
        recordings: Where frames come from.
        captures: Captures of one phone, for the latencies.
        phones_for_s: How long the 20 phones keep shooting, seconds.
        long_session: Views of the long session.
        with_browser: Time the client in headless Chromium too.
    """

    recordings: Sequence[Recording]
    captures: int = 60
    phones_for_s: float = PHONES_FOR_S
    long_session: int = LONG_SESSION
    with_browser: bool = True


def run(plan: LiveOptions, *, told: Callable[[str], None]) -> dict[str, object]:
    """Measure everything; `told` hears what is going on.

    Raises:
        PeakingError: The server does not start.
    """
    document: dict[str, object] = {"machine": machine()}
    with tempfile.TemporaryDirectory() as folder, demo_server(Path(folder)) as address:
        bodies = upload_bodies(plan.recordings, plan.captures)
        told("waiting for the server's kernels")
        phone = LivePhone(address, "warm up")
        for body in bodies[:WARM_UP_CAPTURES]:
            phone.capture(body)
        phone.close()
        told(f"one phone, {plan.captures} captures")
        document |= _one_phone(address, bodies)
        told(f"one session of {plan.long_session} views")
        document |= _long_session(address, bodies, plan.long_session)
        told(f"{PHONES} phones for {plan.phones_for_s:.0f} s")
        document |= _many_phones(address, bodies, plan.phones_for_s)
        document |= live_strain.fair_turns(address, bodies, told)
        document |= live_strain.idle_connections(address, bodies, told)
        if plan.with_browser:
            from peaking.benchmarks import live_browser

            told("the client in headless Chromium")
            recording = plan.recordings[0]
            few = [recording.read(i) for i in range(min(10, len(recording)))]
            document |= live_browser.run(address, few)
    with tempfile.TemporaryDirectory() as folder:
        lateness = Path(folder) / "lateness"
        begin = f"from peaking.benchmarks import slow_disk; slow_disk.begin({str(lateness)!r})"
        with demo_server(Path(folder) / "sessions", begin) as address:
            document |= live_strain.loop_stall(address, bodies, lateness, told)
    return document


def _one_phone(address: str, bodies: Sequence[bytes]) -> dict[str, object]:
    phone = LivePhone(address, "one phone")
    captures = [phone.capture(body) for body in bodies]
    phone.close()
    took_ms = [capture.upload_to_ready_ms for capture in captures]
    return {
        "captures": len(captures),
        "upload_to_ready_p50_ms": _percentile(took_ms, 50),
        "upload_to_ready_p95_ms": _percentile(took_ms, 95),
        "acknowledged_p50_ms": _percentile(
            [(c.acknowledged_s - c.sent_s) * 1e3 for c in captures], 50
        ),
        "bytes_up_median": int(np.median([c.bytes_up for c in captures])),
        "bytes_down_median": int(np.median([c.bytes_down for c in captures])),
    }


def _long_session(address: str, bodies: Sequence[bytes], count: int) -> dict[str, object]:
    """Compare the last ten views of a long session with the first ten; they are the same frames."""
    phone = LivePhone(address, "long session")
    captures = [phone.capture(bodies[i % 10], fetch=False) for i in range(count // 10 * 10)]
    phone.close()
    took_ms = [capture.upload_to_ready_ms for capture in captures]
    first, last = took_ms[:10], took_ms[-10:]
    return {
        "view_10_ms": _percentile(first, 50),
        "view_300_ms": _percentile(last, 50),
        "view_300_over_view_10": round(float(np.median(last) / np.median(first)), 3),
    }


def _many_phones(address: str, bodies: Sequence[bytes], seconds: float) -> dict[str, object]:
    captures: list[LiveCapture] = []
    errors: list[str] = []

    def shoot(number: int) -> None:
        try:
            phone = LivePhone(address, f"phone {number}")
            begin_s = time.perf_counter() + number * PHONE_PERIOD_S / PHONES
            for turn in range(int(seconds / PHONE_PERIOD_S)):
                wait_s = begin_s + turn * PHONE_PERIOD_S - time.perf_counter()
                time.sleep(max(wait_s, 0.0))
                captures.append(phone.capture(bodies[(number + turn) % len(bodies)]))
            phone.close()
        except (OSError, RuntimeError, TimeoutError) as error:
            errors.append(f"phone {number}: {error}")

    phones = [threading.Thread(target=shoot, args=(number,)) for number in range(PHONES)]
    for phone in phones:
        phone.start()
    for phone in phones:
        phone.join()
    took_ms = [capture.upload_to_ready_ms for capture in captures]
    return {
        "phones_20_errors": len(errors),
        "phones_20_problems": errors[:5],
        "phones_20_captures": len(captures),
        "phones_20_p50_ms": _percentile(took_ms, 50),
        "phones_20_p95_ms": _percentile(took_ms, 95),
    }


def _percentile(values: Sequence[float], q: float) -> float:
    return round(float(np.percentile(values, q)), 2)
