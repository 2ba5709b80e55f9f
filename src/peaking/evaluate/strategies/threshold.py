"""The paper's photographer: a view whenever the peaked share exceeds a threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from peaking.evaluate.scene import Scene

TRIES = 12
"""Walks, at most, to find the threshold that gives a number of views."""


@dataclass(frozen=True)
class Walked:
    """The views that a threshold gives, and the share of red at which each was taken."""

    views: tuple[int, ...]
    shares: tuple[float, ...]


def threshold(
    scene: Scene, candidates: Sequence[int], count: int, rng: np.random.Generator
) -> list[int]:
    """Choose `count` views by the threshold that gives as many.

    Where no threshold gives exactly so many, the lowest that gives more is used, and the views
    that were taken at the least red are left out again.
    """
    low, high = 0.0, 1.0
    best: Walked | None = None
    guess = 0.1
    for _ in range(TRIES):
        found = walk(scene, candidates, guess, most=2 * count + 8)
        if len(found.views) >= count:
            best = found if best is None or len(found.views) <= len(best.views) else best
            low = guess
        else:
            high = guess
        if len(found.views) == count:
            break
        # The number falls roughly with the inverse of the threshold: guess so, within the bracket.
        guess = float(np.clip(guess * len(found.views) / count, 0.9 * low + 0.1 * high, high))
        if not low < guess < high:
            guess = (low + high) / 2
    if best is None:
        best = walk(scene, candidates, 0.0, most=len(candidates))
    reddest = sorted(np.argsort(-np.array(best.shares), kind="stable")[:count].tolist())
    return [best.views[k] for k in reddest]


def walk(scene: Scene, candidates: Sequence[int], threshold_share: float, *, most: int) -> Walked:
    """Take the first candidate, then every one whose peaked share exceeds the threshold.

    Stops when `most` views are taken.
    """
    views: list[int] = []
    shares: list[float] = []
    for i in candidates:
        share = 1.0
        if views:
            share = scene.peaked_share(i, scene.neighbours(views, scene.cameras[i]))
        if share > threshold_share:
            views.append(i)
            shares.append(share)
            if len(views) >= most:
                break
    return Walked(tuple(views), tuple(shares))
