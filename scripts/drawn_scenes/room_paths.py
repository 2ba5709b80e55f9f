"""How somebody photographs the living room: a walk around its middle, looking at the walls."""

import numpy as np

from drawn_scenes.paths import ABOVE, BEHIND, BESIDE, BETWEEN, by_hand, held_out_place
from drawn_scenes.recording import Shot
from peaking.photographers.drawn.furniture import BALL_RADIUS_M, TABLE_AT_M, TABLE_TOP_M
from peaking.photographers.drawn.mesh import Pose

VIEWS = 45
HELD_OUT = {BETWEEN: 8, BESIDE: 8, ABOVE: 7, BEHIND: 7}
SHOT_EVERY_S = 2.0
EYE_M, AIM_M = 1.42, 0.98
"""Height of the phone, and of what it is pointed at, 2 m ahead."""
IN_VIEW_RAD = np.radians(19.0)
SPOTS_M = (
    (2.05, 0.62, 0.0), (1.95, -0.75, 0.0), (2.0, -0.05, 0.0), (1.65, -1.35, 0.0),
    (1.36, 1.07, 0.42), (1.9, 0.95, 0.0), (1.0, 1.86, 0.0), (0.95, 1.5, 0.0),
    (0.3, 1.45, 0.0), (-0.35, 1.55, 0.0), (0.75, 1.87, 0.465), (-0.85, 1.75, 0.0),
    (TABLE_AT_M[0] - 0.06, TABLE_AT_M[1] - 0.24, TABLE_TOP_M), (-1.75, 0.75, 0.0),
    (-2.25, -0.28, 0.76), (-1.8, 0.25, 0.0), (-1.85, -0.35, 0.0), (-1.95, -0.6, 0.0),
    (-1.2, -1.0, 0.0), (-0.95, -1.55, 0.44), (-0.45, -1.55, 0.44), (0.1, -1.55, 0.45),
    (-0.7, -1.35, 0.44), (0.75, -1.45, 0.0), (0.75, -1.85, 0.0), (-0.2, -1.3, 0.44),
)  # fmt: skip
"""Where the ball may lie (x, y, and what it lies on)."""


def walk(seed: int) -> list[Shot]:
    """45 photographs on the way around; then those that are held out."""
    rng = np.random.default_rng((seed, 200))
    places = [("view", *_on_walk(k / VIEWS, rng)) for k in range(VIEWS)]
    for group, count in HELD_OUT.items():
        for k in range(count):
            at_m, aim_m = _on_walk((k + rng.uniform(0.2, 0.8)) / count, rng)
            if group != BETWEEN:
                moved_m = held_out_place(group, at_m, aim_m, rng)
                if group == BESIDE:
                    aim_m = aim_m + 0.6 * (moved_m - at_m)
                at_m = moved_m
            places.append((group, at_m, aim_m))
    shots: list[Shot] = []
    spot = -1
    for k, (group, at_m, aim_m) in enumerate(places):
        spot = _another_spot(at_m, aim_m, spot, rng)
        pose = by_hand(at_m, aim_m, k, seed)
        shots.append(Shot(pose, SHOT_EVERY_S * k, group, _ball(spot, rng)))
    return shots


def _on_walk(turn: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A place on the walk, `turn` of one time around, and the point 2 m ahead."""
    angle = 2 * np.pi * turn
    away_m = 0.48 + 0.12 * np.sin(3 * angle + 0.7)
    at_m = np.array((away_m * np.cos(angle), away_m * np.sin(angle), EYE_M))
    at_m += rng.normal(0.0, (0.02, 0.02, 0.03))
    heading = angle + 0.25 * np.sin(2 * angle) + rng.normal(0.0, 0.03)
    aim_m = at_m + 2.0 * np.array((np.cos(heading), np.sin(heading), 0.0))
    aim_m[2] = AIM_M + 0.14 * np.sin(5 * angle) + rng.normal(0.0, 0.03)
    return at_m, aim_m


def _another_spot(at_m: np.ndarray, aim_m: np.ndarray, last: int, rng: np.random.Generator) -> int:
    """A spot in the picture where the ball was not in the picture before."""
    heading = np.arctan2(*(aim_m - at_m)[1::-1])
    toward = np.array(SPOTS_M)[:, :2] - at_m[:2]
    turned = np.arctan2(toward[:, 1], toward[:, 0]) - heading
    turned = np.abs(np.angle(np.exp(1j * turned)))
    turned[np.linalg.norm(toward, axis=1) < 0.9] = np.pi
    if last >= 0:
        turned[last] = np.pi
    good = np.flatnonzero(turned < IN_VIEW_RAD)
    return int(rng.choice(good)) if len(good) else int(turned.argmin())


def _ball(spot: int, rng: np.random.Generator) -> Pose:
    x, y, z = SPOTS_M[spot]
    at_m = (x + rng.uniform(-0.05, 0.05), y + rng.uniform(-0.05, 0.05), z + BALL_RADIUS_M)
    return Pose(at_m, *rng.uniform(0, 360, 3))
