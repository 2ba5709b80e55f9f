# pyright: basic
"""A kernel that does nothing but read."""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, parallel=True)
def read_all(block):
    """Return the sum of a block, read by all cores."""
    total = np.uint64(0)
    for i in nb.prange(block.shape[0]):
        total += block[i]
    return total
