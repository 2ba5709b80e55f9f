# pyright: basic
"""Kernels of `_numba.py` that smooth surfaces and choose their sides; `_numpy.py` defines them."""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.depth._row_kernels import add_scaled, copy_row

F = np.float32
ZERO, ONE = F(0.0), F(1.0)
DOWN = (0, 0), (0, 1), (1, 0)
"""Sums over columns that planes are made of: which of the powers, which of the kernels."""
ACROSS = (0, 0), (0, 1), (1, 0), (2, 0)
"""Value, slopes in x and y, square: which of `DOWN`, which of the kernels."""
NO_PLANE = F(1e9)
"""Mean squared deviation of what is none."""


@nb.njit(cache=True)
def _mirrored(n, size):
    """Fold an index at the centres of the first and the last sample."""
    folded = abs(n) % max(2 * size - 2, 1)
    return min(folded, 2 * size - 2 - folded) if size > 1 else folded


@nb.njit(cache=True)
def odd_rim(disparity, radius, out):
    """Write the samples with a rim of twice the outermost minus the mirrored sample, then 0."""
    rows, cols = disparity.shape
    for y in range(-radius, rows + radius):
        inside = 0 <= y < rows
        near, far = min(max(y, 0), rows - 1), _mirrored(y, rows)
        for x in range(-radius, cols + radius):
            if inside and 0 <= x < cols:
                out[y + radius, x + radius] = disparity[y, x]
                continue
            d = disparity[near, min(max(x, 0), cols - 1)]
            out[y + radius, x + radius] = d + d - disparity[far, _mirrored(x, cols)]
        out[y + radius, cols + 2 * radius :] = ZERO


@nb.njit(cache=True, parallel=True)
def patch_planes(powers, kernels, spread, cols, margin, planes):
    """Write the planes of the patches: value in the middle, slopes, mean squared deviation.

    They have a margin on the left and as much as is left of their rows on the right, where they
    are no planes at all (`NO_PLANE`). `powers` are the samples and their squares with the rim;
    `kernels` the weights, and these times what makes a slope.
    """
    side = kernels.shape[1]
    rows = planes.shape[1]
    wide = powers.shape[2]
    for y in nb.prange(rows):
        down = np.zeros((len(DOWN), wide + side), F)
        across = np.zeros((len(ACROSS), wide), F)
        for k in range(side):
            for n in range(len(DOWN)):
                add_scaled(down[n, :wide], powers[DOWN[n][0], y + k], kernels[DOWN[n][1], k])
        for k in range(side):
            for n in range(len(ACROSS)):
                row = down[ACROSS[n][0], k : k + wide]
                add_scaled(across[n], row, kernels[ACROSS[n][1], k])
        middle, slope_x, slope_y, bent = across[0], across[1], across[2], across[3]
        for x in range(wide):
            m, gx, gy = middle[x], slope_x[x], slope_y[x]
            bent[x] = max(bent[x] - m * m - spread * (gx * gx + gy * gy), ZERO)
        planes[:3, y] = ZERO
        planes[3, y] = NO_PLANE
        for n in range(4):
            copy_row(planes[n, y, margin : margin + cols], across[n, :cols])


@nb.njit(cache=True, parallel=True)
def sharpen(disparity, planes, reach, limits, out):
    """Give every sample the mean of what the planar patches around say about it.

    The planes have a margin of `reach`, and rows of whole blocks beside it.
    """
    noise, own_value, lowest, highest = limits
    rows, cols = disparity.shape
    wide = planes.shape[2] - 2 * reach
    for y in nb.prange(rows):
        here, total, weights = np.zeros(wide, F), np.zeros(wide, F), np.zeros(wide, F)
        copy_row(here[:cols], disparity[y])
        for j in range(max(y - reach, 0), min(y + reach + 1, rows)):
            dy = F(j - y)
            for first in range(2 * reach + 1):
                last = first + wide
                middle = planes[0, j, first:last]
                slope_x = planes[1, j, first:last]
                slope_y = planes[2, j, first:last]
                bent = planes[3, j, first:last]
                dx = F(first - reach)
                for n in range(wide):
                    said = middle[n] - dx * slope_x[n] - dy * slope_y[n]
                    own = said - here[n]
                    w = noise / (noise + bent[n] + own_value * own * own)
                    w *= w
                    w *= w
                    total[n] += w * said
                    weights[n] += w
        for x in range(cols):
            out[y, x] = min(max(total[x] / weights[x], lowest), highest)


@nb.njit(cache=True)
def flatten(disparity, planes, residual, noise):
    """Replace planes that are none by the sample itself."""
    rows, cols = disparity.shape
    for y in range(rows):
        for x in range(cols):
            if planes[3, y, x] > residual * planes[0, y, x] ** 2 + noise:
                planes[0, y, x] = disparity[y, x]
                planes[1, y, x] = ZERO
                planes[2, y, x] = ZERO


