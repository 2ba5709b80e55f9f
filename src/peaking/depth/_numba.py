# pyright: basic
"""Depth completion, fast on the CPU; what it computes is defined in `_numpy.py`."""

from __future__ import annotations

import cv2
import numba as nb
import numpy as np

from peaking.depth import _numpy as defined

F = np.float32
UNreachED = 2**30
ZERO, HALF, ONE, HUGE = F(0.0), F(0.5), F(1.0), F(1e30)

# What `_numpy.py` names is handed to the kernels: as globals they would be frozen into numba's
# cache, which does not see that another file has changed.


def reduce(disparity, rows, cols):
    out = np.empty((rows, cols), F)
    _reduce(np.ascontiguousarray(disparity), F(defined.SAME_SURFACE), out)
    return out


@nb.njit(cache=True, fastmath=True, parallel=True)
def _reduce(disparity, same_surface, out):
    high, wide = disparity.shape
    rows, cols = out.shape
    for y in nb.prange(rows):
        y0 = y * high // rows
        y1 = (y + 1) * high // rows
        for x in range(cols):
            x0 = x * wide // cols
            x1 = (x + 1) * wide // cols
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


def fill_holes(disparity, guide, colour, noise):
    known = disparity > 0
    if known.all():
        return disparity
    rows, cols = disparity.shape
    cost = np.empty((rows, cols), np.int32)
    source = np.empty((rows, cols), np.int32)
    least = cv2.erode(np.where(known, disparity, HUGE), np.ones((5, 5), np.uint8))
    _begin(disparity, least, F(defined.NEAR_IS_LATE * defined.ALONG), cost, source)
    lengths = defined.ALONG, defined.DIAGONAL
    per_level = round(colour * lengths[0] / 255.0), round(colour * lengths[1] / 255.0)
    _spread(guide, known, (lengths, per_level, defined.SWEEPS), cost, source)
    out = np.empty_like(disparity)
    limits = (
        F(defined.SLOPE_RIDGE),
        F(defined.SLOPE_RESIDUAL**2),
        F(noise**2),
        F(defined.FLATTEN_SAMPLES),
        F(defined.MOST_CHANGE),
    )
    _continue(disparity, source, _moments(disparity, known.astype(F)), limits, out)
    return out


def _moments(disparity, known):
    radius = defined.SLOPE_RADIUS
    a = np.arange(-radius, radius + 1).astype(F)
    one = np.ones_like(a)

    def moment(samples, y, x):
        return cv2.sepFilter2D(samples, -1, x, y, borderType=cv2.BORDER_CONSTANT)

    return (
        moment(known, one, one),
        moment(known, one, a),
        moment(known, a, one),
        moment(known, one, a * a),
        moment(known, a * a, one),
        moment(known, a, a),
        moment(disparity, one, one),
        moment(disparity, one, a),
        moment(disparity, a, one),
        moment(disparity * disparity, one, one),
    )


@nb.njit(cache=True, fastmath=True)
def _begin(disparity, least, late, cost, source):
    rows, cols = disparity.shape
    for y in range(rows):
        for x in range(cols):
            d = disparity[y, x]
            if d <= ZERO:
                cost[y, x] = UNreachED
                source[y, x] = -1
                continue
            cost[y, x] = int(min((d / least[y, x] - ONE) * late, F(1e6)))
            source[y, x] = y * cols + x


@nb.njit(cache=True)
def _spread(guide, known, steps, cost, source):
    lengths, per_level, sweeps = steps
    rows, cols = cost.shape
    for sweep in range(2 * sweeps):
        back = -1 if sweep % 2 == 0 else 1
        for n in range(rows):
            y = n if back < 0 else rows - 1 - n
            for m in range(cols):
                x = m if back < 0 else cols - 1 - m
                if known[y, x]:
                    continue
                r = np.int32(guide[y, x, 0])
                g = np.int32(guide[y, x, 1])
                b = np.int32(guide[y, x, 2])
                least = cost[y, x]
                chosen = source[y, x]
                for k in range(4):
                    j = y + (0 if k == 0 else back)
                    i = x + (0 if k == 1 else (-back if k == 3 else back))
                    if j < 0 or i < 0 or j >= rows or i >= cols or source[j, i] < 0:
                        continue
                    unlike = (
                        abs(r - np.int32(guide[j, i, 0]))
                        + abs(g - np.int32(guide[j, i, 1]))
                        + abs(b - np.int32(guide[j, i, 2]))
                    )
                    way = 1 if k >= 2 else 0
                    step = lengths[way] + per_level[way] * unlike
                    if cost[j, i] + step < least:
                        least = cost[j, i] + step
                        chosen = source[j, i]
                cost[y, x] = least
                source[y, x] = chosen


