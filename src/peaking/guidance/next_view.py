"""The one pose that a photographer is sent to next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from peaking.geometry import Camera
from peaking.guidance.completeness import Scored
from peaking.guidance.foresight import Foresight
from peaking.guidance.virtual_cameras import VirtualCamera

MIN_HELP = 0.06
"""A view that mends less of its picture is not worth a walk."""

MOST_NEW = 0.6
"""Where the photographer was not, nobody is sent into what is newer than this."""

BETTER = 1.3
"""So many times as much has another pose to help, or the suggestion stays."""

MENDS_STEPS, MENDS_RAD = 2.0, math.radians(35)
"""What a view mends in other pictures falls to nothing at this distance, and at this angle."""

OWN = 0.03
"""What a view mends in its own picture, which the score is not of, counts so much …"""

TURNED = 0.4
"""… and so much of that to the side of all pictures: there is no end to it."""

NEAR_STEPS, NEAR_RAD = 2.0, math.radians(35)
"""Two places are one where they are this close, and look this much the same way."""

FAR_STEPS = 8.0
"""Half as much is it worth to walk so far."""


@dataclass(frozen=True)
class Suggestion:
    """A pose to take a view from.

    Attributes:
        virtual: It.
        foresight: What is foreseen there.
        gain: What ranks it.
    """

    virtual: VirtualCamera
    foresight: Foresight
    gain: float

    @property
    def camera(self) -> Camera:
        """Where to take it from."""
        return self.virtual.camera

    @property
    def reason(self) -> str:
        """Why, in plain words."""
        foreseen = self.foresight
        if foreseen.new >= foreseen.wrong:
            return f"new: {_side(foreseen.towards)}"
        if 2 * foreseen.one_side > foreseen.wrong:
            return "wrong: seen from one side only"
        return "wrong: your views differ there"


def suggestions(
    virtual: Sequence[VirtualCamera],
    foreseen: Sequence[Foresight],
    pictures: Sequence[Scored],
    *,
    step_m: float,
    here: Camera | None = None,
) -> list[Suggestion]:
    """Return the poses from which a view helps, the best first.

    Args:
        virtual: Poses.
        foreseen: What is foreseen at each.
        pictures: What the score is of: a view is worth what it mends of it.
        step_m: Length of a step.
        here: Where the photographer is, if that is known: far poses are worth less.
    """
    if not virtual:
        return []
    weights = np.array([each.weight for each in pictures])
    missing = np.array([each.missing for each in pictures]) * weights / max(weights.sum(), 1e-9)
    positions_m = np.array([each.camera.position_m for each in pictures]).reshape(-1, 3)
    forward = np.array([each.camera.forward for each in pictures]).reshape(-1, 3)
    found: list[Suggestion] = []
    for pose, foresight in zip(virtual, foreseen, strict=True):
        too_new = foresight.new > MOST_NEW and not pose.walked
        if foresight.help < MIN_HELP or too_new:
            continue
        away = np.linalg.norm(positions_m - pose.camera.position_m, axis=1) / step_m
        turned = np.arccos(np.clip(forward @ pose.camera.forward, -1.0, 1.0))
        mends = np.clip(1 - away / MENDS_STEPS, 0, 1) * np.clip(1 - turned / MENDS_RAD, 0, 1)
        own = OWN * foresight.help * (TURNED if pose.turned else 1.0)
        gain = float(mends @ missing) + own
        if here is not None:
            walk_m = float(np.linalg.norm(here.position_m - pose.camera.position_m))
            gain /= 1 + walk_m / (FAR_STEPS * step_m)
        found.append(Suggestion(pose, foresight, gain))
    return sorted(found, key=lambda suggestion: -suggestion.gain)


def keep_or_change(before: Suggestion | None, found: Sequence[Suggestion]) -> Suggestion | None:
    """Return what to suggest now: what was, as long as it helps and nothing helps much more.

    Args:
        before: What was suggested last.
        found: What could be now, the best first.
    """
    if not found:
        return None
    for same in found:
        if before is not None and _same(same.camera, before.camera):
            return same if BETTER * same.gain >= found[0].gain else found[0]
    return found[0]


def apart(found: Sequence[Suggestion], count: int, *, step_m: float) -> list[Suggestion]:
    """Return so many of the suggestions that are about different places, at most."""
    kept: list[Suggestion] = []
    for suggestion in found:
        if len(kept) < count and not any(_near(suggestion, k, step_m) for k in kept):
            kept.append(suggestion)
    return kept


def _near(a: Suggestion, b: Suggestion, step_m: float) -> bool:
    away_m = float(np.linalg.norm(a.camera.position_m - b.camera.position_m))
    turned = math.acos(min(max(float(a.camera.forward @ b.camera.forward), -1.0), 1.0))
    return away_m < NEAR_STEPS * step_m and turned < NEAR_RAD


def _same(a: Camera, b: Camera) -> bool:
    here, there = a.world_from_cam, b.world_from_cam
    return bool(
        np.allclose(here.translation_m, there.translation_m)
        and np.allclose(here.rotation, there.rotation)
    )


def _side(towards: tuple[float, float]) -> str:
    x, y = towards
    if max(abs(x), abs(y)) < 0.25:
        return "what is hidden from your views"
    if abs(x) >= abs(y):
        return "on the right" if x > 0 else "on the left"
    return "below" if y > 0 else "above"
