"""What a test does with the capture page: hold a pose, shoot, read what is red."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from patience import PATIENCE_S

PATIENCE_MS = 1e3 * PATIENCE_S
ARTEFACTS = Path(__file__).parents[2] / "out" / "e2e"

START = (1, 0, 0, 0, 0, -1, 0, 1.35, 0, 0, -1, 1.1)
"""world_from_cam where the photographer begins, OpenCV axes: 1.35 m high, looking along -z."""


def moved(x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> list[float]:
    """Return the first pose, moved in the world (x right, y up, z towards the photographer)."""
    pose = [float(v) for v in START]
    pose[3] += x_m
    pose[7] += y_m
    pose[11] += z_m
    return pose


def keep_picture(page: Page, name: str) -> None:
    """Keep a screenshot for people to look at, in out/e2e."""
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=ARTEFACTS / f"{name}.png")


class VirtualPhonePage:
    """The capture page with the virtual phone, in a real browser.

    Without a graphics card every page is slow, so nothing gives way unless that is what is tested.
    """

    def __init__(
        self,
        page: Page,
        address: str,
        *,
        query: str = "source=virtual",
        governor: str = "off",
        running: bool = True,
    ) -> None:
        self.page = page
        self.problems: list[str] = []
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{address}/?governor={governor}&{query}", wait_until="commit")
        if running:
            self.wait_until_running()

    def wait_until_running(self) -> None:
        """Wait for pictures with depth: ARCore's depth is late, and so is the virtual phone's."""
        self.until("() => window.peaking?.canShoot() === true")

    def until(self, holds: str, argument: object = None) -> None:
        """Wait until a function of the page returns true (its CSP forbids playwright's own way)."""
        self.wait_for(lambda: self.page.evaluate(holds, argument) is True)

    def hold(self, pose: Sequence[float]) -> None:
        """Put the phone somewhere, and wait until it has been seen from there."""
        self.page.evaluate("pose => window.peaking.phone.setPose(pose)", list(pose))
        self.let_pass(6)

    def let_pass(self, frames: int) -> None:
        """Wait for so many frames more."""
        before = self.page.evaluate("window.peaking.frames()")
        self.until("wanted => window.peaking.frames() >= wanted", before + frames)

    def shoot(self) -> str:
        """Press the shutter's key; return the new view's id when the phone holds the capture."""
        before = {view["id"] for view in self.views()}
        self.wait_until_running()
        self.page.keyboard.press("Space")
        self.wait_for(lambda: len(self.views()) > len(before))
        return next(view["id"] for view in self.views() if view["id"] not in before)

    def shoot_and_wait(self) -> str:
        """Press the shutter and wait until the new MPI takes part in the picture."""
        view_id = self.shoot()
        self.until(
            "id => window.peaking.timeline().some(c => c.id === id && c.times.drawn !== undefined)",
            view_id,
        )
        self.let_pass(6)
        return view_id

    def peaked_share(self) -> float:
        """Return the peaked share of the pose that is held."""
        self.let_pass(4)
        share = self.page.evaluate("window.peaking.seen()?.peakedShare ?? null")
        assert share is not None
        return float(share)

    def views(self) -> list[dict[str, Any]]:
        """Return id, number and state of every view, in order."""
        return self.page.evaluate("window.peaking.views()")

    def states(self) -> list[str]:
        """Return the state of every view, in order."""
        return [view["state"] for view in self.views()]

    def wait_for(self, holds: Callable[[], bool], *, seconds: float = PATIENCE_S) -> None:
        """Wait until something holds."""
        until = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < until, f"waited {seconds} s; {self.problems}"
            self.page.wait_for_timeout(100)

    def keep_picture(self, name: str) -> None:
        """Keep a screenshot for people to look at."""
        keep_picture(self.page, name)
