# pyright: basic
"""Tiles of 16×16 pixels: which ellipses touch them, near to far; compositing and its gradient.

Rows of a tile are worked on as vectors of 16 pixels: no branch inside, exp as a polynomial. Each
(tile, Gaussian) entry has its own row of gradients, kept in the order of Gaussians, so that summing
needs no atomics and gives the same bits for every number of threads.
"""

from __future__ import annotations

import numba as nb
import numpy as np

TILE_PX = 16
LOWEST_POWER = -30.0
"""exp is a polynomial, good to 4e-6 above -6 and never below 0; less than e^-30 is nothing."""


@nb.njit(cache=True)
def _span(center, radius, tiles):
    first = max(0, int(np.floor((center - radius) / TILE_PX)))
    last = min(tiles - 1, int(np.floor((center + radius) / TILE_PX)))
    return first, last


@nb.njit(cache=True)
def bin_tiles(order, splats, columns, rows):
    """Return per tile the Gaussians, near to far, and where each entry's gradients belong.

    `tile_starts[t] : tile_starts[t + 1]` are the entries of tile t; `entries` are Gaussians,
    `slots` places in the order of Gaussians, `starts` where each Gaussian's places begin.
    """
    tile_starts = np.zeros(rows * columns + 1, np.int64)
    starts = np.zeros(splats.shape[0] + 1, np.int64)
    for i in order:
        x0, x1 = _span(splats[i, 0], splats[i, 10], columns)
        y0, y1 = _span(splats[i, 1], splats[i, 11], rows)
        starts[i + 1] = max(0, x1 - x0 + 1) * max(0, y1 - y0 + 1)
        for ty in range(y0, y1 + 1):
            for tx in range(x0, x1 + 1):
                tile_starts[ty * columns + tx + 1] += 1
    tile_starts = np.cumsum(tile_starts)
    starts = np.cumsum(starts)
    entries = np.empty(tile_starts[-1], np.int32)
    slots = np.empty(tile_starts[-1], np.int32)
    cursor = tile_starts[:-1].copy()
    for i in order:
        x0, x1 = _span(splats[i, 0], splats[i, 10], columns)
        y0, y1 = _span(splats[i, 1], splats[i, 11], rows)
        slot = starts[i]
        for ty in range(y0, y1 + 1):
            for tx in range(x0, x1 + 1):
                t = ty * columns + tx
                entries[cursor[t]] = i
                slots[cursor[t]] = slot
                cursor[t] += 1
                slot += 1
    return tile_starts, entries, slots, starts


@nb.njit(cache=True, inline="always")
def _exp(power):
    one = np.float32(1)
    q = max(power, np.float32(LOWEST_POWER)) * np.float32(1 / 64)
    e = one + q * (one + q * (np.float32(0.5) + q * (np.float32(1 / 6) + q * np.float32(1 / 24))))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@nb.njit(cache=True, parallel=True, fastmath=True, error_model="numpy")
