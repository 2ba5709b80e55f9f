# pyright: basic
"""What views foretell, on the CPU; the same result as `_foresight_numpy.py` but for rounding."""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.guidance._foresight_numpy import (
    ALIKE,
    FAR_RAD,
    HALF_SEEN,
    MOST,
    NEAR_RAD,
    NOISE,
    PRIOR,
    PRIOR_WEIGHT,
    WRONG,
)


@nb.njit(cache=True, error_model="numpy")
def foretell(rgba, depth_m, weights, distance_m):
    """Foretell; see `_foresight_numpy.foretell`."""
    views, height, width = depth_m.shape
    error = np.zeros((height, width), np.float32)
    seen_by = np.zeros((height, width), np.int32)
    alike = np.zeros((height, width), np.bool_)
    colour = np.empty((views, 3))
    apart = np.empty(views)
    share = np.empty(views)
    for y in range(height):
        for x in range(width):
            count = 0
            total = 0.0
            for k in range(views):
                alpha = rgba[k, y, x, 3]
                if alpha < HALF_SEEN:
                    continue
                for c in range(3):
                    colour[count, c] = rgba[k, y, x, c] / alpha
                away = distance_m[k] / depth_m[k, y, x]
                apart[count] = min(away, FAR_RAD) ** 2
                share[count] = weights[k]
                total += weights[k]
                count += 1
            seen_by[y, x] = count
            if count == 0:
                continue
            differ = PRIOR * PRIOR_WEIGHT
            squared = PRIOR_WEIGHT
            close = 0
            close_differ = 0.0
            spread = 0.0
            for k in range(count):
                spread += share[k] * apart[k] / total
                for other in range(k):
                    d = 0.0
                    for c in range(3):
                        d += (colour[k, c] - colour[other, c]) ** 2
                    d = max(d / 3 - NOISE, 0.0)
                    differ += d
                    squared += apart[k] + apart[other]
                    if apart[k] < NEAR_RAD**2 and apart[other] < NEAR_RAD**2:
                        close += 1
                        close_differ += d
            error[y, x] = min(differ / squared * spread, MOST)
            alike[y, x] = close > 0 and close_differ > ALIKE * WRONG * close
    return error, seen_by, alike
