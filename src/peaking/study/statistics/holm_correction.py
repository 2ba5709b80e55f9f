"""Holm's correction of the p-values of a family."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values that may be held against alpha as they are, in the order given.

    The chance of one or more false positives in the family stays at most alpha (Holm, *A simple
    sequentially rejective multiple test procedure*, 1979).

    Raises:
        ValueError: A p-value is not in 0…1.
    """
    for p in p_values:
        if not 0 <= p <= 1:
            raise ValueError(f"need p-values in 0…1, got {p}")
    if not p_values:
        return []
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    corrected = np.empty_like(p)
    corrected[order] = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return np.minimum(corrected, 1.0).tolist()
