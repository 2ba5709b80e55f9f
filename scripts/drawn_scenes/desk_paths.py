"""How a phone moves past the desk (`desk`), and how it photographs it (`desk_around`)."""

import numpy as np

from drawn_scenes.paths import ABOVE, BEHIND, BESIDE, BETWEEN, by_hand, held_out_place, looking
from drawn_scenes.recording import Shot
from peaking.photographers.drawn.desk_room import DESK_TOP_M
from peaking.photographers.drawn.mesh import Pose
from peaking.photographers.drawn.phone import tremor

FRAMES_PER_S = 15.0
COLUMNS, ROWS = 8, 5
GRID_X_M, GRID_Z_M = (-0.6, 0.6), (0.98, 1.48)
SHOT_EVERY_S = 2.0
HELD_OUT = {BETWEEN: 8, BESIDE: 8, ABOVE: 7, BEHIND: 7}
DUCK_SPOTS_M = (
    (0.02, 0.71), (0.16, 0.72), (0.30, 0.71), (0.44, 0.73), (0.58, 0.71), (0.74, 0.71),
    (-0.13, 0.74), (0.82, 0.86), (0.50, 0.95), (-0.55, 0.80),
)  # fmt: skip
"""Free places on the desk (x, y)."""


def sweep(count: int, seed: int) -> list[Shot]:
    """The frames of the video: `world_from_cam` at 15 a second."""
    return [Shot(world_from_cam(k, seed), k / FRAMES_PER_S) for k in range(count)]


def world_from_cam(frame: int, seed: int) -> np.ndarray:
    """The 4x4 camera-to-world pose of a frame, OpenGL camera axes, metres.

    Two lateral sweeps there and back (0.30 m to each side, 1.5 cm a step), the first high and the
    second low, with slow changes of aim and the tremor of a hand (about 1 mm and 0.15 degrees).
    """
    turn = 2 * np.pi * frame / 80.0
    sweep = np.arcsin(0.94 * np.sin(turn - np.pi / 2)) / np.arcsin(0.94)
    slow = 2 * np.pi * frame / 150.0
    shake = tremor(frame, seed)
    at_m = np.array(
        (0.30 * sweep, -0.015 + 0.07 * np.sin(1.3 * slow + 0.4), 1.19 + 0.11 * np.cos(slow - 0.5))
    )
    at_m += 0.001 * shake[:3]
    aim_m = np.array(
        (
            0.08 + 0.10 * sweep + 0.05 * np.sin(2.3 * slow),
            1.4,
            1.0 + 0.05 * np.sin(1.7 * slow + 1.0),
        )
    )
    return looking(
        at_m, aim_m, np.radians(0.15 * shake[3:] + (0.0, 0.0, 1.3 * np.sin(1.9 * slow + 2.0)))
    )


def around(seed: int) -> list[Shot]:
    """40 photographs on a loose grid, row by row, there and back; then those that are held out."""
    rng = np.random.default_rng((seed, 200))
    places: list[tuple[str, np.ndarray, np.ndarray]] = []
    for row in range(ROWS):
        for step in range(COLUMNS):
            column = step if row % 2 == 0 else COLUMNS - 1 - step
            places.append(("view", *_on_grid(column / (COLUMNS - 1), row / (ROWS - 1), rng)))
    for group, count in HELD_OUT.items():
        for k in range(count):
            side = float(k % 2) if group == BESIDE else rng.uniform(0.05, 0.95)
            height = 1.0 if group == ABOVE else rng.uniform(0.05, 0.95)
            at_m, aim_m = _on_grid(side, height, rng)
            if group == BESIDE:  # outwards
                at_m[0] += rng.uniform(0.2, 0.5) * (1.0 if side else -1.0)
            elif group != BETWEEN:
                at_m = held_out_place(group, at_m, aim_m, rng)
            places.append((group, at_m, aim_m))
    return [
        Shot(by_hand(at_m, aim_m, k, seed), SHOT_EVERY_S * k, group, _duck(k, rng))
        for k, (group, at_m, aim_m) in enumerate(places)
    ]


def _on_grid(side: float, height: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A place on the grid (0 to 1, left to right and low to high), and what is aimed at from it."""
    (left, right), (low, high) = GRID_X_M, GRID_Z_M
    at_m = np.array((left + side * (right - left), 0.0, low + height * (high - low)))
    at_m += rng.normal(0.0, 0.02, 3)
    aim_m = np.array((0.10 + 0.5 * at_m[0], 1.4, 0.98)) + rng.normal(0.0, 0.04, 3)
    return at_m, aim_m


def _duck(shot: int, rng: np.random.Generator) -> Pose:
    """Where the duck stands: nowhere twice in a row."""
    x, y = DUCK_SPOTS_M[7 * shot % len(DUCK_SPOTS_M)]
    at_m = (x + rng.uniform(-0.012, 0.012), y + rng.uniform(-0.012, 0.012), DESK_TOP_M + 0.004)
    return Pose(at_m, yaw_deg=rng.uniform(0, 360))