@nb.njit(cache=True, fastmath=True, parallel=True)
def _continue(disparity, source, moments, limits, out):
    n, x, y, xx, yy, xy, d, xd, yd, dd = moments
    ridge, residual, noise, flatten, most_change = limits
    rows, cols = disparity.shape
    for row in nb.prange(rows):
        for col in range(cols):
            if disparity[row, col] > ZERO:
                out[row, col] = disparity[row, col]
                continue
            j = source[row, col] // cols
            i = source[row, col] % cols
            start = disparity[j, i]
            per = ONE / n[j, i]
            mean = d[j, i] * per
            mean_x = x[j, i] * per
            mean_y = y[j, i] * per
            cxx = xx[j, i] - x[j, i] * mean_x + ridge
            cyy = yy[j, i] - y[j, i] * mean_y + ridge
            cxy = xy[j, i] - x[j, i] * mean_y
            cxd = xd[j, i] - x[j, i] * mean
            cyd = yd[j, i] - y[j, i] * mean
            per_determinant = ONE / (cxx * cyy - cxy * cxy)
            slope_x = (cyy * cxd - cxy * cyd) * per_determinant
            slope_y = (cxx * cyd - cxy * cxd) * per_determinant
            variance = dd[j, i] * per - mean * mean - (slope_x * cxd + slope_y * cyd) * per
            value = start
            if variance <= residual * mean * mean + noise:
                dx = F(col - i)
                dy = F(row - j)
                away = np.sqrt(dx * dx + dy * dy)
                damped = flatten * (ONE - np.exp(-away / flatten)) / away
                value = start + (slope_x * dx + slope_y * dy) * damped
            out[row, col] = min(max(value, start / most_change), start * most_change)


def _patch_planes(disparity, sigma):
    radius = defined.PATCH_RADIUS
    a = np.arange(-radius, radius + 1, dtype=np.float64)
    g = np.exp(-a * a / (2.0 * sigma**2))
    g /= g.sum()
    rise = g * a / (g * a * a).sum()
    sides = (radius, radius, radius, radius)
    near = cv2.copyMakeBorder(disparity, *sides, cv2.BORDER_REPLICATE)
    far = cv2.copyMakeBorder(disparity, *sides, cv2.BORDER_REFLECT_101)
    padded = F(2.0) * near - far

    def sums(samples, y, x):
        return cv2.sepFilter2D(samples, -1, x, y)[radius:-radius, radius:-radius]

    spread = F((g * a * a).sum())
    return (
        sums(padded, g, g),
        sums(padded, g, rise),
        sums(padded, rise, g),
        sums(padded * padded, g, g),
        spread,
    )


def sharpen(disparity, noise):
    out = np.empty_like(disparity)
    planes = np.empty((4, *disparity.shape), F)
    _bend(*_patch_planes(disparity, defined.PATCH_SIGMA), planes)
    limits = F(noise**2), F(defined.OWN_VALUE), F(disparity.min()), F(disparity.max())
    _sharpen(disparity, planes, defined.REACH, limits, out)
    return out


@nb.njit(cache=True, fastmath=True)
def _bend(middle, slope_x, slope_y, squares, spread, planes):
    rows, cols = middle.shape
    for y in range(rows):
        for x in range(cols):
            m = middle[y, x]
            gx = slope_x[y, x]
            gy = slope_y[y, x]
            variance = max(squares[y, x] - m * m - spread * (gx * gx + gy * gy), ZERO)
            planes[0, y, x] = m
            planes[1, y, x] = gx
            planes[2, y, x] = gy
            planes[3, y, x] = variance


@nb.njit(cache=True, fastmath=True, parallel=True)
def _sharpen(disparity, planes, reach, limits, out):
    noise, own_value, lowest, highest = limits
    rows, cols = disparity.shape
    for y in nb.prange(rows):
        weights = np.zeros(cols, np.float32)
        out[y] = ZERO
        for j in range(max(y - reach, 0), min(y + reach + 1, rows)):
            dy = F(j - y)
            for di in range(max(-reach, 1 - cols), min(reach + 1, cols)):
                # Slices, so that the loop over n is over contiguous rows: it becomes SIMD.
                first, last = max(-di, 0), min(cols - di, cols)
                middle = planes[0, j, first + di : last + di]
                slope_x = planes[1, j, first + di : last + di]
                slope_y = planes[2, j, first + di : last + di]
                bent = planes[3, j, first + di : last + di]
                here = disparity[y, first:last]
                total = out[y, first:last]
                weight = weights[first:last]
                dx = F(di)
                for n in range(last - first):
                    said = middle[n] - dx * slope_x[n] - dy * slope_y[n]
                    own = said - here[n]
                    w = noise / (noise + bent[n] + own_value * own * own)
                    w *= w
                    w *= w
                    total[n] += w * said
                    weight[n] += w
        for x in range(cols):
            out[y, x] = min(max(out[y, x] / weights[x], lowest), highest)