@nb.njit(cache=True, parallel=True)
def choose_sides(disparity, planes, guide, rgb, limits, at_rows, at_cols, out):
    """Interpolate the planes on surfaces; at edges let the samples vote for a side.

    `at_rows` and `at_cols` say where the pixels lie between the samples: the first pixel of each
    gap (the gaps before the first and after the last sample included), and for each pixel its gap
    and how far it is into it, 0 … 1. The planes have rows of whole blocks, longer than those.
    """
    surface_range, noise_range, in_between, per_colour, lowest, highest = limits
    first_row, _, into_row = at_rows
    first_col, in_gap, into_col = at_cols
    rows, cols = disparity.shape
    width, wide = out.shape[1], planes.shape[2]
    for gap in nb.prange(rows + 1):
        j0 = np.int64(gap) - 1
        if first_row[gap] == first_row[gap + 1]:
            continue
        low, high = np.empty(cols, F), np.empty(cols, F)
        _range_of_rows(disparity, j0, low, high)
        # Values in the middle and slopes, of all patches and one more at each end.
        middle, slope = np.zeros(wide + 2, F), np.zeros(wide + 2, F)
        start, rise, bend = np.empty(wide, F), np.empty(wide, F), np.empty(wide, F)
        for y in range(first_row[gap], first_row[gap + 1]):
            _blend_rows(planes, cols, j0, into_row[y], middle, slope)
            for n in range(wide):
                start[n] = middle[n]
                rise[n] = middle[n + 1] - middle[n]
                bend[n] = slope[n] - slope[n + 1]
            for x in range(width):
                f, n = into_col[x], in_gap[x]
                value = start[n] + f * (rise[n] + (ONE - f) * bend[n])
                out[y, x] = min(max(value, lowest), highest)
        samples = np.empty((8, 16), F)
        for col in range(cols + 1):
            least = most = low[min(max(col - 1, 0), cols - 1)]
            for i in range(col - 2, col + 2):
                ii = min(max(i, 0), cols - 1)
                least, most = min(least, low[ii]), max(most, high[ii])
            if most - least <= surface_range * most + noise_range:
                continue
            margin = in_between * (most - least)
            _gather(disparity, guide, j0, col - 1, least + margin, most - margin, samples)
            for y in range(first_row[gap], first_row[gap + 1]):
                for x in range(first_col[col], first_col[col + 1]):
                    out[y, x] = _vote(samples, into_row[y], into_col[x], rgb[y, x], per_colour)


@nb.njit(cache=True)
def _range_of_rows(disparity, j0, low, high):
    """Write the least and the greatest of the four rows around a gap, for each column."""
    rows, cols = disparity.shape
    copy_row(low, disparity[min(max(j0, 0), rows - 1)])
    copy_row(high, low)
    for j in (j0 - 1, j0 + 1, j0 + 2):
        row = disparity[min(max(j, 0), rows - 1)]
        for x in range(cols):
            low[x] = min(low[x], row[x])
        for x in range(cols):
            high[x] = max(high[x], row[x])


@nb.njit(cache=True)
def _blend_rows(planes, cols, j0, into, middle, slope):
    """Blend the planes of the two rows around a row of pixels, for that row."""
    rows = planes.shape[1]
    middle[:] = ZERO
    slope[:] = ZERO
    for j, weight in ((j0, ONE - into), (j0 + 1, into)):
        row = min(max(j, 0), rows - 1)
        add_scaled(middle[1:-1], planes[0, row], weight)
        add_scaled(middle[1:-1], planes[2, row], weight * (F(j0 - row) + into))
        add_scaled(slope[1:-1], planes[1, row], weight)
    slope[0], slope[cols + 1] = slope[1], slope[cols]
    middle[0], middle[cols + 1] = middle[1] - slope[1], middle[cols] + slope[cols]


@nb.njit(cache=True)
def _gather(disparity, guide, j0, i0, far_below, near_above, samples):
    """Write of the 4×4 samples around a gap: row and column, disparity, colour, sides."""
    rows, cols = disparity.shape
    n = 0
    for j in range(-1, 3):
        jj = min(max(j0 + j, 0), rows - 1)
        for i in range(-1, 3):
            ii = min(max(i0 + i, 0), cols - 1)
            d = disparity[jj, ii]
            samples[0, n] = F(j)
            samples[1, n] = F(i)
            samples[2, n] = d
            samples[3, n] = F(guide[jj, ii, 0])
            samples[4, n] = F(guide[jj, ii, 1])
            samples[5, n] = F(guide[jj, ii, 2])
            samples[6, n] = ONE if d <= far_below else ZERO
            samples[7, n] = ONE if d >= near_above else ZERO
            n += 1


@nb.njit(cache=True)
def _vote(samples, into_row, into_col, colour, per_colour):
    """Return the disparity of the side that wins at one pixel."""
    red, green, blue = F(colour[0]), F(colour[1]), F(colour[2])
    far_votes = far_sum = near_votes = near_sum = ZERO
    for n in range(16):
        dy, dx = samples[0, n] - into_row, samples[1, n] - into_col
        dr, dg, db = samples[3, n] - red, samples[4, n] - green, samples[5, n] - blue
        unlike = ONE + (dr * dr + dg * dg + db * db) * per_colour
        weight = ONE / ((ONE + dx * dx + dy * dy) * unlike)
        weight *= weight
        far, near = weight * samples[6, n], weight * samples[7, n]
        far_votes += far
        far_sum += far * samples[2, n]
        near_votes += near
        near_sum += near * samples[2, n]
    if far_votes >= near_votes:
        return far_sum / far_votes
    return near_sum / near_votes
