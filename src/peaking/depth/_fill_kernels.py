# pyright: basic
"""Kernels of `_numba.py` that reduce a fine sensor and fill its holes; `_numpy.py` defines them."""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.depth._row_kernels import add_levered, add_powers, add_scaled

F = np.float32
UNREACHED = 2**30
ZERO, ONE = F(0.0), F(1.0)


@nb.njit(cache=True, parallel=True)
def reduce(disparity, same_surface, first_row, first_col, out):
    """Reduce to the size of `out` without mixing surfaces; cells begin where it is said."""
    rows, cols = out.shape
    for y in nb.prange(rows):
        y0, y1 = first_row[y], first_row[y + 1]
        for x in range(cols):
            x0, x1 = first_col[x], first_col[x + 1]
            best = 1 << 30
            middle = ZERO
            for j in range(y0, y1):
                for i in range(x0, x1):
                    if disparity[j, i] > ZERO:
                        away = (2 * (j - y0) + 1 - (y1 - y0)) ** 2
                        away += (2 * (i - x0) + 1 - (x1 - x0)) ** 2
                        if away < best:
                            best = away
                            middle = disparity[j, i]
            if best == 1 << 30:
                out[y, x] = ZERO
                continue
            total = ZERO
            count = ZERO
            for j in range(y0, y1):
                for i in range(x0, x1):
                    if abs(disparity[j, i] - middle) <= same_surface * middle:
                        total += disparity[j, i]
                        count += ONE
            out[y, x] = total / count


@nb.njit(cache=True, parallel=True)
def moments(powers, radius, out):
    """Write the ten moments of the known samples in the square around each.

    They are the sums of 1, x, y, x², y², xy, d, xd, yd, d². `powers` are 1, d and d² where d is
    known, else 0.
    """
    rows, wide = powers.shape[1:]
    first, last = radius, radius + wide
    for line in nb.prange(rows):
        row = np.int64(line)
        # Over columns: 1, y, y², d, yd, d².
        down = np.zeros((6, 2 * radius + wide), F)
        n, y, yy = down[0, first:last], down[1, first:last], down[2, first:last]
        d, yd, dd = down[3, first:last], down[4, first:last], down[5, first:last]
        for j in range(max(row - radius, 0), min(row + radius + 1, rows)):
            lever = F(j - row)
            add_powers(n, y, yy, powers[0, j], lever)
            add_levered(d, yd, powers[1, j], lever)
            add_scaled(dd, powers[2, j], ONE)
        out[:, row] = ZERO
        for k in range(2 * radius + 1):
            lever, end = F(k - radius), k + wide
            add_powers(out[0, row], out[1, row], out[3, row], down[0, k:end], lever)
            add_levered(out[2, row], out[5, row], down[1, k:end], lever)
            add_scaled(out[4, row], down[2, k:end], ONE)
            add_levered(out[6, row], out[7, row], down[3, k:end], lever)
            add_scaled(out[8, row], down[4, k:end], ONE)
            add_scaled(out[9, row], down[5, k:end], ONE)


@nb.njit(cache=True)
def begin(disparity, least, late, cost, source, holes):
    """Write first costs and sources with a rim of one, and the numbers of the unknown samples.

    Returns:
        How many are unknown.
    """
    rows, cols = disparity.shape
    cost[:] = UNREACHED
    source[:] = -1
    count = 0
    for y in range(rows):
        for x in range(cols):
            d = disparity[y, x]
            if d > ZERO:
                cost[y + 1, x + 1] = int(min((d / least[y, x] - ONE) * late, F(1e6)))
                source[y + 1, x + 1] = y * cols + x
            else:
                holes[count] = y * cols + x
                count += 1
    return count


@nb.njit(cache=True, parallel=True)
def measure_steps(guide, holes, steps, per_level, lengths):
    """Write how long the steps are from each hole to its neighbours.

    They come in the order left, up, up left, up right, and then the opposites. `steps` are the
    lengths along and diagonally, `per_level` what they grow by for a step of colour.
    """
    rows, cols = guide.shape[:2]
    for n in nb.prange(holes.shape[0]):
        y, x = holes[n] // cols, holes[n] % cols
        r, g, b = np.int32(guide[y, x, 0]), np.int32(guide[y, x, 1]), np.int32(guide[y, x, 2])
        for k in range(8):
            back = -1 if k < 4 else 1
            way = k & 3
            j = y + (0 if way == 0 else back)
            i = x + (0 if way == 1 else (-back if way == 3 else back))
            if j < 0 or i < 0 or j >= rows or i >= cols:
                lengths[n, k] = 0  # from the rim, which is never reached
                continue
            unlike = (
                abs(r - np.int32(guide[j, i, 0]))
                + abs(g - np.int32(guide[j, i, 1]))
                + abs(b - np.int32(guide[j, i, 2]))
            )
            kind = 0 if way < 2 else 1
            lengths[n, k] = steps[kind] + per_level[kind] * unlike


@nb.njit(cache=True)
def spread(holes, lengths, sweeps, cols, cost, source):
    """Find by sweeps forth and back which known sample is geodesically nearest to each hole."""
    wide = cols + 2
    cost = cost.reshape(-1)
    source = source.reshape(-1)
    for sweep in range(2 * sweeps):
        forth = sweep % 2 == 0
        sign, first = (-1, 0) if forth else (1, 4)
        left, up, diagonal, other = sign, sign * wide, sign * (wide + 1), sign * (wide - 1)
        for m in range(holes.shape[0]):
            n = m if forth else holes.shape[0] - 1 - m
            at = (holes[n] // cols + 1) * wide + holes[n] % cols + 1
            least, chosen = cost[at], source[at]
            for k in range(4):
                step = left if k == 0 else (up if k == 1 else (diagonal if k == 2 else other))
                by = cost[at + step] + lengths[n, first + k]
                if by < least:
                    least, chosen = by, source[at + step]
            cost[at], source[at] = least, chosen


@nb.njit(cache=True, parallel=True)
def continue_surfaces(disparity, holes, source, moments, limits, out):
    """Write into each hole the plane through the surroundings of its source."""
    ridge, residual, noise, flatten, most_change = limits
    cols = disparity.shape[1]
    for m in nb.prange(holes.shape[0]):
        row, col = holes[m] // cols, holes[m] % cols
        j, i = source[row + 1, col + 1] // cols, source[row + 1, col + 1] % cols
        start = disparity[j, i]
        n, x, y = moments[0, j, i], moments[1, j, i], moments[2, j, i]
        per = ONE / n
        mean = moments[6, j, i] * per
        mean_x, mean_y = x * per, y * per
        cxx = moments[3, j, i] - x * mean_x + ridge
        cyy = moments[4, j, i] - y * mean_y + ridge
        cxy = moments[5, j, i] - x * mean_y
        cxd = moments[7, j, i] - x * mean
        cyd = moments[8, j, i] - y * mean
        per_determinant = ONE / (cxx * cyy - cxy * cxy)
        slope_x = (cyy * cxd - cxy * cyd) * per_determinant
        slope_y = (cxx * cyd - cxy * cxd) * per_determinant
        variance = moments[9, j, i] * per - mean * mean - (slope_x * cxd + slope_y * cyd) * per
        value = start
        if variance <= residual * mean * mean + noise:
            dx, dy = F(col - i), F(row - j)
            away = np.sqrt(dx * dx + dy * dy)
            damped = flatten * (ONE - np.exp(-away / flatten)) / away
            value = start + (slope_x * dx + slope_y * dy) * damped
        out[row, col] = min(max(value, start / most_change), start * most_change)
