"""A trace of the virtual phone, recorded by /check and played in its place."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
from playwright.sync_api import BrowserContext

from e2e.virtual_phone_page import PATIENCE_MS, VirtualPhonePage, keep_picture
from live_server import LiveServer
from peaking.datasets import open_recording
from peaking.server import wire
from peaking.server.traces import PlayedTrace


class PlayedPage(VirtualPhonePage):
    """The capture page with a trace; it is stepped on until there is a picture with depth."""

    def wait_until_running(self) -> None:
        """Depth comes a few frames after the first picture, as it did on the phone."""
        for _ in range(200):
            self.until("() => window.peaking?.frames() > 0")
            self.let_pass(10)  # a step is a quick move, which hinders for a moment
            if self.page.evaluate("() => window.peaking.canShoot()"):
                return
            self.page.keyboard.press(".")
        raise AssertionError("no frame of the trace can be captured")


def recorded(context: BrowserContext, server: LiveServer, path: Path) -> Path:
    """Record the virtual phone, which goes to the right meanwhile."""
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(f"{server.address}/check?source=virtual&seconds=15", wait_until="commit")
    page.get_by_text("Pictures of the room are in it.").wait_for()
    page.get_by_text("nothing is sent").scroll_into_view_if_needed()
    keep_picture(page, "trace-before")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(f"{request.method} {request.url}"))
    page.set_viewport_size({"width": 400, "height": 600})  # the smaller, the more frames
    link = page.get_by_role("link", name="Save the trace")
    counts = page.get_by_text(
        re.compile(r"^\d+ frames, \d+ with a picture, \d+ of these with depth")
    )
    for key in "dadad":  # a machine that is busy may have no time for enough frames
        page.get_by_role("button", name="Record 15 seconds").click()
        page.get_by_text("Recording:").wait_for()
        page.keyboard.down(key)
        link.wait_for()
        page.keyboard.up(key)
        if int(re.findall(r"\d+", counts.inner_text())[2]) >= 6:
            break
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    link.scroll_into_view_if_needed()
    keep_picture(page, "trace-recorded")
    assert [one for one in sent if not one.startswith("GET ") or "/api/" in one] == []
    with page.expect_download() as download:
        link.click()
    assert download.value.suggested_filename.startswith("peaking-trace-2")
    assert download.value.suggested_filename.endswith(".zip")
    download.value.save_as(path)
    assert problems == []
    page.close()
    return path


def test_what_check_records_is_played_and_captured(
    context: BrowserContext, server: LiveServer, tmp_path: Path
) -> None:
    path = recorded(context, server, tmp_path / "trace.zip")
    assert path.stat().st_size <= wire.MAX_TRACE_BYTES
    with zipfile.ZipFile(path) as file:
        assert file.testzip() is None
        assert b"peaking demo FILE" in file.read("README.txt")
    trace = PlayedTrace(path).index.trace
    assert trace is not None
    assert "Chrome" in trace.told["browser"]
    assert {"screen", "graphics", "check"} <= trace.told.keys()
    times_ms = [frame.time_ms for frame in trace.frames]
    assert times_ms == sorted(times_ms)
    assert times_ms[-1] > 10_000
    x_m = np.array([frame.world_from_view[12] for frame in trace.frames if frame.world_from_view])
    assert np.ptp(x_m) > 0.05
    assert sum(frame.picture is not None for frame in trace.frames) > 5
    depths = [frame.depth for frame in trace.frames if frame.depth is not None]
    assert len(depths) >= 6
    assert {(d.width_px, d.height_px, d.format) for d in depths} == {(160, 90, "luminance-alpha")}

    sessions = tmp_path / "sessions-of-the-trace"
    command = ("demo", str(path), "--no-open", "--pixels", "30000")
    playing = LiveServer(sessions, command).start()
    try:
        phone = PlayedPage(context.new_page(), playing.address, query="source=replay")
        phone.shoot_and_wait()
        for _ in range(3):
            phone.page.keyboard.press(".")
        phone.shoot_and_wait()
        phone.keep_picture("trace-played")
        assert phone.states() == ["ready", "ready"]
        assert phone.problems == []
        (session,) = (log.parent for log in sessions.glob("*/log.jsonl"))
        recording = open_recording(session)
        first, second = (recording.read(i) for i in range(2))
        assert first.depth_m is not None
        assert 0.3 < np.median(first.depth_m[first.depth_m > 0]) < 5
        for captured in (first, second):
            x_of_it = captured.camera.world_from_cam.matrix()[0, 3]
            assert np.abs(x_m - x_of_it).min() < 1e-5
        assert max(first.rgb.shape) == 958  # smaller than what is made smaller
    finally:
        playing.stop()
