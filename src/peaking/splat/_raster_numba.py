# pyright: basic
"""Tiles of 16×16 pixels: which ellipses touch them, near to far; compositing and its gradient.

Rows of a tile are worked on as vectors of 16 pixels: no branch inside, exp as a polynomial. Each
(tile, Gaussian) entry has its own row of gradients, kept in the order of Gaussians, so that summing
needs no atomics and gives the same bits for every number of threads.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.splat.columns import (
    BLUE,
    BY_BLUE,
    BY_CONIC_UU,
    BY_CONIC_UV,
    BY_CONIC_VV,
    BY_GREEN,
    BY_OPACITY,
    BY_RED,
    BY_U,
    BY_V,
    CONIC_UU,
    CONIC_UV,
    CONIC_VV,
    DEPTH,
    GREEN,
    MIN_POWER,
    NUM_ENTRY_COLUMNS,
    OPACITY,
    RADIUS_U,
    RADIUS_V,
    RED,
    U,
    V,
)

TILE_WIDTH_PX = 16
TILE_HEIGHT_PX = 16
MIN_EXP_POWER = -30.0
"""exp is a polynomial, good to 4e-6 above -6 and never below 0; less than e^-30 is nothing."""

# What `composite` keeps of each pixel of a tile.
_OPEN = 0
"""Transmittance so far; 0 once the pixel is done."""
_SUM_RED, _SUM_GREEN, _SUM_BLUE, _SUM_DEPTH = 1, 2, 3, 4
_END = 5
"""One past the last entry that was drawn there."""
_TRANSMITTANCE = 6
"""What shines through in the end."""
_NUM_COMPOSITE_ROWS = 7

# What `composite_backward` keeps of each pixel of a tile.
_BEFORE = 0
"""Transmittance before the entry that is looked at."""
_BEHIND = 1
"""Colour of all behind it, times the gradient by the pixel's colour."""
_BY_PIXEL_RED, _BY_PIXEL_GREEN, _BY_PIXEL_BLUE = 2, 3, 4
_STOP = 5
"""`_END` of `composite`."""
_NUM_BACKWARD_ROWS = 6

# What `composite_backward` sums up in each column of a tile, after `BY_RED` to `BY_OPACITY`.
_SUM_POWER, _SUM_POWER_DY, _SUM_POWER_DY2 = 4, 5, 6
_NUM_SUMS = 7


@nb.njit(cache=True)
def _span(center, radius, size, tiles):
    first = max(0, int(np.floor((center - radius) / size)))
    last = min(tiles - 1, int(np.floor((center + radius) / size)))
    return first, last


