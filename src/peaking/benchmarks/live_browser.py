"""Time the client in headless Chromium: from the shutter to the first frame with the new MPI."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from peaking.benchmarks import live_parts
from peaking.benchmarks.browser import PATIENCE_MS, chromium, heap_bytes, until
from peaking.frame import Frame

CAPTURES = 12
BACK_M = 0.3
"""From here the views leave something empty, so that there is something to fill."""
_QUERY = "source=virtual&governor=off"
_DRAWN = "window.peaking.timeline().filter(c => c.times.drawn !== undefined).length"
_INSTEAD = "leave the browser out with --no-browser"


def run(address: str, frames: Sequence[Frame]) -> dict[str, object]:
    """Shoot with the virtual phone of a running server.

    Args:
        address: Of the server.
        frames: At least ten, with depth, for sessions of 10 and of 300 views.

    Raises:
        BackendUnavailable: playwright is not installed.
        ToolMissing: There is no Chromium.
    """
    with chromium(_INSTEAD) as browser:
        page = browser.new_page(viewport={"width": 800, "height": 720})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{address}/?{_QUERY}", wait_until="commit")
        until(page, "() => window.peaking?.canShoot() === true")
        begin_heap = heap_bytes(page)
        aligned_ms: list[float] = []
        for number in range(CAPTURES):
            angle = 2 * np.pi * number / CAPTURES
            page.evaluate("p => window.peaking.phone.setPose(p)", _pose(angle))
            _frames(page, 4)
            until(page, "() => window.peaking.canShoot() === true")
            page.keyboard.press("Space")
            until(page, f"() => ({_DRAWN}) > {number}")
            took_ms = page.evaluate("window.peaking.tracking().took_ms")
            aligned_ms += [] if took_ms is None else [took_ms]
        tracking = page.evaluate("window.peaking.tracking()")
        timeline = page.evaluate("window.peaking.timeline()")
        resident = page.evaluate("window.peaking.resident()")
        frames_ms = _frame_time_ms(page)
        full_heap = heap_bytes(page)
        page.evaluate("p => window.peaking.phone.setPose(p)", _pose(0.8, back_m=BACK_M))
        parts = live_parts.frame_parts(page)
        while page.evaluate("window.peaking.views().length") > 1:
            before = page.evaluate("window.peaking.views().length")
            page.keyboard.press("z")
            until(page, f"() => window.peaking.views().length < {before}")
        _frames(page, 8)
        after = page.evaluate("window.peaking.resident()")
        undone_heap = heap_bytes(page)
        page.close()
        many_over_few = _many_over_few(browser, address, frames)
    return _summary(timeline) | {
        "frame_ms_median": frames_ms,
        "align": {
            "worker_ms_median": round(float(np.median(aligned_ms)), 1) if aligned_ms else None,
            "succeeded": tracking["succeeded"],
            "failed": tracking["failed"],
        },
        "frame_parts": parts,
        "frame_of_300_views": many_over_few,
        "client_bytes_per_view": round(
            resident["bytes"] / max(resident["views"], 1)
            + max(full_heap - begin_heap, 0) / CAPTURES
        ),
        "client_gpu_bytes_per_view": round(resident["bytes"] / max(resident["views"], 1)),
        "client_bytes_after_undo": {
            "views_left": 1,
            "gpu": after["bytes"],
            "heap_grown": undone_heap - begin_heap,
        },
    }


def _summary(timeline: Sequence[Mapping[str, Any]]) -> dict[str, object]:
    """Return the medians of the whole and of each step, milliseconds."""
    times = [capture["times"] for capture in timeline]
    names = list(times[0])
    ordered = sorted(names, key=lambda name: float(np.median([t[name] for t in times])))
    steps = {
        f"{before}_to_{after}": round(float(np.median([t[after] - t[before] for t in times])), 1)
        for before, after in itertools.pairwise(ordered)
    }
    whole = [t["drawn"] - t["shutter"] for t in times]
    return {
        "capture_to_drawn_p50_ms": round(float(np.median(whole)), 1),
        "capture_to_drawn_p95_ms": round(float(np.percentile(whole, 95)), 1),
        "steps_ms": steps,
    }


def _many_over_few(browser: Any, address: str, frames: Sequence[Frame]) -> dict[str, object]:
    pages: dict[int, Any] = {}
    for count, session in live_parts.long_sessions(address, frames).items():
        page = browser.new_page(viewport={"width": 800, "height": 720})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{address}/?{_QUERY}&session={session}", wait_until="commit")
        until(page, f"() => window.peaking?.views().length === {count}")
        page.evaluate("p => window.peaking.phone.setPose(p)", _pose(0.0, radius_m=0.0))
        until(page, "() => window.peaking.seen()?.viewIds.length === 4")
        _frames(page, 12)  # until what fills is on the card too
        pages[count] = page
    return live_parts.many_over_few(pages)


def _pose(angle: float, *, radius_m: float = 0.25, back_m: float = 0.0) -> list[float]:
    x_m, y_m = radius_m * float(np.cos(angle)), 1.35 + 0.6 * radius_m * float(np.sin(angle))
    return [1.0, 0.0, 0.0, x_m, 0.0, -1.0, 0.0, y_m, 0.0, 0.0, -1.0, 1.1 + back_m]


def _frames(page: Any, count: int) -> None:
    before = page.evaluate("window.peaking.frames()")
    until(page, f"() => window.peaking.frames() >= {before + count}")


def _frame_time_ms(page: Any) -> float:
    before, begin_ms = page.evaluate("[window.peaking.frames(), performance.now()]")
    page.wait_for_timeout(4000)
    after, end_ms = page.evaluate("[window.peaking.frames(), performance.now()]")
    return round((end_ms - begin_ms) / max(after - before, 1), 1)
