# pyright: basic
"""Blending on the CPU in one pass; the same result as `blending.py`'s NumPy."""

from __future__ import annotations

import numba as nb
import numpy as np


def blend(rgba, depth_m, weights, seen):
    """Blend; see `peaking.rendering.blending.blend`."""
    height, width = depth_m.shape[1:]
    out = np.empty((height, width, 4), np.float32)
    out_depth_m = np.empty((height, width), np.float32)
    _blend(rgba, depth_m, weights, seen, out, out_depth_m)
    return out, out_depth_m


@nb.njit(cache=True, fastmath=True, parallel=True)
def _blend(rgba, depth_m, weights, seen, out, out_depth_m):
    views, height, width = depth_m.shape
    one = np.float32(1.0)
    for y in nb.prange(height):
        for x in range(width):
            r = np.float32(0.0)
            g = np.float32(0.0)
            b = np.float32(0.0)
            z = np.float32(0.0)
            total = np.float32(0.0)
            most = np.float32(0.0)
            for k in range(views):
                w = weights[k]
                alpha = rgba[k, y, x, 3]
                r += w * rgba[k, y, x, 0]
                g += w * rgba[k, y, x, 1]
                b += w * rgba[k, y, x, 2]
                z += w * alpha * depth_m[k, y, x]
                total += w * alpha
                most = max(most, alpha)
            if total > np.float32(0.0):
                norm = one / total
                alpha = most if seen else min(total, one)
                gain = norm * alpha
                out[y, x, 0] = r * gain
                out[y, x, 1] = g * gain
                out[y, x, 2] = b * gain
                out[y, x, 3] = alpha
                out_depth_m[y, x] = z * norm
            else:
                for c in range(4):
                    out[y, x, c] = np.float32(0.0)
                out_depth_m[y, x] = np.float32(0.0)
