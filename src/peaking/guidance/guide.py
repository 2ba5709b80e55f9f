"""What every guide is: targets in the room, and when one counts as taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Cam, Camera, Rigid, World


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How near a view must be to a target to take it."""

    position_m: float
    """Largest distance of the two centres of projection."""
    direction_rad: float = math.radians(10)
    """Largest angle between the two viewing directions; a turn about them does not count."""

    def __post_init__(self) -> None:
        for name in ("position_m", "direction_rad"):
            number = getattr(self, name)
            if not (math.isfinite(number) and number > 0):
                raise ValueError(f"need a finite {name} > 0, got {number}")


@dataclass(frozen=True)
class Guide:
    """Where views are wanted. It is fixed when the session starts.

    Made by `plenoptic_grid`, `plane_stack` and `hemisphere`.
    """

    targets: tuple[Rigid[World, Cam], ...]
    """The poses to take views from, in the order in which they are counted."""
    near_enough: Tolerance
    """How near a view must be to take a target."""

    def __post_init__(self) -> None:
        if not self.targets:
            raise ValueError("need at least 1 target, got none")


@dataclass(frozen=True)
class GuideProgress:
    """What has been taken."""

    taken_by: tuple[int | None, ...]
    """For each target the view that took it, or None while it is open."""

    @property
    def num_targets(self) -> int:
        """How many targets there are."""
        return len(self.taken_by)

    @property
    def num_taken(self) -> int:
        """How many of them are taken."""
        return sum(view is not None for view in self.taken_by)

    @property
    def open(self) -> tuple[int, ...]:
        """The targets that are still to be taken."""
        return tuple(i for i, view in enumerate(self.taken_by) if view is None)


def progress(guide: Guide, views: Sequence[Camera]) -> GuideProgress:
    """Say which targets the captured views have taken.

    View by view, in the order of capture: each takes the nearest target within the tolerance that
    is still open (of equally near ones the first), and no other. So a view that is added opens
    nothing again, and after an undo the answer is the one for the views that are left.
    """
    taken_by: list[int | None] = [None] * len(guide.targets)
    for index, view in enumerate(views):
        target = within_reach(guide, view, taken_by)
        if target is not None:
            taken_by[target] = index
    return GuideProgress(tuple(taken_by))


def within_reach(guide: Guide, view: Camera, taken_by: Sequence[int | None]) -> int | None:
    """Return the open target that this view would take, or None."""
    distance_m, angle_rad = _from_targets(guide, view)
    near = guide.near_enough
    fits = (distance_m <= near.position_m) & (angle_rad <= near.direction_rad)
    return _nearest(np.where(fits, distance_m, np.inf), taken_by)


def next_target(guide: Guide, view: Camera, taken_by: Sequence[int | None]) -> int | None:
    """Return the open target nearest to where the camera is now; None when all are taken."""
    return _nearest(_from_targets(guide, view)[0], taken_by)


def _from_targets(
    guide: Guide, view: Camera
) -> tuple[Float64[np.ndarray, "targets"], Float64[np.ndarray, "targets"]]:
    positions_m = np.array([t.translation_m for t in guide.targets])
    forward = np.array([t.rotation[:, 2] for t in guide.targets])
    distance_m = np.linalg.norm(positions_m - view.position_m, axis=1)
    chord = np.linalg.norm(forward - view.forward, axis=1)
    return distance_m, 2 * np.arcsin(np.minimum(chord / 2, 1.0))


def _nearest(
    distance_m: Float64[np.ndarray, "targets"], taken_by: Sequence[int | None]
) -> int | None:
    taken = np.array([view is not None for view in taken_by], dtype=bool)
    distance_m = np.where(taken, np.inf, distance_m)
    if not np.isfinite(distance_m).any():
        return None
    return int(np.argmin(distance_m))
