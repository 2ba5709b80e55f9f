"""Poses around the path of a photographer, at which views do not exist but might.

Around every place where the photographer was (a view, or a moment of the walk): that place itself,
half-way between consecutive views, a step to each side, and turned. What is predicted there says
how complete a capture is, and where the next view helps.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64

from peaking.geometry import Cam, Camera, Rigid, World

Moved = Literal[
    "here", "between", "left", "right", "up", "down", "closer", "back",
    "turned left", "turned right", "turned up", "turned down",
]  # fmt: skip
"""How a pose differs from one where the photographer was."""

STEP_SHARE = 0.15
"""A step is so much of the scene's depth …"""

STEP_M = (0.04, 0.5)
"""… within these bounds."""

TURN_RAD, TURN_SHARE = math.radians(25), 0.45
"""How far a virtual camera is turned, and that as a part of the picture's width, at most."""

APART_RAD = math.radians(15)
"""So much of a turn sets poses apart as much as a step does."""

MAX_CAMERAS = 128
"""More are not looked at: steps get longer instead."""

MAX_PATH = 400
"""So many moments of the walk are looked at, evenly chosen."""

LONGER = math.sqrt(2)
"""Steps get longer by this factor, so that most poses stay the same while a capture grows."""

CLEARANCE = 0.5
"""Nobody stands closer to a surface than so many steps."""

STEPS: tuple[tuple[Moved, tuple[float, float, float]], ...] = (
    ("left", (-1.0, 0.0, 0.0)),
    ("right", (1.0, 0.0, 0.0)),
    ("up", (0.0, -1.0, 0.0)),
    ("down", (0.0, 1.0, 0.0)),
    ("closer", (0.0, 0.0, 1.0)),
    ("back", (0.0, 0.0, -1.0)),
)
TURNS: tuple[tuple[Moved, tuple[float, float, float]], ...] = (
    ("turned left", (0.0, -1.0, 0.0)),
    ("turned right", (0.0, 1.0, 0.0)),
    ("turned up", (1.0, 0.0, 0.0)),
    ("turned down", (-1.0, 0.0, 0.0)),
)


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """A pose that might be photographed from.

    Attributes:
        camera: It, at the size that is handed in.
        moved: How it differs from where the photographer was.
        walked: It is where the photographer was, or between; all others are beside.
    """

    camera: Camera
    moved: Moved

    @property
    def walked(self) -> bool:
        """Whether the photographer was here, or passed by; all others are beside the path."""
        return self.moved in ("here", "between")

    @property
    def turned(self) -> bool:
        """Whether it looks where no view from here looks."""
        return self.moved.startswith("turned")


def step_length_m(scene_depth_m: float) -> float:
    """Return a step that suits a scene; scenes about as deep have the very same.

    Raises:
        ValueError: `scene_depth_m` is not > 0.
    """
    if not scene_depth_m > 0:
        raise ValueError(f"need scene_depth_m > 0, got {scene_depth_m}")
    wanted_m = min(max(STEP_SHARE * scene_depth_m, STEP_M[0]), STEP_M[1])
    return LONGER ** round(math.log(wanted_m) / math.log(LONGER))


def poses_around(
    views: Sequence[Camera],
    path: Sequence[Rigid[World, Cam]],
    surface_m: Float32[np.ndarray, "n 3"],
    step_m: float,
) -> list[VirtualCamera]:
    """Return poses around where a photographer was, none of them inside a surface.

    Args:
        views: Where views were taken, in order; all virtual cameras have the pinhole of the first.
        path: Where the photographer was besides, as far as that is known.
        surface_m: Points of the world on what was seen.
        step_m: Length of a step, > 0.

    Raises:
        ValueError: There is no view.
    """
    if not views:
        raise ValueError("need at least one view, got none")
    while len(found := _around(views, path, surface_m, step_m)) > MAX_CAMERAS:
        step_m *= LONGER
    return found


