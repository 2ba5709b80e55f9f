# pyright: basic
"""Kernels of `_numba.py` for what is behind the picture; `_numpy.py` defines what they compute.

Images that tiles are cut from have the rim of the tiles around them, so pixel (y, x) of the
picture is (y + 1, x + 1) there. Colours are RGBA in the bytes of a uint32.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.generators._tile_kernels import packed_split

ZERO, ONE = np.float32(0.0), np.float32(1.0)
OPAQUE = np.uint32(255 << 24)


@nb.njit(cache=True)
def _mean(total, count):
    """Return the rounded mean of a few 8-bit numbers; float32 is exact enough, and fast."""
    return np.int32(np.float32(2 * total + count) / np.float32(2 * count) + np.float32(1e-3))


@nb.njit(cache=True)
def _mean_before(disparity, rgba, y, x, dy, dx, before, jump, lag_px, colour_px):
    """Return the colour of the surface before the edge between (y - dy, x - dx) and (y, x).

    `before` is how many pixels the picture has before the edge.
    """
    most = min(before, lag_px + colour_px + 1)
    crossed = 1
    while crossed < most:
        j, i = y - crossed * dy, x - crossed * dx
        if abs(disparity[j, i] - disparity[j - dy, i - dx]) > jump:
            break
        crossed += 1
    first, last = lag_px + 1, min(crossed - 1, lag_px + colour_px)
    if crossed <= lag_px + 1:
        first, last = 1, 1
    r = g = b = 0
    for n in range(first, last + 1):
        colour = rgba[y - n * dy, x - n * dx]
        r += colour & np.uint32(255)
        g += (colour >> np.uint32(8)) & np.uint32(255)
        b += (colour >> np.uint32(16)) & np.uint32(255)
    count = last + 1 - first
    r, g, b = _mean(r, count), _mean(g, count), _mean(b, count)
    return np.uint32(r) | np.uint32(g << 8) | np.uint32(b << 16) | OPAQUE


@nb.njit(cache=True)
def _carry(disparity, y, x, dy, dx, reach_px, jump, to, steps):
    """Count steps from an edge into the foreground, until the background cannot be seen."""
    height, width = disparity.shape
    behind = disparity[y - dy, x - dx]
    before = behind
    step = 0
    while 0 <= y < height and 0 <= x < width:
        d = disparity[y, x]
        if step > 0 and d - before > jump:
            return  # from here on the next edge's background is carried
        step += 1
        rise = d - behind
        if rise <= jump or np.float32(step) > reach_px * rise:
            return
        steps[y, x, to] = step
        before = d
        y += dy
        x += dx


@nb.njit(cache=True, parallel=True)
def carry_background(disparity, rgba, reach_px, jump, lag_px, colour_px, steps, edge_rgba):
    """Carry the background into the foreground, from each edge to the right, left, down and up.

    Writes to `steps` (all 0 before) how far each pixel is from the edge whose background is behind
    it, and to `edge_rgba`, only at the first pixel after an edge, the colour that is carried.
    """
    height, width = disparity.shape
    for line in nb.prange(height):
        y = np.int64(line)  # numba's own is unsigned, and mixed differences become floats
        for x in range(width):
            for axis in range(2):
                dy, dx = axis, 1 - axis
                if y + dy >= height or x + dx >= width:
                    continue
                rise = disparity[y + dy, x + dx] - disparity[y, x]
                if abs(rise) <= jump:
                    continue
                forth = rise > ZERO
                j, i = (y + dy, x + dx) if forth else (y, x)
                before = j * dy + i * dx if forth else (height - 1 - y) * dy + (width - 1 - x) * dx
                if not forth:
                    dy, dx = -dy, -dx
                side = 2 * axis + (0 if forth else 1)
                edge_rgba[j, i, side] = _mean_before(
                    disparity, rgba, j, i, dy, dx, before, jump, lag_px, colour_px
                )
                _carry(disparity, j, i, dy, dx, reach_px, jump, side, steps)


@nb.njit(cache=True, parallel=True)
def join_background(disparity, steps, edge_rgba, jump, disparities, hidden, hidden_rgba):
    """Join what is carried: the disparity of the nearest edge, the colours of all that agree.

    Writes, only where something is behind, `packed_split` of its disparity, and its colour.
    """
    height, width = disparity.shape
    for line in nb.prange(height):
        y = np.int64(line)
        for x in range(width):
            best, at = 1 << 16, ZERO
            for s in range(4):
                step = np.int64(steps[y, x, s])
                if 0 < step < best:
                    best = step
                    at = _disparity_before(disparity, y, x, s, step)
            if best == 1 << 16:
                continue
            total = d_sum = r = g = b = ZERO
            for s in range(4):
                step = np.int64(steps[y, x, s])
                if step == 0:
                    continue
                d = _disparity_before(disparity, y, x, s, step)
                if abs(d - at) <= jump:
                    j, i = _edge(y, x, s, step)
                    colour = edge_rgba[j, i, s]
                    weight = ONE / np.float32(step)
                    total += weight
                    d_sum += weight * d
                    r += weight * np.float32(colour & np.uint32(255))
                    g += weight * np.float32((colour >> np.uint32(8)) & np.uint32(255))
                    b += weight * np.float32((colour >> np.uint32(16)) & np.uint32(255))
            norm = ONE / total
            half = np.float32(0.5)
            hidden[y + 1, x + 1] = packed_split(d_sum * norm, disparities)
            hidden_rgba[y + 1, x + 1] = (
                np.uint32(r * norm + half)
                | (np.uint32(g * norm + half) << np.uint32(8))
                | (np.uint32(b * norm + half) << np.uint32(16))
                | OPAQUE
            )


@nb.njit(cache=True)
def _edge(y, x, side, step):
    """Return the first pixel after the edge that is `step` steps away."""
    away = step - 1
    if side == 0:
        return y, x - away
    if side == 1:
        return y, x + away
    if side == 2:
        return y - away, x
    return y + away, x


@nb.njit(cache=True)
def _disparity_before(disparity, y, x, side, step):
    """Return the disparity before the edge that is `step` steps away."""
    j, i = _edge(y, x, side, step + 1)
    return disparity[j, i]


@nb.njit(cache=True, parallel=True)
def smooth_background(rgba, radius, smooth_rgba):
    """Average over a square the colours that are there (alpha 255), at the pixels that have one."""
    height, width = rgba.shape[0], rgba.shape[1] // 4
    for y in nb.prange(height):
        smooth_rgba[y] = np.uint8(0)
        first, last = max(y - radius, 0), min(y + radius + 1, height)
        sums = np.zeros(4 * (width + 2 * radius), np.uint16)
        middle = sums[4 * radius : 4 * (radius + width)]
        for j in range(first, last):
            row = rgba[j]
            for n in range(4 * width):
                middle[n] += np.uint16(row[n])
        for x in range(width):
            if rgba[y, 4 * x + 3] == 0:
                continue
            r = g = b = count = 0
            for i in range(4 * x, 4 * (x + 2 * radius + 1), 4):
                r += sums[i]
                g += sums[i + 1]
                b += sums[i + 2]
                count += sums[i + 3]
            count //= 255
            smooth_rgba[y, 4 * x] = _mean(r, count)
            smooth_rgba[y, 4 * x + 1] = _mean(g, count)
            smooth_rgba[y, 4 * x + 2] = _mean(b, count)
            smooth_rgba[y, 4 * x + 3] = 255
