"""Views at the spacing of the plenoptic bound, as LLFF's guidance asks for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from peaking.selection.policy import Candidate, CandidatePath, Decision, Worth

BISECTIONS = 60
"""Of the spacing, to find the one that gives a number of views."""


class Spacing:
    """Takes a frame wherever the camera is at least one spacing away from all views.

    The bound gives one spacing for the whole scene, from its nearest point (paper, section 4.1;
    `peaking.guidance.plenoptic`), and knows positions only, no directions.
    """

    def __init__(self, spacing_m: float) -> None:
        """Begin without a view.

        Raises:
            ValueError: The spacing is not >= 0.
        """
        if not (math.isfinite(spacing_m) and spacing_m >= 0):
            raise ValueError(f"need spacing_m >= 0, got {spacing_m}")
        self._spacing_m = spacing_m
        self._positions_m: list[Float64[np.ndarray, "3"]] = []
        self._views: list[int] = []

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views taken so far."""
        return tuple(self._views)

    @property
    def worth(self) -> Mapping[int, Worth]:
        """Nothing is known of it."""
        return {}

    def observe(self, candidate: Candidate) -> Decision:
        """Take the frame if no view is near."""
        position_m = candidate.camera.position_m
        if self._positions_m:
            away_m = np.array(self._positions_m) - position_m
            nearest_m = float(np.linalg.norm(away_m, axis=1).min())
            reason = f"{100 * nearest_m:.1f} cm from the nearest view"
            if nearest_m < self._spacing_m:
                return Decision(False, reason)
        else:
            reason = "the first view"
        if not candidate.accepted:
            return Decision(False, "no depth")
        self._positions_m.append(position_m)
        self._views.append(candidate.number)
        return Decision(True, reason)

    def finish(self) -> Decision:
        """Let go of nothing."""
        return Decision(False, "the end of the path")


def choose_by_spacing(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Choose `count` views by the spacing that gives as many.

    Where a step of the spacing changes the number by more than one, the last of too many are left
    out.
    """
    positions_m = np.array([candidate.camera.position_m for candidate in path.candidates])
    low_m, high_m = 0.0, float(np.ptp(positions_m, axis=0).sum()) + 1e-9
    for _ in range(BISECTIONS):
        spacing_m = (low_m + high_m) / 2
        enough = len(spaced(path, spacing_m)) >= count
        low_m, high_m = (spacing_m, high_m) if enough else (low_m, spacing_m)
    return spaced(path, low_m)[:count]


def spaced(path: CandidatePath, spacing_m: float) -> list[int]:
    """Return which frames of a path a spacing takes."""
    policy = Spacing(spacing_m)
    for candidate in path.candidates:
        policy.observe(candidate)
    return list(policy.views)
