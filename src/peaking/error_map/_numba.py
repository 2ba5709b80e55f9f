# pyright: basic
"""The comparison on the CPU; the same result as `_numpy.py`."""

from __future__ import annotations

import numba as nb
import numpy as np

BANDS = 8
"""Rows are cut into so many bands, each with rings of three prepared rows."""


def compare(rgba, live, gain, falloff, *, threshold, shift_px, min_alpha):
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
        falloff,
        np.float32(threshold),
        np.float32(min_alpha),
        np.float32(shift_px),
        error,
        over,
        empty,
    )
    return error, over, empty


@nb.njit(cache=True, fastmath=True, inline="always")
def _rendered(rgba, y, x, c, gain, norm):
    return min(max(rgba[y, x, c] * norm * gain, np.float32(0.0)), np.float32(1.0))


@nb.njit(cache=True, fastmath=True, parallel=True)
def _compare(rgba, live, gain, falloff, threshold, min_alpha, shift, error, over, empty):
    height, width = error.shape
    unit = np.float32(1.0 / 255.0)
    for y in nb.prange(height):
        for x in range(width):
            alpha = rgba[y, x, 3]
            norm = np.float32(1.0) / alpha if alpha > np.float32(0.0) else np.float32(0.0)
            total = np.float32(0.0)
            for c in range(3):
                ours = _rendered(rgba, y, x, c, gain[c] * falloff[y, x], norm)
                total += abs(ours - np.float32(live[y, x, c]) * unit)
            error[y, x] = total
            over[y, x] = total > threshold
            empty[y, x] = alpha < min_alpha


@nb.njit(cache=True, fastmath=True, inline="always")
def _prepare_row(rgba, live, y, gain, falloff, ours, theirs):
    """Write a row of both pictures, the rendering's compensated; their ends are repeated once."""
    width = rgba.shape[1]
    unit = np.float32(1.0 / 255.0)
    for x in range(width):
        alpha = rgba[y, x, 3]
        norm = np.float32(1.0) / alpha if alpha > np.float32(0.0) else np.float32(0.0)
        for c in range(3):
            ours[c, x + 1] = _rendered(rgba, y, x, c, gain[c] * falloff[y, x], norm)
            theirs[c, x + 1] = np.float32(live[y, x, c]) * unit
    for c in range(3):
        ours[c, 0] = ours[c, 1]
        ours[c, width + 1] = ours[c, width]
        theirs[c, 0] = theirs[c, 1]
        theirs[c, width + 1] = theirs[c, width]


@nb.njit(cache=True, fastmath=True, inline="always")
def _least(above, middle, below, still, shift, mixed, least):
    """Write the least L1 of a row, displaced in nine ways, to the middle of another one."""
    width = len(least)
    keep = np.float32(1.0) - shift
    for x in range(width):
        least[x] = np.float32(9.0)
    for dy in range(3):
        other = above if dy == 0 else below
        for c in range(3):
            for x in range(width + 2):
                if dy == 1:
                    mixed[c, x] = middle[c, x]
                else:
                    mixed[c, x] = keep * middle[c, x] + shift * other[c, x]
        red, green, blue = mixed[0], mixed[1], mixed[2]
        for dx in range(-1, 2):
            part = shift if dx != 0 else np.float32(0.0)
            rest = np.float32(1.0) - part
            for x in range(width):
                total = (
                    abs(rest * red[x + 1] + part * red[x + 1 + dx] - still[0, x + 1])
                    + abs(rest * green[x + 1] + part * green[x + 1 + dx] - still[1, x + 1])
                    + abs(rest * blue[x + 1] + part * blue[x + 1 + dx] - still[2, x + 1])
                )
                least[x] = min(least[x], total)


@nb.njit(cache=True, fastmath=True, parallel=True)
def _compare_shifted(rgba, live, gain, falloff, threshold, min_alpha, shift, error, over, empty):
    height, width = error.shape
    for band in nb.prange(BANDS):
        y0 = band * height // BANDS
        y1 = (band + 1) * height // BANDS
        ours = np.empty((3, 3, width + 2), np.float32)
        theirs = np.empty((3, 3, width + 2), np.float32)
        mixed = np.empty((3, width + 2), np.float32)
        one = np.empty(width, np.float32)
        other = np.empty(width, np.float32)
        for y in range(y0 - 1, y0 + 1):
            at = (y + 3) % 3
            row = min(max(y, 0), height - 1)
            _prepare_row(rgba, live, row, gain, falloff, ours[at], theirs[at])
        for y in range(y0, y1):
            at = (y + 4) % 3
            row = min(y + 1, height - 1)
            _prepare_row(rgba, live, row, gain, falloff, ours[at], theirs[at])
            above, middle, below = (y + 2) % 3, y % 3, (y + 1) % 3
            _least(ours[above], ours[middle], ours[below], theirs[middle], shift, mixed, one)
            _least(theirs[above], theirs[middle], theirs[below], ours[middle], shift, mixed, other)
            for x in range(width):
                worst = max(one[x], other[x])
                error[y, x] = worst
                over[y, x] = worst > threshold
                empty[y, x] = rgba[y, x, 3] < min_alpha