@nb.njit(cache=True)
def bin_tiles(order, splats, columns, rows):
    """Return the Gaussians of each tile, near to far, and the row of each entry's gradients.

    Tile t has the entries `tile_starts[t] : tile_starts[t + 1]`. An entry is the number of a
    Gaussian (`entries`) and its row of gradients (`slots`); Gaussian i has the rows
    `starts[i] : starts[i + 1]`.
    """
    tile_starts = np.zeros(rows * columns + 1, np.int64)
    starts = np.zeros(splats.shape[0] + 1, np.int64)
    for i in order:
        x0, x1 = _span(splats[i, U], splats[i, RADIUS_U], TILE_WIDTH_PX, columns)
        y0, y1 = _span(splats[i, V], splats[i, RADIUS_V], TILE_HEIGHT_PX, rows)
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
        x0, x1 = _span(splats[i, U], splats[i, RADIUS_U], TILE_WIDTH_PX, columns)
        y0, y1 = _span(splats[i, V], splats[i, RADIUS_V], TILE_HEIGHT_PX, rows)
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
    q = max(power, np.float32(MIN_EXP_POWER)) * np.float32(1 / 64)
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
def composite(
    tile_order,
    tile_starts,
    entries,
    splats,
    background,
    limits,
    image,
    transmittance,
    ends,
):
    """Fill `image` (r, g, b, depth × weight), `transmittance`, and `ends`: one past the last entry.

    `limits` are the smallest and the largest alpha, and the least transmittance of a pixel: the
    Gaussian that would go below it is left out, and so are all behind it.
    """
    height, width = transmittance.shape
    columns = (width + TILE_WIDTH_PX - 1) // TILE_WIDTH_PX
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max, min_transmittance = limits[0], limits[1], limits[2]
    for n in nb.prange(tile_order.size):
        t = tile_order[n]
        y0 = (t // columns) * TILE_HEIGHT_PX
        x0 = (t % columns) * TILE_WIDTH_PX
        x_half = np.float32(x0) + half
        state = np.zeros((TILE_HEIGHT_PX, _NUM_COMPOSITE_ROWS, TILE_WIDTH_PX), splats.dtype)
        for j in range(TILE_HEIGHT_PX):
            for i in range(TILE_WIDTH_PX):
                state[j, _OPEN, i] = 1
                state[j, _TRANSMITTANCE, i] = 1
        for k in range(tile_starts[t], tile_starts[t + 1]):
            if (k - tile_starts[t]) % 32 == 31:
                most = zero
                for j in range(TILE_HEIGHT_PX):
                    for i in range(TILE_WIDTH_PX):
                        most = max(most, state[j, _OPEN, i])
                if most <= zero:
                    break
            s = splats[entries[k]]
            u = s[U] - x_half
            v = s[V]
            a = -half * s[CONIC_UU]
            b = -s[CONIC_UV]
            c = -half * s[CONIC_VV]
            opacity, red, green, blue = s[OPACITY], s[RED], s[GREEN], s[BLUE]
            depth, lowest = s[DEPTH], s[MIN_POWER]
            j0 = max(0, int(v - s[RADIUS_V]) - y0)
            j1 = min(TILE_HEIGHT_PX, int(v + s[RADIUS_V]) + 1 - y0)
            end = splats.dtype.type(k + 1 - tile_starts[t])
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                if not _reaches(a, b, c, u, dy, lowest):
                    continue
                cy = c * dy * dy
                by = b * dy
                for i in range(TILE_WIDTH_PX):
                    dx = u - np.float32(i)
                    alpha = min(alpha_max, opacity * _exp(a * dx * dx + by * dx + cy))
                    t0 = state[j, _OPEN, i]
                    alpha = alpha if alpha >= alpha_min else zero
                    done = t0 - alpha * t0 < min_transmittance
                    alpha = zero if done else alpha
                    w = alpha * t0
                    state[j, _SUM_RED, i] += w * red
                    state[j, _SUM_GREEN, i] += w * green
                    state[j, _SUM_BLUE, i] += w * blue
                    state[j, _SUM_DEPTH, i] += w * depth
                    state[j, _TRANSMITTANCE, i] -= w
                    state[j, _OPEN, i] = zero if done else t0 - w
                    state[j, _END, i] = end if alpha > zero else state[j, _END, i]
        for j in range(min(TILE_HEIGHT_PX, height - y0)):
            for i in range(min(TILE_WIDTH_PX, width - x0)):
                t0 = state[j, _TRANSMITTANCE, i]
                for c in range(3):
                    image[y0 + j, x0 + i, c] = state[j, _SUM_RED + c, i] + t0 * background[c]
                image[y0 + j, x0 + i, 3] = state[j, _SUM_DEPTH, i]
                transmittance[y0 + j, x0 + i] = t0
                ends[y0 + j, x0 + i] = np.int32(state[j, _END, i])


@nb.njit(cache=True, parallel=True, fastmath=True, error_model="numpy")
def composite_backward(
    tile_order,
    tile_starts,
    entries,
    slots,
    splats,
    background,
    limits,
    transmittance,
    ends,
    by_image,
    by_entry,
):
    """Fill `by_entry` (all rows) from `by_image`, the loss's gradient by r, g, b of every pixel."""
    height, width = transmittance.shape
    columns = (width + TILE_WIDTH_PX - 1) // TILE_WIDTH_PX
    one = np.float32(1)
    half = np.float32(0.5)
    zero = np.float32(0)
    alpha_min, alpha_max = limits[0], limits[1]
    for n in nb.prange(tile_order.size):
        t = tile_order[n]
        y0 = (t // columns) * TILE_HEIGHT_PX
        x0 = (t % columns) * TILE_WIDTH_PX
        x_half = np.float32(x0) + half
        state = np.zeros((TILE_HEIGHT_PX, _NUM_BACKWARD_ROWS, TILE_WIDTH_PX), splats.dtype)
        sums = np.zeros((_NUM_SUMS, TILE_WIDTH_PX), splats.dtype)
        furthest = 0
        for j in range(TILE_HEIGHT_PX):
            for i in range(TILE_WIDTH_PX):
                state[j, _BEFORE, i] = 1
        for j in range(min(TILE_HEIGHT_PX, height - y0)):
            for i in range(min(TILE_WIDTH_PX, width - x0)):
                state[j, _BEFORE, i] = transmittance[y0 + j, x0 + i]
                state[j, _STOP, i] = ends[y0 + j, x0 + i]
                furthest = max(furthest, ends[y0 + j, x0 + i])
                for c in range(3):
                    g = by_image[y0 + j, x0 + i, c]
                    state[j, _BY_PIXEL_RED + c, i] = g
                    state[j, _BEHIND, i] += transmittance[y0 + j, x0 + i] * background[c] * g
        for k in range(tile_starts[t] + furthest, tile_starts[t + 1]):
            for c in range(NUM_ENTRY_COLUMNS):
                by_entry[slots[k], c] = 0
        for k in range(tile_starts[t] + furthest - 1, tile_starts[t] - 1, -1):
            s = splats[entries[k]]
            u = s[U] - x_half
            v = s[V]
            q0, q1, q2 = s[CONIC_UU], s[CONIC_UV], s[CONIC_VV]
            a = -half * q0
            b = -q1
            c = -half * q2
            opacity, red, green, blue, lowest = s[OPACITY], s[RED], s[GREEN], s[BLUE], s[MIN_POWER]
            j0 = max(0, int(v - s[RADIUS_V]) - y0)
            j1 = min(TILE_HEIGHT_PX, int(v + s[RADIUS_V]) + 1 - y0)
            index = splats.dtype.type(k - tile_starts[t])
            sums[:] = 0
            for j in range(j0, j1):
                dy = v - np.float32(y0 + j) - half
                if not _reaches(a, b, c, u, dy, lowest):
                    continue
                cy = c * dy * dy
                by_row = b * dy
                for i in range(TILE_WIDTH_PX):
                    dx = u - np.float32(i)
                    e = _exp(a * dx * dx + by_row * dx + cy)
                    raw = opacity * e
                    alpha = min(alpha_max, raw)
                    counts = alpha >= alpha_min and index < state[j, _STOP, i]
                    alpha = alpha if counts else zero
                    inverse = one / (one - alpha)
                    t0 = state[j, _BEFORE, i] * inverse
                    state[j, _BEFORE, i] = t0
                    w = alpha * t0
                    d0 = state[j, _BY_PIXEL_RED, i]
                    d1 = state[j, _BY_PIXEL_GREEN, i]
                    d2 = state[j, _BY_PIXEL_BLUE, i]
                    own = red * d0 + green * d1 + blue * d2
                    rest = state[j, _BEHIND, i]
                    by_alpha = t0 * own - rest * inverse
                    state[j, _BEHIND, i] = rest + w * own
                    by_alpha = by_alpha if (counts and raw <= alpha_max) else zero
                    sums[BY_RED, i] += w * d0
                    sums[BY_GREEN, i] += w * d1
                    sums[BY_BLUE, i] += w * d2
                    sums[BY_OPACITY, i] += by_alpha * e
                    by_power = by_alpha * alpha
                    sums[_SUM_POWER, i] += by_power
                    sums[_SUM_POWER_DY, i] += by_power * dy
                    sums[_SUM_POWER_DY2, i] += by_power * dy * dy
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
            for i in range(TILE_WIDTH_PX):
                dx = u - np.float32(i)
                g0 += sums[BY_RED, i]
                g1 += sums[BY_GREEN, i]
                g2 += sums[BY_BLUE, i]
                g3 += sums[BY_OPACITY, i]
                p0 = sums[_SUM_POWER, i]
                p1 = sums[_SUM_POWER_DY, i]
                m00 += p0
                m10 += p0 * dx
                m20 += p0 * dx * dx
                m01 += p1
                m11 += p1 * dx
                m02 += sums[_SUM_POWER_DY2, i]
            out = by_entry[slots[k]]
            out[BY_RED] = g0
            out[BY_GREEN] = g1
            out[BY_BLUE] = g2
            out[BY_OPACITY] = g3
            out[BY_U] = -q0 * m10 - q1 * m01
            out[BY_V] = -q2 * m01 - q1 * m10
            out[BY_CONIC_UU] = -half * m20
            out[BY_CONIC_UV] = -m11
            out[BY_CONIC_VV] = -half * m02
