"""All candidates: the paper's "Full"."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from peaking.evaluate.scene import Scene


def everything(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Return all candidates, however many were asked for."""
    return list(candidates)
