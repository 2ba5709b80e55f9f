"""Some of many, evenly spaced."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def evenly(many: Sequence[T], count: int) -> list[T]:
    """Return at most so many of a sequence, from its first to its last."""
    places = np.linspace(0, len(many) - 1, min(count, len(many))).round()
    return [many[int(place)] for place in places]
