# pyright: basic
"""Tiles of 16×16 pixels: which ellipses touch them, near to far; compositing and its gradient.

Rows of a tile are worked on as vectors of 16 pixels: no branch inside, exp as a polynomial. Each
(tile, Gaussian) entry has its own row of gradients, kept in the order of Gaussians, so that summing
needs no atomics and gives the same bits for every number of threads.
"""

from __future__ import annotations

import numba as nb
import numpy as np

TILE_WIDTH_PX = 16
TILE_HEIGHT_PX = 16
W = TILE_WIDTH_PX
LOWEST_POWER = -30.0
"""exp is a polynomial, good to 4e-6 above -6 and never below 0; less than e^-30 is nothing."""


@nb.njit(cache=True)
def _span(center, radius, size, tiles):
    first = max(0, int(np.floor((center - radius) / size)))
    last = min(tiles - 1, int(np.floor((center + radius) / size)))
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
        x0, x1 = _span(splats[i, 0], splats[i, 10], TILE_WIDTH_PX, columns)
        y0, y1 = _span(splats[i, 1], splats[i, 11], TILE_HEIGHT_PX, rows)
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
        x0, x1 = _span(splats[i, 0], splats[i, 10], TILE_WIDTH_PX, columns)
        y0, y1 = _span(splats[i, 1], splats[i, 11], TILE_HEIGHT_PX, rows)
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


@nb.njit(cache=True, inline="always")
def _reaches(a, b, c, dx, dy, lowest):
    """Say whether a row of pixels, from dx to the right, meets the ellipse."""
    nearest = min(dx, max(dx - np.float32(TILE_WIDTH_PX - 1), -b * dy / (a + a)))
    return (a * nearest + b * dy) * nearest + c * dy * dy >= lowest


