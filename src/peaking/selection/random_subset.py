"""A random subset: the paper's "Random". It needs the whole path."""

from __future__ import annotations

import numpy as np

from peaking.selection.policy import CandidatePath


def choose_randomly(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Draw `count` candidates, every subset with the same chance."""
    numbers = [candidate.number for candidate in path.candidates]
    return sorted(rng.choice(np.asarray(numbers), count, replace=False).tolist())
