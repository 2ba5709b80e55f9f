"""How long a frame takes in the viewer, beside the capture page and the library's own example.

Two pages take turns; the one whose turn it is not draws nothing. Each camera trembles or swings, so
every frame is another one.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from peaking.benchmarks import live_parts, view_peers
from peaking.benchmarks.browser import PATIENCE_MS, until
from peaking.benchmarks.live_phone import LivePhone, upload_body
from peaking.benchmarks.servers import demo_server
from peaking.benchmarks.view_material import Material, Told, served
from peaking.errors import ToolMissing
from peaking.export.splats import read_splats
from peaking.server.serving import CLIENT_DIR
from peaking.share.file_place import place_of_splats
from peaking.share.writing import write_place

ROUNDS = 7
SIZE_PX = {"width": 294, "height": 639}
GAUSSIANS = 300_000
SPAN_MS = 1000
LEAST_FRAMES = 10
LEAST_SPLAT_FRAMES = 4
"""They take seconds without a graphics card."""
TREMBLE_M = 0.001
SWING_M = 0.05
VIEWS = 10

_BEGIN = """() => {
  const { pinhole, worldFromCam } = viewer.inspection.camera();
  const k = { ...pinhole };
  window.bench = {
    t: 0, base: Float64Array.from(worldFromCam.rows), fov: 2 * Math.atan(k.height_px / 2 / k.fy_px),
    look: rows => viewer.inspection.lookFrom({ pinhole: k, worldFromCam: { rows } }),
  };
  return { rows: Array.from(window.bench.base), fov: window.bench.fov * 180 / Math.PI };
}"""
_BEGIN_PEER = """({ rows, fov }) => {
  window.bench = {
    t: 0, base: Float64Array.from(rows), look: moved => window.peer.look(moved, fov),
  };
}"""
_SPAN = """([span_ms, least, away_m]) => new Promise(resolve => {
  const { bench } = window;
  const gl = document.querySelector('canvas').getContext('webgl2');
  const rows = Float64Array.from(bench.base), pixel = new Uint8Array(4);
  const drawn = () => {  // reading a pixel waits for all that was asked for
    const bound = gl.getParameter(gl.READ_FRAMEBUFFER_BINDING);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, bound);
    return performance.now();
  };
  let frames = -1, start_ms = 0;  // the first frame is no other one than before
  const step = () => {
    const now_ms = drawn();
    if (frames <= 0) start_ms = now_ms;
    if (now_ms - start_ms >= span_ms && frames >= least) {
      resolve((now_ms - start_ms) / frames);
      return;
    }
    frames += 1;
    bench.t += 1;
    const aside_m = away_m * Math.sin(0.3 * bench.t);
    for (const r of [0, 4, 8]) rows[r + 3] = bench.base[r + 3] + aside_m * bench.base[r];
    bench.look(rows);
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""


def light_field_frames(browser: Any, material: Material, told: Told) -> dict[str, object]:
    """Compare the viewer with the capture page among ten of the same views, at the same size."""
    folder, _ = material.light_field
    recording = material.recording
    places = np.linspace(0, len(recording) - 1, min(VIEWS, len(recording))).astype(int)
    frames = live_parts.before_phone([recording.read(int(i)) for i in places])
    with tempfile.TemporaryDirectory() as sessions, demo_server(Path(sessions)) as address:
        told("views for the capture page")
        phone = LivePhone(address, "views")
        for frame in frames:
            phone.capture(upload_body(frame), fetch=False)
        phone.close()
        with served(folder) as static:
            viewer = _viewer(browser, f"{static}/index.html?governor=off")
            until(viewer, "() => viewer.inspection.lightField()?.settled === true")
            viewer.evaluate(_BEGIN)
            capture = _opened(
                browser, f"{address}/?source=virtual&governor=off&session={phone.session_id}"
            )
            until(capture, f"() => window.peaking?.views().length === {len(frames)}")
            until(capture, "() => window.peaking.seen()?.viewIds.length === 4")
            capture.evaluate(live_parts.TREMBLE)
            took_ms = _in_turn(
                {
                    "light_field": lambda: _span_ms(viewer, TREMBLE_M, LEAST_FRAMES),
                    "capture": lambda: _capture_ms(capture, "all"),
                    "capture_bare": lambda: _capture_ms(capture, "bare"),
                },
                told,
            )
            sizes = {
                "viewer": viewer.evaluate(
                    "(({ width, height }) => [width, height])(viewer.inspection.lightField())"
                ),
                "capture": capture.evaluate("window.peaking.pace().pixels"),
            }
    return {
        **{f"{name}_frame_ms": _median(times) for name, times in took_ms.items()},
        "light_field_over_capture": _ratios(took_ms["light_field"], took_ms["capture"]),
        "light_field_over_capture_bare": _ratios(took_ms["light_field"], took_ms["capture_bare"]),
        "rendered_px": sizes,
        "rounds": ROUNDS,
    }


def splat_frames(browser: Any, material: Material, told: Told) -> dict[str, object]:
    """Compare the viewer with the library's own example: one file, one camera path, one size."""
    told(f"{GAUSSIANS:,} Gaussians")
    path = material.many_gaussians(GAUSSIANS, seed=0)
    folder = material.folder / "many"
    write_place(place_of_splats(path, read_splats(path))[0], folder, CLIENT_DIR)
    try:
        peer_folder = view_peers.library_example(material.folder / "example", path)
    except ToolMissing as error:
        return {"peers": {"library_example": f"not installed: {error}"}}
    with served(folder) as ours_at, served(peer_folder) as peer_at:
        viewer = _viewer(browser, f"{ours_at}/index.html")
        until(
            viewer, f"() => viewer.inspection.count() === {GAUSSIANS} && viewer.inspection.asleep"
        )
        camera = viewer.evaluate(_BEGIN)
        peer = _opened(browser, f"{peer_at}/index.html")
        until(peer, "() => window.peer?.ready === true")
        peer.evaluate(_BEGIN_PEER, camera)
        peer.evaluate("window.peer.run(false)")
        took_ms = _in_turn(
            {
                "splat": lambda: _span_ms(viewer, SWING_M, LEAST_SPLAT_FRAMES),
                "example": lambda: _peer_ms(peer),
            },
            told,
        )
        sizes = [
            page.evaluate(
                "(({ width, height }) => [width, height])(document.querySelector('canvas'))"
            )
            for page in (viewer, peer)
        ]
    return {
        "gaussians": GAUSSIANS,
        **{f"{name}_frame_ms": _median(times) for name, times in took_ms.items()},
        "splat_over_example": _ratios(took_ms["splat"], took_ms["example"]),
        "canvas_px": sizes,
        "rounds": ROUNDS,
    }


def _in_turn(measures: Mapping[str, Callable[[], float]], told: Told) -> dict[str, np.ndarray]:
    """Return what each measured, round by round; every other round in the opposite order."""
    took_ms: dict[str, list[float]] = {name: [] for name in measures}
    for number in range(ROUNDS + 1):
        for name in list(measures)[:: 1 if number % 2 == 0 else -1]:
            told(f"frames of {name}: round {number} of {ROUNDS}")
            took_ms[name].append(measures[name]())
    return {name: np.array(times[1:]) for name, times in took_ms.items()}  # the first warms up


def _span_ms(page: Any, away_m: float, least: int) -> float:
    page.bring_to_front()
    took_ms = page.evaluate(_SPAN, [SPAN_MS, least, away_m])
    until(page, "() => window.viewer === undefined || viewer.inspection.asleep")
    return took_ms


def _peer_ms(page: Any) -> float:
    page.evaluate("window.peer.run(true)")
    took_ms = _span_ms(page, SWING_M, LEAST_SPLAT_FRAMES)
    page.evaluate("window.peer.run(false)")
    return took_ms


def _capture_ms(page: Any, part: str) -> float:
    page.bring_to_front()
    page.evaluate(live_parts.ALLOW, part)
    page.evaluate("window.phoneRests = false")
    live_parts.let_pass(page, live_parts.SETTLING_FRAMES)
    took_ms = live_parts.frame_ms(page)
    page.evaluate("window.phoneRests = true")
    live_parts.let_pass(page, live_parts.SETTLING_FRAMES)
    return took_ms


def _viewer(browser: Any, address: str) -> Any:
    page = _opened(browser, address)
    until(page, "() => window.viewer?.inspection.shown != null")
    return page


def _opened(browser: Any, address: str) -> Any:
    page = browser.new_context(viewport=SIZE_PX).new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address, wait_until="commit")
    return page


def _ratios(ours: np.ndarray, theirs: np.ndarray) -> dict[str, float]:
    """Return the median of the rounds' ratios, and their range."""
    ratios = ours / theirs
    return {
        "median": _median(ratios),
        "least": round(float(ratios.min()), 2),
        "most": round(float(ratios.max()), 2),
    }


def _median(values: np.ndarray) -> float:
    return round(float(np.median(values)), 2)
