"""Whether memory stays flat while one walks in a light field."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from peaking.benchmarks.browser import PATIENCE_MS, heap_bytes, until
from peaking.benchmarks.view_material import Material, Told, served

SIZE_PX = {"width": 294, "height": 639}
KEYS = ("KeyW", "KeyS", "KeyA", "KeyD", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown")
HELD_MS = 700
SAMPLE_S = 5.0
SETTLING_SHARE = 0.2
"""Of the time: what is made once is made by then."""
MB = 1e6


def memory(
    browser: Any, material: Material, walk_s: float, seed: int, told: Told
) -> dict[str, object]:
    """Walk with keys that are drawn by chance; return how memory grew after the first fifth."""
    folder, _ = material.light_field
    random = np.random.default_rng(seed)
    times_s: list[float] = []
    samples: list[dict[str, float]] = []
    with served(folder) as address:
        page = browser.new_context(viewport=SIZE_PX).new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{address}/index.html", wait_until="commit")
        until(page, "() => window.viewer?.inspection.firstPicture_ms != null")
        session = browser.new_browser_cdp_session()
        begin_s = time.perf_counter()
        while (now_s := time.perf_counter() - begin_s) < walk_s:
            if not times_s or now_s - times_s[-1] >= SAMPLE_S:
                told(f"walking for {now_s:.0f} of {walk_s:.0f} s")
                times_s.append(now_s)
                samples.append(_sample(page, session))
            key = str(random.choice(KEYS))
            page.keyboard.down(key)
            page.wait_for_timeout(HELD_MS)
            page.keyboard.up(key)
        times_s.append(time.perf_counter() - begin_s)
        samples.append(_sample(page, session))
        frames = page.evaluate("viewer.inspection.frames")
        page.context.close()
    document: dict[str, object] = {"walked_s": round(times_s[-1], 1), "frames": frames}
    for name in samples[0]:
        values = [sample[name] for sample in samples]
        document[name] = {
            "first": round(values[0], 2),
            "most": round(max(values), 2),
            "last": round(values[-1], 2),
            "per_minute": round(slope_per_minute(times_s, values), 3),
        }
    return document


def slope_per_minute(times_s: Sequence[float], values: Sequence[float]) -> float:
    """Return how fast values grow, by a line through those after the first fifth of the time.

    Raises:
        ValueError: There are fewer than two of them.
    """
    late = [i for i, at_s in enumerate(times_s) if at_s >= SETTLING_SHARE * times_s[-1]]
    if len(late) < 2:
        raise ValueError(f"need at least 2 values after the first fifth, got {len(late)}")
    minutes = np.array([times_s[i] / 60 for i in late])
    return float(np.polyfit(minutes, [values[i] for i in late], 1)[0])


def _sample(page: Any, session: Any) -> dict[str, float]:
    """Return megabytes: of the page's scripts, of MPIs on the card, and of all processes."""
    processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
    return {
        "heap_mb": heap_bytes(page) / MB,
        "mpis_mb": page.evaluate("viewer.inspection.resident().bytes") / MB,
        "browser_mb": sum(_resident_bytes(int(one["id"])) for one in processes) / MB,
    }


def _resident_bytes(process: int) -> int:
    """Return the memory of a process; 0 where the system does not say, or it is gone."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmRSS")), 0)
