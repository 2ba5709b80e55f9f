"""How complete a capture is, and whether more views help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from peaking.geometry import Camera
from peaking.guidance.foresight import Foresight

Verdict = Literal["go on", "enough", "no more help"]

ENOUGH = 0.93
"""Score from which a capture is enough."""


BESIDE = 12
"""All that is beside the walk counts as much as so many places of it: who has hardly moved yet has
not seen a place."""


@dataclass(frozen=True)
class Scored:
    """A picture that the score is of.

    Attributes:
        camera: Where from.
        foresight: What is foreseen of it.
        weight: How much it counts.
    """

    camera: Camera
    foresight: Foresight
    weight: float = 1.0

    @property
    def missing(self) -> float:
        """How much of it is missing and can be mended by views, 0…1."""
        foreseen = self.foresight
        bad = foreseen.new + foreseen.wrong
        return (1.0 - foreseen.complete) * foreseen.help / bad if bad > 0 else 0.0


def scored(
    walked: Sequence[tuple[Camera, Foresight]], beside: Sequence[tuple[Camera, Foresight]] = ()
) -> list[Scored]:
    """Return the pictures that a score is of, with their weights.

    Args:
        walked: From where the photographer was, evenly in time.
        beside: A step from there.
    """
    each = BESIDE / max(len(beside), 1)
    return [
        *(Scored(camera, foresight) for camera, foresight in walked),
        *(Scored(camera, foresight, each) for camera, foresight in beside),
    ]


def score(pictures: Sequence[Scored]) -> float:
    """Return how complete a capture is, 0…1: the mean of `Foresight.complete`."""
    if not pictures:
        return 0.0
    weights = [each.weight for each in pictures]
    return float(np.average([each.foresight.complete for each in pictures], weights=weights))


def verdict(score: float, *, helps: bool) -> Verdict:
    """Say whether to go on.

    Args:
        score: How complete the capture is.
        helps: Whether there is a pose from which a view helps.
    """
    if score >= ENOUGH:
        return "enough"
    return "go on" if helps else "no more help"
