"""Views at the spacing of the plenoptic bound, as LLFF's guidance asks for them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.evaluate.scene import Scene

STEPS = 60
"""Bisections of the spacing."""


def plenoptic(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Take a view wherever the camera is at least one spacing away from all taken so far.

    The bound gives one spacing for the whole scene, from its nearest point (paper, section 4.1;
    `peaking.guidance.plenoptic`), and knows places only, no directions. For an equal number of
    views the spacing is the one that gives `count`; where a step of it changes the number by more
    than one, the last of too many are left out.
    """
    places_m = np.array([scene.cameras[i].position_m for i in candidates])
    low_m, high_m = 0.0, float(np.ptp(places_m, axis=0).sum()) + 1e-9
    for _ in range(STEPS):
        spacing_m = (low_m + high_m) / 2
        enough = len(spaced(places_m, spacing_m)) >= count
        low_m, high_m = (spacing_m, high_m) if enough else (low_m, spacing_m)
    return [candidates[k] for k in spaced(places_m, low_m)[:count]]


def spaced(places_m: Float64[np.ndarray, "n 3"], spacing_m: float) -> list[int]:
    """Return which places are taken, in their order: each at least a spacing from all before."""
    taken = [0]
    for k in range(1, len(places_m)):
        if np.linalg.norm(places_m[taken] - places_m[k], axis=1).min() >= spacing_m:
            taken.append(k)
    return taken
