"""The paper's rule: a view whenever the peaked share exceeds a threshold (section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from peaking.options import PAPER_PEAKED_SHARE
from peaking.selection.policy import Candidate, CandidatePath, Decision, Worth

MAX_WALKS = 12
"""Walks to find the threshold that gives a number of views."""


class Threshold:
    """Takes the first frame, then every one of which more is red than the threshold."""

    def __init__(self, threshold_share: float = PAPER_PEAKED_SHARE) -> None:
        """Begin without a view.

        Raises:
            ValueError: The threshold is not in 0…1.
        """
        if not 0 <= threshold_share < 1:
            raise ValueError(f"need 0 <= threshold_share < 1, got {threshold_share}")
        self._threshold_share = threshold_share
        self._views: list[int] = []
        self._shares: list[float] = []

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views taken so far."""
        return tuple(self._views)

    @property
    def shares(self) -> Sequence[float]:
        """How much was red when each view was taken; 1 for the first."""
        return tuple(self._shares)

    @property
    def worth(self) -> Mapping[int, Worth]:
        """Nothing is known of it."""
        return {}

    def observe(self, candidate: Candidate) -> Decision:
        """Take the frame if too much of it is red."""
        share = candidate.peaked_share(self.views) if self._views else 1.0
        if share <= self._threshold_share:
            return Decision(False, f"{share:.2%} red")
        if not candidate.accepted:
            return Decision(False, "no depth")
        reason = f"{share:.2%} red" if self._views else "the first view"
        self._views.append(candidate.number)
        self._shares.append(share)
        return Decision(True, reason)

    def finish(self) -> Decision:
        """Let go of nothing."""
        return Decision(False, "the end of the path")


@dataclass(frozen=True)
class Taken:
    """The views that a threshold gives, and the share of red at which each was taken."""

    views: tuple[int, ...]
    shares: tuple[float, ...]


def taken_at(
    candidates: Sequence[Candidate], threshold_share: float, *, most: int | None = None
) -> Taken:
    """Return what a threshold takes of a path; stops when `most` views are taken."""
    policy = Threshold(threshold_share)
    for candidate in candidates:
        policy.observe(candidate)
        if most is not None and len(policy.views) >= most:
            break
    return Taken(tuple(policy.views), tuple(policy.shares))


def choose_by_threshold(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Choose `count` views by the threshold that gives as many.

    Where no threshold gives exactly so many, the lowest that gives more is used, and the views
    that were taken at the least red are left out again.
    """
    low, high = 0.0, 1.0
    best: Taken | None = None
    guess = 0.1
    for _ in range(MAX_WALKS):
        found = taken_at(path.candidates, guess, most=2 * count + 8)
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
        best = taken_at(path.candidates, 0.0)
    reddest = sorted(np.argsort(-np.array(best.shares), kind="stable")[:count].tolist())
    return [best.views[k] for k in reddest]
