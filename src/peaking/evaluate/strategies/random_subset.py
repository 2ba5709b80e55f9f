"""A random subset: the paper's "Random"."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from peaking.evaluate.scene import Scene


def random_subset(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Draw `count` candidates, every subset with the same chance."""
    return sorted(rng.choice(np.asarray(candidates), count, replace=False).tolist())
