"""How complete a capture is, and whether more views help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from peaking.guidance.foresight import Foresight

Verdict = Literal["go on", "enough", "no more help"]

ENOUGH = 0.95
"""Score from which a capture is enough."""


def score(foreseen: Sequence[Foresight]) -> float:
    """Return how complete a capture is, 0…1: the mean of `Foresight.complete`.

    Args:
        foreseen: Pictures from where the photographer was, evenly in time.
    """
    return float(np.mean([each.complete for each in foreseen])) if foreseen else 0.0


def verdict(score: float, *, helps: bool) -> Verdict:
    """Say whether to go on.

    Args:
        score: How complete the capture is.
        helps: Whether there is a pose from which a view helps.
    """
    if score >= ENOUGH:
        return "enough"
    return "go on" if helps else "no more help"