@nb.njit(cache=True, parallel=True, fastmath=True, error_model="numpy")
def composite(tile_order, tile_starts, entries, splats, background, limits, picture, left, last):
    """Fill `picture` (r, g, b, depth × weight), transmittance and one past the last entry.

    `limits`: smallest and largest alpha, and the transmittance that no pixel falls below: what
    would take it there is left out, and so is all behind.
    """
    height, width = left.shape
    columns = (width + TILE_WIDTH_PX - 1) // TILE_WIDTH_PX
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max, opaque = limits[0], limits[1], limits[2]
    for place in nb.prange(tile_order.size):
        t = tile_order[place]
        y0 = (t // columns) * TILE_HEIGHT_PX
        x0 = (t % columns) * TILE_WIDTH_PX
        x_half = np.float32(x0) + half
        # Rows of: through (0 where the pixel is done), colour, depth, end, left over in the end.
        state = np.zeros((TILE_HEIGHT_PX, 7, W), splats.dtype)
        for j in range(TILE_HEIGHT_PX):
            for i in range(W):
                state[j, 0, i] = 1
                state[j, 6, i] = 1
        for k in range(tile_starts[t], tile_starts[t + 1]):
            if (k - tile_starts[t]) % 32 == 31:
                most = zero
                for j in range(TILE_HEIGHT_PX):
                    for i in range(W):
                        most = max(most, state[j, 0, i])
                if most <= zero:
                    break
            s = splats[entries[k]]
            u = s[0] - x_half
            v = s[1]
            a = -half * s[2]
            b = -s[3]
            c = -half * s[4]
            opacity, red, green, blue, depth, lowest = s[5], s[6], s[7], s[8], s[9], s[12]
            j0 = max(0, int(v - s[11]) - y0)
            j1 = min(TILE_HEIGHT_PX, int(v + s[11]) + 1 - y0)
            end = splats.dtype.type(k + 1 - tile_starts[t])
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                if not _reaches(a, b, c, u, dy, lowest):
                    continue
                cy = c * dy * dy
                by = b * dy
                for i in range(W):
                    dx = u - np.float32(i)
                    alpha = min(alpha_max, opacity * _exp(a * dx * dx + by * dx + cy))
                    t0 = state[j, 0, i]
                    alpha = alpha if alpha >= alpha_min else zero
                    done = t0 - alpha * t0 < opaque
                    alpha = zero if done else alpha
                    w = alpha * t0
                    state[j, 1, i] += w * red
                    state[j, 2, i] += w * green
                    state[j, 3, i] += w * blue
                    state[j, 4, i] += w * depth
                    state[j, 6, i] -= w
                    state[j, 0, i] = zero if done else t0 - w
                    state[j, 5, i] = end if alpha > zero else state[j, 5, i]
        for j in range(min(TILE_HEIGHT_PX, height - y0)):
            for i in range(min(TILE_WIDTH_PX, width - x0)):
                t0 = state[j, 6, i]
                for c in range(3):
                    picture[y0 + j, x0 + i, c] = state[j, c + 1, i] + t0 * background[c]
                picture[y0 + j, x0 + i, 3] = state[j, 4, i]
                left[y0 + j, x0 + i] = t0
                last[y0 + j, x0 + i] = np.int32(state[j, 5, i])


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
    columns = (width + TILE_WIDTH_PX - 1) // TILE_WIDTH_PX
    one = np.float32(1)
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max = limits[0], limits[1]
    for place in nb.prange(tile_order.size):
        t = tile_order[place]
        y0 = (t // columns) * TILE_HEIGHT_PX
        x0 = (t % columns) * TILE_WIDTH_PX
        x_half = np.float32(x0) + half
        # Rows of: through, behind, gradients by red, green and blue, end; then the sums by column.
        state = np.zeros((TILE_HEIGHT_PX, 6, W), splats.dtype)
        sums = np.zeros((7, W), splats.dtype)
        furthest = 0
        for j in range(TILE_HEIGHT_PX):
            for i in range(W):
                state[j, 0, i] = 1
        for j in range(min(TILE_HEIGHT_PX, height - y0)):
            for i in range(min(TILE_WIDTH_PX, width - x0)):
                state[j, 0, i] = left[y0 + j, x0 + i]
                state[j, 5, i] = last[y0 + j, x0 + i]
                furthest = max(furthest, last[y0 + j, x0 + i])
                for c in range(3):
                    g = by_picture[y0 + j, x0 + i, c]
                    state[j, 2 + c, i] = g
                    state[j, 1, i] += left[y0 + j, x0 + i] * background[c] * g
        for k in range(tile_starts[t] + furthest, tile_starts[t + 1]):
            for c in range(9):
                by_entry[slots[k], c] = 0
        for k in range(tile_starts[t] + furthest - 1, tile_starts[t] - 1, -1):
            s = splats[entries[k]]
            u = s[0] - x_half
            v = s[1]
            q0, q1, q2 = s[2], s[3], s[4]
            a = -half * q0
            b = -q1
            c = -half * q2
            opacity, red, green, blue, lowest = s[5], s[6], s[7], s[8], s[12]
            j0 = max(0, int(v - s[11]) - y0)
            j1 = min(TILE_HEIGHT_PX, int(v + s[11]) + 1 - y0)
            index = splats.dtype.type(k - tile_starts[t])
            sums[:] = 0
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                if not _reaches(a, b, c, u, dy, lowest):
                    continue
                cy = c * dy * dy
                by_row = b * dy
                for i in range(W):
                    dx = u - np.float32(i)
                    e = _exp(a * dx * dx + by_row * dx + cy)
                    raw = opacity * e
                    alpha = min(alpha_max, raw)
                    counts = alpha >= alpha_min and index < state[j, 5, i]
                    alpha = alpha if counts else zero
                    inverse = one / (one - alpha)
                    t0 = state[j, 0, i] * inverse
                    state[j, 0, i] = t0
                    w = alpha * t0
                    d0 = state[j, 2, i]
                    d1 = state[j, 3, i]
                    d2 = state[j, 4, i]
                    own = red * d0 + green * d1 + blue * d2
                    rest = state[j, 1, i]
                    by_alpha = t0 * own - rest * inverse
                    state[j, 1, i] = rest + w * own
                    by_alpha = by_alpha if (counts and raw <= alpha_max) else zero
                    sums[0, i] += w * d0
                    sums[1, i] += w * d1
                    sums[2, i] += w * d2
                    sums[3, i] += by_alpha * e
                    by_power = by_alpha * alpha
                    sums[4, i] += by_power
                    sums[5, i] += by_power * dy
                    sums[6, i] += by_power * dy * dy
            g0 = zero
            g1 = zero
            g2 = zero
            g3 = zero
            m00 = zero
            m10 = zero
            m20 = zero
            m01 = zero
            m11 = zero
            m02 = zero
            for i in range(W):
                dx = u - np.float32(i)
                g0 += sums[0, i]
                g1 += sums[1, i]
                g2 += sums[2, i]
                g3 += sums[3, i]
                p0 = sums[4, i]
                p1 = sums[5, i]
                m00 += p0
                m10 += p0 * dx
                m20 += p0 * dx * dx
                m01 += p1
                m11 += p1 * dx
                m02 += sums[6, i]
            out = by_entry[slots[k]]
            out[0] = g0
            out[1] = g1
            out[2] = g2
            out[3] = g3
            out[4] = -q0 * m10 - q1 * m01
            out[5] = -q2 * m01 - q1 * m10
            out[6] = -half * m20
            out[7] = -m11
            out[8] = -half * m02
