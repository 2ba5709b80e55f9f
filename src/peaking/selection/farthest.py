"""Farthest point in the space of poses: even coverage on paths that return.

It needs the whole path.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from peaking.selection.policy import CandidatePath

DEPTHS_PER_RAD = 0.5
"""A rotation by one radian counts as half the scene's depth: it changes about as much of the
picture."""


def choose_farthest(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Start at the first candidate, then again and again take the one farthest from all taken.

    Gonzalez (1985): at most twice as far from the best possible cover. The distance is that of the
    positions plus `DEPTHS_PER_RAD` for the angle between the viewing directions.
    """
    positions_m = np.array([camera.position_m for camera in path.cameras])
    forward = np.array([camera.forward for camera in path.cameras])
    metres_per_rad = DEPTHS_PER_RAD * path.scene_depth_m

    def away_from(k: int) -> Float64[np.ndarray, "n"]:
        angle_rad = np.arccos(np.clip(forward @ forward[k], -1.0, 1.0))
        return np.linalg.norm(positions_m - positions_m[k], axis=1) + metres_per_rad * angle_rad

    chosen = [0]
    least = away_from(0)
    while len(chosen) < count:
        least[chosen] = -1.0
        chosen.append(int(np.argmax(least)))
        least = np.minimum(least, away_from(chosen[-1]))
    return path.numbers(sorted(chosen))
