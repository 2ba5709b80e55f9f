"""Somebody who walks with a phone in their hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Cam, Camera, Rigid, World
from peaking.photographers.drawn.phone import tremor
from peaking.photographers.scene import look
from peaking.photographers.sensor import Shot, as_numbers, blur_px
from peaking.photographers.tasks import METRES_PER_RAD, PINHOLE, Coordinates, Task
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
        self.most_off = MOST_OFF
        self.off: Float64[np.ndarray, "5"] = np.zeros(5)
        """How far off the walk, in coordinates."""
        self.turning_per_s: Float64[np.ndarray, "5"] = np.zeros(5)
        """How fast that changes."""

    def go_on(self, seconds: float) -> None:
        """Let time pass."""
        self._walked_s += self.rate * seconds
        self.off = np.clip(self.off + self.turning_per_s * seconds, -self.most_off, self.most_off)

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

    def go_to(self, place: Rigid[World, Cam], *, follows: float, least_s: float) -> None:
        """Begin to walk and turn to a pose, no faster than on a walk.

        Args:
            place: Where.
            follows: How much of the way.
            least_s: It takes so long at least.
        """
        raw = self._walk.at(self._walked_s) + self.off
        here = self._placed(raw)
        bends = [(self._placed(raw + step) - here) / 0.01 for step in 0.01 * np.eye(5)]
        forward = place.rotation[:, 2]
        yaw_rad = np.arctan2(forward[1], forward[0]) - here[3] / METRES_PER_RAD
        yaw_rad = (yaw_rad + np.pi) % (2 * np.pi) - np.pi
        pitch_rad = np.arctan2(forward[2], np.hypot(forward[0], forward[1]))
        goal = np.array([*(place.translation_m - here[:3]), METRES_PER_RAD * yaw_rad, 0.0])
        goal[4] = METRES_PER_RAD * pitch_rad - here[4]
        step = np.linalg.lstsq(np.stack(bends, axis=1), goal, rcond=1e-3)[0]
        seconds = max(least_s, float(np.abs(goal).sum()) / self._temperament.speed_m_per_s)
        self.turning_per_s = follows * step / seconds

    def _placed(self, raw: Coordinates) -> Float64[np.ndarray, "5"]:
        """Return position, yaw and pitch, the angles in metres that they count as."""
        position_m, yaw_rad, pitch_rad = self._task.place(within(self._task, raw))
        return np.array([*position_m, METRES_PER_RAD * yaw_rad, METRES_PER_RAD * pitch_rad])

    def look_where_one_goes(self) -> None:
        """Come back to the walk."""
        self.turning_per_s = -0.4 * self.off

    def stay_off(self) -> None:
        """Go on with the walk from where one was led."""
        self.turning_per_s = np.zeros(5)

    def shot(self, number: int, time_s: float, depth_m: float) -> Shot:
        """Return this moment as the phone's camera sees it; things are about so far away."""
        camera = self.camera(time_s)
        later = self.camera(time_s, ahead_s=MOMENT_S)
        blur = blur_px(camera, later, MOMENT_S, depth_m)
        return Shot(number, time_s, as_numbers(camera), blur)
