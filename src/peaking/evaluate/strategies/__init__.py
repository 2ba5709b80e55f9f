"""Who chooses the views: one file per strategy, one interface.

`threshold` and `peaking` walk the candidates in the order of capture and see only what is past. The
others know the whole path beforehand, as nobody does who holds the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from peaking.evaluate.scene import Scene
from peaking.evaluate.strategies.everything import everything
from peaking.evaluate.strategies.farthest import farthest
from peaking.evaluate.strategies.peaking import peaking
from peaking.evaluate.strategies.plenoptic import plenoptic
from peaking.evaluate.strategies.random_subset import random_subset
from peaking.evaluate.strategies.threshold import threshold
from peaking.evaluate.strategies.uniform import uniform

Strategy = Callable[[Scene, Sequence[int], int, np.random.Generator], list[int]]
"""Scene, candidates in the order of capture, how many, random numbers → chosen, in that order."""

STRATEGIES: Mapping[str, Strategy] = {
    "peaking": peaking,
    "threshold": threshold,
    "uniform": uniform,
    "farthest": farthest,
    "plenoptic": plenoptic,
    "random": random_subset,
    "all": everything,
}

RANDOM = frozenset({"random"})
"""Strategies whose choice depends on the seed."""

NEED_DEPTH = frozenset({"peaking", "threshold"})
"""Strategies that make MPIs."""
