"""What each part of a frame costs in the client: one page draws with it and without it, in turn.

The phone's numbers tremble while its picture stands still, so every view is rendered and compared
again at every frame, and the drawn room is not. The memory looks at new pictures alone, so for it
the phone trembles itself; what it costs is the difference to the same without it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from peaking.benchmarks.live_phone import LivePhone, upload_body
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World

ROUNDS = 7
SPAN_MS = 1000
SPAN_FRAMES = 10
SETTLING_FRAMES = 15
"""What fills is chosen every sixth frame, and read back later."""
PATIENCE_S = 120.0
FEW, MANY = 10, 300
"""Views of the two sessions that are compared."""
FAR_M = 50.0
"""The views of the long session that are never among the nearest are so far away."""

TREMBLE = """() => {
  let t = 0;
  const step = () => {
    t += 1;
    const { phone } = window.peaking;
    if (window.phoneRests) phone.setDrift(0, 0, 0, 0);
    else if (window.phoneTrembles) phone.pose.x_m += 0.001 * (t % 2 === 0 ? 1 : -1);
    else phone.setDrift(0.001 * Math.sin(t), 0.001 * Math.cos(t), 0, 0);
    requestAnimationFrame(step);
  };
  step();
}"""
ALLOW = """part => {
  const bare = {
    pixels: 1, blended: Infinity, filling: 0, alignEvery_ms: Infinity, rememberEvery: Infinity,
  };
  const parts = {
    fill: { filling: Infinity }, align: { alignEvery_ms: 60 }, memory: { rememberEvery: 3 },
  };
  window.phoneTrembles = part === 'memory' || part === 'new_picture';
  window.peaking.allow({ ...bare, ...parts[part] });
}"""
PARTS = ("bare", "fill", "align", "new_picture", "memory")


def frame_parts(page: Any) -> dict[str, object]:
    """Measure a page of the virtual phone whose views leave something empty where it is held.

    The page must have been opened with `governor=off`. Times are medians over rounds; `over_bare`
    are medians of each round's ratio, of the memory what it adds alone.
    """
    page.evaluate(TREMBLE)
    took_ms: dict[str, list[float]] = {part: [] for part in PARTS}
    worker_ms: list[float] = []
    filling: list[int] = []
    for _ in range(ROUNDS):
        for part, times in took_ms.items():
            page.evaluate(ALLOW, part)
            let_pass(page, SETTLING_FRAMES)
            times.append(frame_ms(page))
            if part == "fill":
                filling.append(page.evaluate("window.peaking.pace().filling"))
            if part == "align":
                worker_ms.append(page.evaluate("window.peaking.tracking().took_ms") or np.nan)
    bare, fill, align, new_picture, memory = (np.array(took_ms[part]) for part in PARTS)
    over_bare = {
        "fill": fill / bare,
        "align": align / bare,
        "memory_adds": (memory - new_picture) / bare,
    }
    return {
        "size": page.evaluate("window.peaking.pace().pixels"),
        "rounds": ROUNDS,
        "frame_ms": {part: round(float(np.median(times)), 1) for part, times in took_ms.items()},
        "over_bare": {
            part: round(float(np.median(ratios)), 2) for part, ratios in over_bare.items()
        },
        "filling_views": float(np.median(filling)),
        "align_worker_ms": round(float(np.nanmedian(worker_ms)), 1),
    }


def frame_ms(page: Any) -> float:
    """Return the mean time from frame to frame, milliseconds, over a second and ten frames."""
    before, begin_ms = page.evaluate("[window.peaking.frames(), performance.now()]")
    page.wait_for_timeout(SPAN_MS)
    let_pass(page, max(0, SPAN_FRAMES - (page.evaluate("window.peaking.frames()") - before)))
    after, end_ms = page.evaluate("[window.peaking.frames(), performance.now()]")
    return (end_ms - begin_ms) / (after - before)


def let_pass(page: Any, frames: int) -> None:
    """Wait until so many frames more are drawn.

    Raises:
        TimeoutError: They are not.
    """
    wanted = page.evaluate("window.peaking.frames()") + frames
    until_s = time.monotonic() + PATIENCE_S
    while page.evaluate("window.peaking.frames()") < wanted:
        if time.monotonic() > until_s:
            raise TimeoutError(f"waited {PATIENCE_S:.0f} s for {frames} frames")
        page.wait_for_timeout(20)


def long_sessions(address: str, frames: Sequence[Frame]) -> dict[int, str]:
    """Upload a session of 10 views and one of 300, which has 290 more, far away; return their ids.

    Args:
        address: Of the server.
        frames: At least ten, with depth. The first is put where the virtual phone begins.
    """
    sessions: dict[int, str] = {}
    near = before_phone(frames[:FEW])
    for count in (FEW, MANY):
        phone = LivePhone(address, f"{count} views")
        far = [_moved(near[k % len(near)], k) for k in range(count - len(near))]
        for frame in (*near, *far):
            phone.capture(upload_body(frame), fetch=False)
        phone.close()
        sessions[count] = phone.session_id
    return sessions


def before_phone(frames: Sequence[Frame]) -> list[Frame]:
    """Return frames in a world in which the first stands where the virtual phone begins."""
    turned: Rigid[World, Cam] = Rigid(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    room_from_world = turned @ frames[0].camera.world_from_cam.inverse()
    return [
        replace(f, camera=Camera(f.camera.pinhole, room_from_world @ f.camera.world_from_cam))
        for f in frames
    ]


def many_over_few(pages: Mapping[int, Any]) -> dict[str, object]:
    """Compare frames among 300 views with frames among 10, in turn, of the same nearest views.

    Args:
        pages: By number of views, opened with `governor=off`; what they show is on the card.
    """
    for page in pages.values():
        page.evaluate(TREMBLE)
    took_ms: dict[int, list[float]] = {count: [] for count in pages}
    for _ in range(ROUNDS):
        for count, page in pages.items():
            for other in pages.values():  # a page in the background draws too
                other.evaluate("rests => { window.phoneRests = rests; }", other is not page)
            page.bring_to_front()
            let_pass(page, SETTLING_FRAMES)
            took_ms[count].append(frame_ms(page))
    return {
        **{f"{count}_ms": round(float(np.median(times)), 1) for count, times in took_ms.items()},
        "ratio": round(float(np.median(np.divide(took_ms[MANY], took_ms[FEW]))), 2),
    }


def _moved(frame: Frame, number: int) -> Frame:
    camera = frame.camera
    away_m = np.array([FAR_M, 0.3 * (number // 20), 0.3 * (number % 20)])
    pose: Rigid[World, Cam] = Rigid(camera.world_from_cam.rotation, camera.position_m + away_m)
    return replace(frame, camera=Camera(camera.pinhole, pose))