def _around(
    views: Sequence[Camera],
    path: Sequence[Rigid[World, Cam]],
    surface_m: Float32[np.ndarray, "n 3"],
    step_m: float,
) -> list[VirtualCamera]:
    found = _Spread(views[0], step_m)
    every = max(1, -(-len(path) // MAX_PATH))
    for pose in [*(view.world_from_cam for view in views), *path[::every]]:
        found.add(pose, "here")
    for before, after in itertools.pairwise(views):
        found.add(_between(before.world_from_cam, after.world_from_cam), "between")
    clear = _Clear(surface_m, CLEARANCE * step_m)
    walked = list(found.cameras)
    for moved, direction in STEPS:
        for anchor in walked:
            here = anchor.camera.world_from_cam
            there_m = here.apply(step_m * np.array(direction))
            if clear.between(here.translation_m, there_m):
                found.add(Rigid(here.rotation, there_m), moved)
    pinhole = views[0].pinhole
    width_rad = 2 * math.atan(0.5 * pinhole.width_px / pinhole.fx_px)
    turn_rad = min(TURN_RAD, TURN_SHARE * width_rad)
    for moved, axis in TURNS:
        for anchor in walked:
            here = anchor.camera.world_from_cam
            rotation = here.rotation @ _rotation(turn_rad * np.array(axis))
            found.add(Rigid(rotation, here.translation_m), moved)
    return found.cameras


class _Spread:
    """Poses that are apart from each other."""

    def __init__(self, like: Camera, step_m: float) -> None:
        self.cameras: list[VirtualCamera] = []
        self._like = like
        self._step_m = step_m
        self._positions_m = np.empty((0, 3))
        self._forward = np.empty((0, 3))

    def add(self, pose: Rigid[World, Cam], moved: Moved) -> None:
        """Add a pose unless there is one nearby that looks the same way."""
        if len(self.cameras) > MAX_CAMERAS:
            return
        forward = pose.rotation[:, 2]
        distance = np.linalg.norm(self._positions_m - pose.translation_m, axis=1) / self._step_m
        angle_rad = np.arccos(np.clip(self._forward @ forward, -1.0, 1.0))
        if (np.maximum(distance, angle_rad / APART_RAD) < 0.95).any():
            return
        self.cameras.append(VirtualCamera(replace(self._like, world_from_cam=pose), moved))
        self._positions_m = np.vstack([self._positions_m, pose.translation_m])
        self._forward = np.vstack([self._forward, forward])


class _Clear:
    """Where one can go without touching a surface."""

    def __init__(self, surface_m: Float32[np.ndarray, "n 3"], clearance_m: float) -> None:
        self._surface_m = surface_m.astype(np.float64)
        self._clearance_m = clearance_m

    def between(self, here_m: Float64[np.ndarray, "3"], there_m: Float64[np.ndarray, "3"]) -> bool:
        """Return whether the way is clear; of where one stands already nothing is asked."""
        way_m = there_m - here_m
        along = (self._surface_m - here_m) @ way_m / max(float(way_m @ way_m), 1e-12)
        nearest_m = here_m + np.clip(along, 0.0, 1.0)[:, None] * way_m
        distance_m = np.linalg.norm(self._surface_m - nearest_m, axis=1)
        return not ((distance_m < self._clearance_m) & (along > 0)).any()


def _between(a: Rigid[World, Cam], b: Rigid[World, Cam]) -> Rigid[World, Cam]:
    turn = _vector(a.rotation.T @ b.rotation)
    return Rigid(a.rotation @ _rotation(0.5 * turn), 0.5 * (a.translation_m + b.translation_m))


def _rotation(vector_rad: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation about a vector by its length (Rodrigues)."""
    angle = float(np.linalg.norm(vector_rad))
    x, y, z = vector_rad / max(angle, 1e-12)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * across + (1 - math.cos(angle)) * across @ across


def _vector(rotation: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3"]:
    """Return the vector of a rotation; of a half turn some vector of that length."""
    angle = math.acos(min(max((float(np.trace(rotation)) - 1) / 2, -1.0), 1.0))
    odd = rotation - rotation.T
    axis = np.array([odd[2, 1], odd[0, 2], odd[1, 0]])
    length = float(np.linalg.norm(axis))
    return angle * axis / length if length > 1e-9 else np.zeros(3)
