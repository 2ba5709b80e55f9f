# pyright: basic
"""The comparison on the CPU; the same result as `_numpy.py`."""

from __future__ import annotations

import numba as nb
import numpy as np


def compare(rgba, live, gain, *, threshold, shift_px, min_alpha):
    """Compare; see `peaking.error_map.compare`."""
    height, width = live.shape[:2]
    error = np.empty((height, width), np.float32)
    over = np.empty((height, width), np.bool_)
    empty = np.empty((height, width), np.bool_)
    kernel = _compare_shifted if shift_px else _compare
    kernel(
        rgba,
        live,
        gain.astype(np.float32),
        np.float32(threshold),
        np.float32(min_alpha),
        error,
        over,
        empty,
    )
    return error, over, empty


@nb.njit(cache=True, fastmath=True, inline="always")
def _rendered(rgba, y, x, c, gain, norm):
    return min(max(rgba[y, x, c] * norm * gain[c], np.float32(0.0)), np.float32(1.0))


@nb.njit(cache=True, fastmath=True, parallel=True)
def _compare(rgba, live, gain, threshold, min_alpha, error, over, empty):
    height, width = error.shape
    unit = np.float32(1.0 / 255.0)
    for y in nb.prange(height):
        for x in range(width):
            alpha = rgba[y, x, 3]
            norm = np.float32(1.0) / alpha if alpha > np.float32(0.0) else np.float32(0.0)
            total = np.float32(0.0)
            for c in range(3):
                total += abs(
                    _rendered(rgba, y, x, c, gain, norm) - np.float32(live[y, x, c]) * unit
                )
            error[y, x] = total
            over[y, x] = total > threshold
            empty[y, x] = alpha < min_alpha


@nb.njit(cache=True, fastmath=True, inline="always")
def _prepare_row(rgba, y, gain, row):
    """Write a row of compensated straight colours, its ends repeated once."""
    width = rgba.shape[1]
    for x in range(width):
        alpha = rgba[y, x, 3]
        norm = np.float32(1.0) / alpha if alpha > np.float32(0.0) else np.float32(0.0)
        for c in range(3):
            row[c, x + 1] = _rendered(rgba, y, x, c, gain, norm)
    for c in range(3):
        row[c, 0] = row[c, 1]
        row[c, width + 1] = row[c, width]


@nb.njit(cache=True, fastmath=True, parallel=True)
def _compare_shifted(rgba, live, gain, threshold, min_alpha, error, over, empty):
    """Bands of rows, each with a ring of three prepared rows, so every row is prepared once."""
    height, width = error.shape
    unit = np.float32(1.0 / 255.0)
    bands = 8
    for band in nb.prange(bands):
        y0 = band * height // bands
        y1 = (band + 1) * height // bands
        ring = np.empty((3, 3, width + 2), np.float32)
        video = np.empty((3, width), np.float32)
        best = np.empty(width, np.float32)
        for y in range(y0 - 1, y0 + 1):
            _prepare_row(rgba, min(max(y, 0), height - 1), gain, ring[(y + 3) % 3])
        for y in range(y0, y1):
            _prepare_row(rgba, min(y + 1, height - 1), gain, ring[(y + 4) % 3])
            for x in range(width):
                for c in range(3):
                    video[c, x] = np.float32(live[y, x, c]) * unit
                best[x] = np.float32(9.0)
            for k in range(3):
                red, green, blue = ring[k, 0], ring[k, 1], ring[k, 2]
                for dx in range(3):
                    for x in range(width):
                        total = (
                            abs(red[x + dx] - video[0, x])
                            + abs(green[x + dx] - video[1, x])
                            + abs(blue[x + dx] - video[2, x])
                        )
                        best[x] = min(best[x], total)
            for x in range(width):
                error[y, x] = best[x]
                over[y, x] = best[x] > threshold
                empty[y, x] = rgba[y, x, 3] < min_alpha
