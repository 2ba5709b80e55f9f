"""How complete a capture is, and whether more views help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from peaking.guidance.foresight import Foresight

Verdict = Literal["go on", "enough", "no more help"]

ENOUGH = 0.93
"""Score from which a capture is enough."""


BESIDE = 12
"""All that is beside the walk counts as much as so many places of it: who has hardly moved yet has
not seen a place."""


def score(walked: Sequence[Foresight], beside: Sequence[Foresight] = ()) -> float:
    """Return how complete a capture is, 0…1: the mean of `Foresight.complete`.

    Args:
        walked: Pictures from where the photographer was, evenly in time.
        beside: A step from there.
    """
    values = [each.complete for each in walked]
    weights = [1.0] * len(walked)
    if beside:
        values.append(float(np.mean([each.complete for each in beside])))
        weights.append(float(BESIDE))
    return float(np.average(values, weights=weights)) if values else 0.0


def verdict(score: float, *, helps: bool) -> Verdict:
    """Say whether to go on.

    Args:
        score: How complete the capture is.
        helps: Whether there is a pose from which a view helps.
    """
    if score >= ENOUGH:
        return "enough"
    return "go on" if helps else "no more help"
