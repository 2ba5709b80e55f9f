"""The automatic shutter, as on the capture page.

`web/src/capture/auto_shutter.ts` and `web/src/motion.ts` decide; a test holds the numbers here to
those there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from peaking.geometry import Camera
from peaking.selection.auto_shutter import WORTH_SHARE

LASTS_MS, PAUSE_MS, PATIENCE_MS = 250, 700, 3000
TOO_FAST_M_PER_S, TOO_FAST_RAD_PER_S = 0.8, 1.2
STEADY_M_PER_S, STEADY_RAD_PER_S = 0.27, 0.4
SMOOTHING_MS = 150


class Motion:
    """How fast the camera moves."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._last: tuple[float, Camera] | None = None
        self._m_per_s = 0.0
        self._rad_per_s = 0.0

    def update(self, time_ms: float, camera: Camera) -> None:
        """Tell where the camera is."""
        if self._last is not None and time_ms > self._last[0]:
            step_ms = time_ms - self._last[0]
            keep = math.exp(-step_ms / SMOOTHING_MS)
            before = self._last[1]
            moved_m = float(np.linalg.norm(camera.position_m - before.position_m))
            turn = before.world_from_cam.rotation.T @ camera.world_from_cam.rotation
            turned = math.acos(min(1.0, max(-1.0, (float(np.trace(turn)) - 1) / 2)))
            self._m_per_s = keep * self._m_per_s + (1 - keep) * moved_m / step_ms * 1e3
            self._rad_per_s = keep * self._rad_per_s + (1 - keep) * turned / step_ms * 1e3
        self._last = (time_ms, camera)

    @property
    def steady(self) -> bool:
        """Slow enough for a picture that nobody asked for."""
        return self._m_per_s <= STEADY_M_PER_S and self._rad_per_s <= STEADY_RAD_PER_S

    @property
    def too_fast(self) -> bool:
        """Too fast for any picture."""
        return self._m_per_s > TOO_FAST_M_PER_S or self._rad_per_s > TOO_FAST_RAD_PER_S


@dataclass(frozen=True)
class AutoMoment:
    """What it goes by: see `AutoMoment` of the page."""

    time_ms: float
    can_shoot: bool
    steady: bool
    views: int
    ready: int
    peaked_share: float | None


class AutoShutter:
    """Takes a view when the phone is steady and what is captured lacks what it sees."""

    def __init__(self) -> None:
        """Begin without a view.

        `asks_to_hold_still`: it would take a view, but the phone moves too much.
        """
        self._taken_at_ms = -math.inf
        self._worth_since_ms: float | None = None
        self.asks_to_hold_still = False

    def look(self, now: AutoMoment) -> bool:
        """Look at a frame; True: take a view now."""
        if not self._is_worth_it(now):
            self._worth_since_ms = None
            return False
        if self._worth_since_ms is None:
            self._worth_since_ms = now.time_ms
        if now.time_ms - self._worth_since_ms < LASTS_MS:
            return False
        if now.time_ms - self._taken_at_ms < PAUSE_MS:
            return False
        self._taken_at_ms = now.time_ms
        self._worth_since_ms = None
        return True

    def _is_worth_it(self, now: AutoMoment) -> bool:
        self.asks_to_hold_still = False
        if now.views == 0 or not now.can_shoot:
            return False
        if now.ready < now.views and now.time_ms - self._taken_at_ms < PATIENCE_MS:
            return False
        share = now.peaked_share
        if share is None or share < WORTH_SHARE:
            return False
        self.asks_to_hold_still = not now.steady
        return now.steady
