# pyright: basic
"""What is to be photographed: the scenes, and from where each is to be shown afterwards.

A task names a volume of camera places and directions. Its coordinates are five numbers in 0…1: a
place in the volume (three), and a direction (yaw, pitch). Photographers walk in them, and test
views are drawn from all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera, Pinhole
from peaking.photographers.drawn import (
    desk_room,
    desk_scene,
    hall,
    living_room,
    room_scene,
    still_life,
)
from peaking.photographers.drawn_mesh import build_mesh
from peaking.photographers.scene import Scene, bake, look

SceneName = Literal["desk", "still-life", "room", "hall"]
SCENE_NAMES: tuple[SceneName, ...] = get_args(SceneName)

TUNING: frozenset[SceneName] = frozenset({"desk", "still-life"})
"""What guides and photographers may be tuned on; the others are for reporting alone."""

WIDTH_PX, HEIGHT_PX = 162, 352
PINHOLE = Pinhole(WIDTH_PX, HEIGHT_PX, 191.2, 191.2, WIDTH_PX / 2, HEIGHT_PX / 2)
"""The camera of `scenes/desk`, 45.93° wide, with fewer pixels."""

Coordinates = Float64[np.ndarray, "5"]
Placed = tuple[Float64[np.ndarray, "3"], float, float]
"""Position in metres, yaw and pitch in radians."""

TEST_SEED = 20_261
METRES_PER_RAD = 0.6
"""What turning counts as where the length of a walk is measured."""


@dataclass(frozen=True)
class Task:
    """A scene and the volume it is to be shown from.

    Attributes:
        name: Of the scene.
        place: Position, yaw and pitch of coordinates.
        turns: The yaw goes all around, so that its coordinate has no ends.
        circles: So does the first coordinate of the place.
        anchors: Coordinates of the middles of LLFF's grids: one for each direction that the
            task has.
        area_side_m: Side of the square that the grids of LLFF fill.
    """

    name: SceneName
    place: Callable[[Coordinates], Placed]
    anchors: tuple[tuple[float, float, float, float, float], ...]
    area_side_m: float
    turns: bool = False
    circles: bool = False

    def camera(self, at: Coordinates) -> Camera:
        """Return the camera of coordinates."""
        return look(PINHOLE, *self.place(at))

    def test_cameras(self, count: int) -> list[Camera]:
        """Return cameras from the whole volume: always the same ones, off every path."""
        rng = np.random.default_rng((TEST_SEED, SCENE_NAMES.index(self.name)))
        return [self.camera(rng.uniform(size=5)) for _ in range(count)]

    def length_m(self, a: Coordinates, b: Coordinates) -> float:
        """Return how long it is from one place to another, turning included."""
        placed = [self.place(a + share * (b - a)) for share in np.linspace(0, 1, 9)]
        total_m = 0.0
        for (p, yaw_p, pitch_p), (q, yaw_q, pitch_q) in pairwise(placed):
            turned_rad = abs(yaw_q - yaw_p) + abs(pitch_q - pitch_p)
            total_m += float(np.linalg.norm(q - p)) + METRES_PER_RAD * turned_rad
        return total_m


def _desk(at: Coordinates) -> Placed:
    """Before the desk; every direction meets it."""
    position_m = np.array([-0.5 + 1.0 * at[0], -0.25 + 0.5 * at[1], 1.0 + 0.45 * at[2]])
    toward = np.array([0.1 + 0.35 * (at[3] - 0.5), 1.6, 0.95 + 0.35 * (at[4] - 0.5)]) - position_m
    return position_m, *_direction(toward)


def _still_life(at: Coordinates) -> Placed:
    """All around the stand, at arm's length to two."""
    angle, away_m = 2 * np.pi * at[0], 0.75 + 0.65 * at[1]
    position_m = np.array([away_m * np.cos(angle), away_m * np.sin(angle), 0.85 + 0.75 * at[2]])
    yaw, pitch = _direction(np.array([0.0, 0.0, 0.93]) - position_m)
    yaw = (
        angle
        + np.pi
        + (yaw - angle - np.pi) % (2 * np.pi)
        - 2 * np.pi * ((yaw - angle - np.pi) % (2 * np.pi) > np.pi)
    )  # without a jump, so that a walk around turns on
    return position_m, yaw + 0.3 * (at[3] - 0.5), pitch + 0.25 * (at[4] - 0.5)


def _room(at: Coordinates) -> Placed:
    """The free middle of the living room, looking anywhere."""
    position_m = np.array([-0.75 + 1.4 * at[0], -0.55 + 1.1 * at[1], 1.25 + 0.4 * at[2]])
    return position_m, 2 * np.pi * at[3], np.radians(-24 + 24 * at[4])


def _hall(at: Coordinates) -> Placed:
    """Along the hall, looking ahead and to both sides."""
    position_m = np.array([0.35 + 3.9 * at[0], -0.24 + 0.48 * at[1], 1.15 + 0.45 * at[2]])
    return position_m, np.radians(-48 + 96 * at[3]), np.radians(-18 + 18 * at[4])


def _direction(toward: Float64[np.ndarray, "3"]) -> tuple[float, float]:
    return float(np.arctan2(toward[1], toward[0])), float(
        np.arctan2(toward[2], np.hypot(toward[0], toward[1]))
    )


_HALF = 0.5
TASKS: dict[SceneName, Task] = {
    "desk": Task("desk", _desk, ((_HALF, _HALF, _HALF, _HALF, _HALF),), 0.7),
    "still-life": Task(
        "still-life",
        _still_life,
        tuple((k / 4, _HALF, _HALF, _HALF, _HALF) for k in range(4)),
        0.6,
        circles=True,
    ),
    "room": Task(
        "room",
        _room,
        tuple((_HALF, _HALF, _HALF, k / 4, _HALF) for k in range(4)),
        0.8,
        turns=True,
    ),
    "hall": Task(
        "hall", _hall, tuple((x, 0.5, 0.5, 0.5, 0.5) for x in (0.0, 0.33, 0.66, 1.0)), 0.42
    ),
}

_DRAWN: dict[SceneName, tuple[Callable[[], dict[str, Any]], Any, int]] = {
    "desk": (desk_room.lights, desk_scene.PARTS, 7),
    "still-life": (still_life.lights, still_life.PARTS, 31),
    "room": (living_room.lights, room_scene.PARTS, 23),
    "hall": (hall.lights, hall.PARTS, 41),
}


@lru_cache(maxsize=1)
def open_scene(name: SceneName) -> Scene:
    """Return a scene with its light; the last one is kept, for it takes seconds to build."""
    lights, parts, seed = _DRAWN[name]
    drawn = [make(np.random.default_rng((seed, k))) for k, make in enumerate(parts)]
    mesh, panels = build_mesh([lights(), *drawn])
    return bake(mesh, panels, np.random.default_rng((seed, 99)))
