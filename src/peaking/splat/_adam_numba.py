# pyright: basic
"""A step of Adam on the CPU (Kingma and Ba 2015)."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from peaking.splat.optimiser import ADAM_BETAS, ADAM_EPSILON, MAX_GRADIENT

_B1, _B2 = ADAM_BETAS


@nb.njit(cache=True, parallel=True, error_model="numpy")
def adam_step(parameters, gradients, first_moment, second_moment, learning_rates, step):
    """Move `parameters` and update both moments, in place; `step` counts from 1."""
    one = np.float32(1)
    b1, b2 = np.float32(_B1), np.float32(_B2)
    limit, epsilon = np.float32(MAX_GRADIENT), np.float32(ADAM_EPSILON)
    c1 = np.float32(1 / (1 - _B1**step))
    c2 = np.float32(1 / (1 - _B2**step))
    for i in nb.prange(parameters.shape[0]):
        for c in range(parameters.shape[1]):
            g = gradients[i, c]
            g = g if abs(g) < limit else np.float32(0)
            m = b1 * first_moment[i, c] + (one - b1) * g
            s = b2 * second_moment[i, c] + (one - b2) * g * g
            first_moment[i, c] = m
            second_moment[i, c] = s
            parameters[i, c] -= learning_rates[c] * m * c1 / (math.sqrt(s * c2) + epsilon)
