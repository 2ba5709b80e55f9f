"""Farthest point in the space of poses: even coverage on paths that return."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.evaluate.scene import Scene

DEPTHS_PER_RAD = 0.5
"""A rotation by one radian counts as half the scene's depth: it changes about as much of the
picture."""


def farthest(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Start at the first candidate, then again and again take the one farthest from all taken.

    Gonzalez (1985): at most twice as far from the best possible cover. The distance is that of the
    places plus `DEPTHS_PER_RAD` for the angle between the viewing directions.
    """
    places_m = np.array([scene.cameras[i].position_m for i in candidates])
    forward = np.array([scene.cameras[i].forward for i in candidates])
    metres_per_rad = DEPTHS_PER_RAD * scene.depth_m

    def away_from(k: int) -> Float64[np.ndarray, "n"]:
        angle_rad = np.arccos(np.clip(forward @ forward[k], -1.0, 1.0))
        return np.linalg.norm(places_m - places_m[k], axis=1) + metres_per_rad * angle_rad

    chosen = [0]
    least = away_from(0)
    while len(chosen) < count:
        least[chosen] = -1.0
        chosen.append(int(np.argmax(least)))
        least = np.minimum(least, away_from(chosen[-1]))
    return sorted(candidates[k] for k in chosen)
