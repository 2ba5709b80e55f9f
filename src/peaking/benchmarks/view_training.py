"""Whether a training on the server is in the way of a capture."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from peaking.benchmarks.live_phone import LiveCapture, LivePhone, upload_bodies
from peaking.benchmarks.servers import demo_server
from peaking.benchmarks.view_material import Material, Told
from peaking.server import wire

TRAINED_VIEWS = 24
ROUNDS = 3
CAPTURES = 25
"""In each round, without a training and with one."""
PERIOD_S = 0.8
"""From capture to capture: faster than people take views."""
PATIENCE_S = 120.0


def beside_training(material: Material, told: Told) -> dict[str, object]:
    """Compare upload → ready of a phone with itself while another session is trained on."""
    bodies = upload_bodies([material.recording], TRAINED_VIEWS)
    with tempfile.TemporaryDirectory() as folder, demo_server(Path(folder)) as address:
        told("views to train on")
        trained = LivePhone(address, "trained")
        for body in bodies:
            trained.capture(body, fetch=False)
        phone = LivePhone(address, "phone")
        usual: list[LiveCapture] = []
        beside: list[LiveCapture] = []
        steps: list[int] = []
        for number in range(ROUNDS):
            told(f"a phone without a training: {number + 1} of {ROUNDS}")
            usual += _shoot(phone, bodies)
            told(f"a phone beside a training: {number + 1} of {ROUNDS}")
            before = _ask(trained, "running")
            beside += _shoot(phone, bodies)
            steps.append(_state(trained).step - before)
            _ask(trained, "stopped")
        state = _state(trained)
        phone.close()
        trained.close()
    document = {
        f"{name}_p{share}_ms": round(
            float(np.percentile([one.upload_to_ready_ms for one in captures], share)), 1
        )
        for name, captures in (("usual", usual), ("beside_training", beside))
        for share in (50, 95)
    }
    ratio = document["beside_training_p95_ms"] / document["usual_p95_ms"]
    return {
        **document,
        "p95_ratio": round(ratio, 2),
        "captures": len(usual),
        "steps_trained": steps,
        "state_at_last": state.state,
    }


def _shoot(phone: LivePhone, bodies: Sequence[bytes]) -> list[LiveCapture]:
    captures: list[LiveCapture] = []
    due_s = time.perf_counter()
    for number in range(CAPTURES):
        time.sleep(max(due_s - time.perf_counter(), 0.0))
        due_s += PERIOD_S
        captures.append(phone.capture(bodies[number % len(bodies)], fetch=False))
    return captures


def _ask(phone: LivePhone, wanted: str) -> int:
    """Begin, go on with or stop a training; wait until it is so and return its step.

    Raises:
        TimeoutError: It is not.
    """
    path = f"/api/v1/sessions/{phone.session_id}/training"
    phone.request("PUT", path, json.dumps({"state": wanted}).encode(), content="application/json")
    until_s = time.monotonic() + PATIENCE_S
    while (now := _state(phone)).state not in (wanted, "done", "failed") or not now.step:
        if time.monotonic() > until_s:
            raise TimeoutError(f"the training is {now.state} after {PATIENCE_S:.0f} s")
        time.sleep(0.2)
    return now.step


def _state(phone: LivePhone) -> wire.Training:
    answer = phone.request("GET", f"/api/v1/sessions/{phone.session_id}/training")[1]
    return msgspec.json.decode(answer, type=wire.Training)
