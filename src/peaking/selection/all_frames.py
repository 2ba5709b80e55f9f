"""All candidates: the paper's "Full"."""

from __future__ import annotations

import numpy as np

from peaking.selection.policy import CandidatePath


def choose_all(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Return all candidates, however many were asked for."""
    return [candidate.number for candidate in path.candidates]
