"""Every n-th frame, even in time: what most tools do with a video. It needs the whole path."""

from __future__ import annotations

import numpy as np

from peaking.selection.policy import CandidatePath


def choose_every_nth(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Choose frames at even steps of their number, the first and the last among them."""
    places = np.linspace(0, len(path) - 1, count).round().astype(int).tolist()
    return path.numbers(places)
