"""The sharpest frame of each of as many windows in time. It needs the whole path."""

from __future__ import annotations

import numpy as np

from peaking.selection.policy import CandidatePath


def choose_sharpest(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Cut the path into windows of equally many frames, and choose the sharpest of each."""
    sharp = np.array([candidate.sharpness() for candidate in path.candidates])
    windows = np.array_split(np.arange(len(path)), count)
    return path.numbers([int(window[np.argmax(sharp[window])]) for window in windows])