def choose_sides(disparity, guide, rgb, surface_range, colour_sigma, noise):
    planes = np.empty((4, *disparity.shape), F)
    _bend(*_patch_planes(disparity, defined.SURFACE_SIGMA), planes)
    _flatten(disparity, planes, F(defined.SURFACE_RESIDUAL**2), F(noise**2))
    out = np.empty(rgb.shape[:2], F)
    sizes = F(disparity.min()), F(disparity.max())
    per_colour = F(1.0 / (255.0 * colour_sigma) ** 2)
    ranges = F(surface_range), F(defined.RANGE_OF_NOISE * noise), F(defined.IN_BETWEEN)
    _choose(disparity, planes, guide, rgb, ranges, per_colour, sizes, out)
    return out


@nb.njit(cache=True, fastmath=True)
def _flatten(disparity, planes, residual, noise):
    rows, cols = disparity.shape
    for y in range(rows):
        for x in range(cols):
            if planes[3, y, x] > residual * planes[0, y, x] ** 2 + noise:
                planes[0, y, x] = disparity[y, x]
                planes[1, y, x] = ZERO
                planes[2, y, x] = ZERO


@nb.njit(cache=True, fastmath=True, parallel=True)
def _choose(disparity, planes, guide, rgb, ranges, per_colour, sizes, out):
    surface_range, noise_range, in_between = ranges
    lowest, highest = sizes
    height, width = out.shape
    rows, cols = disparity.shape
    sy = F(rows) / F(height)
    sx = F(cols) / F(width)
    for y in nb.prange(height):
        v = (F(y) + HALF) * sy - HALF
        j0 = int(np.floor(v))
        fy = v - F(j0)
        ja = min(max(j0, 0), rows - 1)
        jb = min(max(j0 + 1, 0), rows - 1)
        last = -9
        low = ZERO
        high = ZERO
        for x in range(width):
            u = (F(x) + HALF) * sx - HALF
            i0 = int(np.floor(u))
            fx = u - F(i0)
            if i0 != last:
                last = i0
                low = HUGE
                high = ZERO
                for j in range(j0 - 1, j0 + 3):
                    jj = min(max(j, 0), rows - 1)
                    for i in range(i0 - 1, i0 + 3):
                        d = disparity[jj, min(max(i, 0), cols - 1)]
                        low = min(low, d)
                        high = max(high, d)
            if high - low <= surface_range * high + noise_range:
                ia = min(max(i0, 0), cols - 1)
                ib = min(max(i0 + 1, 0), cols - 1)
                xa = u - F(ia)
                xb = u - F(ib)
                ya = v - F(ja)
                yb = v - F(jb)
                a = planes[0, ja, ia] + xa * planes[1, ja, ia] + ya * planes[2, ja, ia]
                b = planes[0, ja, ib] + xb * planes[1, ja, ib] + ya * planes[2, ja, ib]
                c = planes[0, jb, ia] + xa * planes[1, jb, ia] + yb * planes[2, jb, ia]
                d = planes[0, jb, ib] + xb * planes[1, jb, ib] + yb * planes[2, jb, ib]
                top = a + fx * (b - a)
                bottom = c + fx * (d - c)
                out[y, x] = min(max(top + fy * (bottom - top), lowest), highest)
                continue
            far_below = low + in_between * (high - low)
            near_above = high - in_between * (high - low)
            red = F(rgb[y, x, 0])
            green = F(rgb[y, x, 1])
            blue = F(rgb[y, x, 2])
            far_votes = ZERO
            far_sum = ZERO
            near_votes = ZERO
            near_sum = ZERO
            for j in range(j0 - 1, j0 + 3):
                jj = min(max(j, 0), rows - 1)
                dy = F(j) - v
                for i in range(i0 - 1, i0 + 3):
                    ii = min(max(i, 0), cols - 1)
                    d = disparity[jj, ii]
                    if far_below < d < near_above:
                        continue
                    dx = F(i) - u
                    dr = red - F(guide[jj, ii, 0])
                    dg = green - F(guide[jj, ii, 1])
                    db = blue - F(guide[jj, ii, 2])
                    unlike = ONE + (dr * dr + dg * dg + db * db) * per_colour
                    weight = ONE / ((ONE + dx * dx + dy * dy) * unlike)
                    weight *= weight
                    if d <= far_below:
                        far_votes += weight
                        far_sum += weight * d
                    else:
                        near_votes += weight
                        near_sum += weight * d
            if far_votes >= near_votes:
                out[y, x] = far_sum / far_votes
            else:
                out[y, x] = near_sum / near_votes