def composite(tile_order, tile_starts, entries, splats, background, limits, picture, left, last):
    """Fill `picture` (r, g, b, depth × weight), transmittance and one past the last entry.

    `limits`: smallest and largest alpha, and the transmittance below which a pixel is done.
    """
    height, width = left.shape
    columns = (width + TILE_PX - 1) // TILE_PX
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max, opaque = limits[0], limits[1], limits[2]
    for place in nb.prange(tile_order.size):
        t = tile_order[place]
        y0 = (t // columns) * TILE_PX
        x0 = (t % columns) * TILE_PX
        x_half = np.float32(x0) + half
        through = np.ones((TILE_PX, TILE_PX), splats.dtype)
        out = np.zeros((4, TILE_PX, TILE_PX), splats.dtype)
        ends = np.zeros((TILE_PX, TILE_PX), np.int32)
        for k in range(tile_starts[t], tile_starts[t + 1]):
            if (k - tile_starts[t]) % 32 == 31 and through.max() < opaque:
                break
            s = splats[entries[k]]
            u = s[0] - x_half
            v = s[1]
            a = -half * s[2]
            b = -s[3]
            c = -half * s[4]
            opacity, red, green, blue, depth = s[5], s[6], s[7], s[8], s[9]
            j0 = max(0, int(v - s[11]) - y0)
            j1 = min(TILE_PX, int(v + s[11]) + 1 - y0)
            end = np.int32(k + 1)
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                cy = c * dy * dy
                by = b * dy
                for i in range(TILE_PX):
                    dx = u - np.float32(i)
                    alpha = min(alpha_max, opacity * _exp(a * dx * dx + by * dx + cy))
                    t0 = through[j, i]
                    alpha = alpha if (alpha >= alpha_min and t0 >= opaque) else zero
                    w = alpha * t0
                    out[0, j, i] += w * red
                    out[1, j, i] += w * green
                    out[2, j, i] += w * blue
                    out[3, j, i] += w * depth
                    through[j, i] = t0 - w
                    ends[j, i] = end if alpha > zero else ends[j, i]
        for j in range(min(TILE_PX, height - y0)):
            for i in range(min(TILE_PX, width - x0)):
                t0 = through[j, i]
                for c in range(3):
                    picture[y0 + j, x0 + i, c] = out[c, j, i] + t0 * background[c]
                picture[y0 + j, x0 + i, 3] = out[3, j, i]
                left[y0 + j, x0 + i] = t0
                last[y0 + j, x0 + i] = ends[j, i]


@nb.njit(cache=True, parallel=True, fastmath=True, error_model="numpy")
def composite_backward(
    tile_order,
    tile_starts,
    entries,
    slots,
    splats,
    background,
    limits,
    left,
    last,
    by_picture,
    by_entry,
):
    """Fill `by_entry` (all rows) from the loss's gradient by r, g, b of every pixel."""
    height, width = left.shape
    columns = (width + TILE_PX - 1) // TILE_PX
    one = np.float32(1)
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max = limits[0], limits[1]
    for place in nb.prange(tile_order.size):
        t = tile_order[place]
        y0 = (t // columns) * TILE_PX
        x0 = (t % columns) * TILE_PX
        x_half = np.float32(x0) + half
        through = np.ones((TILE_PX, TILE_PX), splats.dtype)
        behind = np.zeros((TILE_PX, TILE_PX), splats.dtype)
        by = np.zeros((3, TILE_PX, TILE_PX), splats.dtype)
        ends = np.zeros((TILE_PX, TILE_PX), np.int32)
        furthest = np.int32(0)
        for j in range(min(TILE_PX, height - y0)):
            for i in range(min(TILE_PX, width - x0)):
                through[j, i] = left[y0 + j, x0 + i]
                ends[j, i] = last[y0 + j, x0 + i]
                furthest = max(furthest, ends[j, i])
                for c in range(3):
                    by[c, j, i] = by_picture[y0 + j, x0 + i, c]
                    behind[j, i] += through[j, i] * background[c] * by[c, j, i]
        for k in range(tile_starts[t], tile_starts[t + 1]):
            if k >= furthest:
                for c in range(9):
                    by_entry[slots[k], c] = 0
        for k in range(min(np.int64(furthest), tile_starts[t + 1]) - 1, tile_starts[t] - 1, -1):
            s = splats[entries[k]]
            u = s[0] - x_half
            v = s[1]
            q0, q1, q2 = s[2], s[3], s[4]
            a = -half * q0
            b = -q1
            c = -half * q2
            opacity, red, green, blue = s[5], s[6], s[7], s[8]
            j0 = max(0, int(v - s[11]) - y0)
            j1 = min(TILE_PX, int(v + s[11]) + 1 - y0)
            index = np.int32(k)
            g0 = zero
            g1 = zero
            g2 = zero
            g3 = zero
            g4 = zero
            g5 = zero
            g6 = zero
            g7 = zero
            g8 = zero
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                cy = c * dy * dy
                by_row = b * dy
                m0 = zero
                m1 = zero
                m2 = zero
                for i in range(TILE_PX):
                    dx = u - np.float32(i)
                    e = _exp(a * dx * dx + by_row * dx + cy)
                    raw = opacity * e
                    alpha = min(alpha_max, raw)
                    counts = alpha >= alpha_min and index < ends[j, i]
                    alpha = alpha if counts else zero
                    inverse = one / (one - alpha)
                    t0 = through[j, i] * inverse
                    through[j, i] = t0
                    w = alpha * t0
                    d0 = by[0, j, i]
                    d1 = by[1, j, i]
                    d2 = by[2, j, i]
                    own = red * d0 + green * d1 + blue * d2
                    rest = behind[j, i]
                    by_alpha = t0 * own - rest * inverse
                    behind[j, i] = rest + w * own
                    by_alpha = by_alpha if (counts and raw <= alpha_max) else zero
                    g0 += w * d0
                    g1 += w * d1
                    g2 += w * d2
                    g3 += by_alpha * e
                    by_power = by_alpha * alpha
                    m0 += by_power
                    m1 += by_power * dx
                    m2 += by_power * dx * dx
                g4 -= q0 * m1 + q1 * dy * m0
                g5 -= q2 * dy * m0 + q1 * m1
                g6 -= half * m2
                g7 -= dy * m1
                g8 -= half * dy * dy * m0
            row = by_entry[slots[k]]
            row[0] = g0
            row[1] = g1
            row[2] = g2
            row[3] = g3
            row[4] = g4
            row[5] = g5
            row[6] = g6
            row[7] = g7
            row[8] = g8
