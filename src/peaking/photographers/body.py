"""Somebody who walks with a phone in their hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera
from peaking.photographers.drawn.phone import tremor
from peaking.photographers.scene import look
from peaking.photographers.sensor import Shot, as_numbers, blur_px
from peaking.photographers.tasks import PINHOLE, Task
from peaking.photographers.temperaments import Temperament
from peaking.photographers.walks import Walk, within

TREMOR_HZ = 15.0
"""What `tremor` counts its frames by."""

MOMENT_S = 0.02
"""Speeds are measured over it."""

MOST_OFF = 0.35
"""How far from the walk somebody lets themselves be led, in coordinates."""


class Body:
    """Where the phone is. It follows a walk, slower or faster, and is led off it a little."""

    def __init__(self, task: Task, temperament: Temperament, walk: Walk, seed: Sequence[int]):
        """Stand at the beginning of the walk."""
        self._task, self._temperament, self._walk = task, temperament, walk
        self._tremor_seed = int(np.random.default_rng((*seed, 3)).integers(1 << 30))
        self._walked_s = 0.0
        self.rate = 1.0
        """How fast the walk is walked: 1 as it was drawn, 0 not at all."""
        self.off: Float64[np.ndarray, "5"] = np.zeros(5)
        """How far off the walk, in coordinates."""
        self.turning_per_s: Float64[np.ndarray, "5"] = np.zeros(5)
        """How fast that changes."""

    def go_on(self, seconds: float) -> None:
        """Let time pass."""
        self._walked_s += self.rate * seconds
        self.off = np.clip(self.off + self.turning_per_s * seconds, -MOST_OFF, MOST_OFF)

    def camera(self, time_s: float, *, ahead_s: float = 0.0) -> Camera:
        """Return where the camera truly is, now or a moment ahead."""
        off = self.off + self.turning_per_s * ahead_s
        at = within(self._task, self._walk.at(self._walked_s + self.rate * ahead_s) + off)
        position_m, yaw_rad, pitch_rad = self._task.place(at)
        shake = tremor(TREMOR_HZ * (time_s + ahead_s), self._tremor_seed)
        turned = self._temperament.tremor_rad * shake[3:]
        return look(
            PINHOLE,
            position_m + self._temperament.tremor_m * shake[:3],
            yaw_rad + float(turned[0]),
            pitch_rad + float(turned[1]),
            float(turned[2]),
        )

    def turn_towards(self, yaw_rad: float, pitch_rad: float, *, within_s: float) -> None:
        """Begin to turn so that one has turned by these angles after so many seconds."""
        at = within(self._task, self._walk.at(self._walked_s) + self.off)
        self.turning_per_s = np.zeros(5)
        for axis, angle_rad in ((3, yaw_rad), (4, pitch_rad)):
            step = np.zeros(5)
            step[axis] = 0.01
            here, there = self._task.place(at), self._task.place(at + step)
            rad_per_unit = (there[axis - 2] - here[axis - 2]) / 0.01
            if abs(rad_per_unit) > 1e-6:
                self.turning_per_s[axis] = angle_rad / rad_per_unit / within_s

    def look_where_one_goes(self) -> None:
        """Come back to the walk."""
        self.turning_per_s = -0.4 * self.off

    def shot(self, number: int, time_s: float, depth_m: float) -> Shot:
        """Return this moment as the phone's camera sees it; things are about so far away."""
        camera = self.camera(time_s)
        later = self.camera(time_s, ahead_s=MOMENT_S)
        blur = blur_px(camera, later, MOMENT_S, depth_m)
        return Shot(number, time_s, as_numbers(camera), blur)
