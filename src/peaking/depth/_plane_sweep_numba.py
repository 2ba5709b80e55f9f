# pyright: basic
"""How much two pictures differ when one is warped onto the other through a plane."""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, parallel=True, error_model="numpy")
def plane_differences(photo, other, other_from_here, out):
    """Fill `out` (planes, h, w) with mean absolute differences of colours; 1 outside `other`.

    `other_from_here` (planes, 3, 3) are homographies between pixels with corner origin.
    """
    height, width = photo.shape[:2]
    other_height, other_width = other.shape[:2]
    one = np.float32(1)
    for p in nb.prange(out.shape[0]):
        h = other_from_here[p]
        for y in range(height):
            for x in range(width):
                cx = x + 0.5
                cy = y + 0.5
                w = h[2, 0] * cx + h[2, 1] * cy + h[2, 2]
                u = (h[0, 0] * cx + h[0, 1] * cy + h[0, 2]) / w - 0.5
                v = (h[1, 0] * cx + h[1, 1] * cy + h[1, 2]) / w - 0.5
                out[p, y, x] = one
                if w > 0 and u >= 0 and v >= 0 and u < other_width - 1 and v < other_height - 1:
                    i = int(u)
                    j = int(v)
                    a = np.float32(u - i)
                    b = np.float32(v - j)
                    total = np.float32(0)
                    for c in range(3):
                        top = other[j, i, c] * (one - a) + other[j, i + 1, c] * a
                        low = other[j + 1, i, c] * (one - a) + other[j + 1, i + 1, c] * a
                        total += abs(top * (one - b) + low * b - photo[y, x, c])
                    out[p, y, x] = total / np.float32(3)
