# pyright: basic
"""The kernels of `_numba.py`; what they compute is defined in `_numpy.py`."""

from __future__ import annotations

import numba as nb
import numpy as np

LANE_PX = 32
"""Columns that one thread sweeps together, so that memory is read in rows."""


@nb.njit(cache=True, fastmath=True, parallel=True)
def plane_positions(disparity, ladder, positions):
    """Write for every disparity its place on the ascending ladder, 0 … planes - 1."""
    height, width = disparity.shape
    last = ladder.shape[0] - 1
    low = ladder[0]
    per_step = np.float32(last) / max(ladder[last] - low, np.float32(1e-12))
    for y in nb.prange(height):
        for x in range(width):
            d = disparity[y, x]
            if d <= low:
                positions[y, x] = np.float32(0.0)
                continue
            if d >= ladder[last]:
                positions[y, x] = np.float32(last)
                continue
            k = min(int((d - low) * per_step), last - 1)
            while ladder[k] > d:
                k -= 1
            while ladder[k + 1] <= d:
                k += 1
            positions[y, x] = np.float32(k) + (d - ladder[k]) / (ladder[k + 1] - ladder[k])


@nb.njit(cache=True, fastmath=True, inline="always")
def _step(d, d_before, r, g, b, carry, reach_px, jump):
    """Move one sweep on by a pixel.

    `carry` is: 0 disparity, 1 steps, 2-4 colour of the background that is carried; 5-7 running
    mean of the surface that is being crossed, 8 pixels crossed of it, 9-11 and 12-14 the colours
    one and two pixels back.
    """
    if abs(d - d_before) > jump:
        if d > d_before:
            carry[0] = d_before
            carry[1] = np.float32(0.0)
            carry[2] = carry[5]
            carry[3] = carry[6]
            carry[4] = carry[7]
        carry[8] = np.float32(0.0)
    # The pixels at an edge are mixtures of both sides, so the mean lags two pixels behind.
    if carry[8] < np.float32(3.0):
        carry[5] = r
        carry[6] = g
        carry[7] = b
    else:
        rate = np.float32(0.25)
        if carry[8] == np.float32(3.0):
            rate = np.float32(1.0)
        carry[5] += rate * (carry[12] - carry[5])
        carry[6] += rate * (carry[13] - carry[6])
        carry[7] += rate * (carry[14] - carry[7])
    carry[8] += np.float32(1.0)
    carry[12] = carry[9]
    carry[13] = carry[10]
    carry[14] = carry[11]
    carry[9] = r
    carry[10] = g
    carry[11] = b
    if carry[0] > np.float32(0.0):
        carry[1] += np.float32(1.0)
        behind = d - carry[0]
        if behind <= jump or carry[1] > reach_px * behind:
            carry[0] = np.float32(0.0)


@nb.njit(cache=True, fastmath=True, parallel=True)
def sweep_rows(disparity, rgb, reach_px, jump, forward, found, found_rest):
    """Carry the background into the foreground along rows."""
    height, width = disparity.shape
    for y in nb.prange(height):
        carry = np.zeros(15, np.float32)
        first = 0 if forward else width - 1
        step = 1 if forward else -1
        d_before = disparity[y, first]
        for n in range(width):
            x = first + n * step
            d = disparity[y, x]
            _step(
                d,
                d_before,
                np.float32(rgb[y, x, 0]),
                np.float32(rgb[y, x, 1]),
                np.float32(rgb[y, x, 2]),
                carry,
                reach_px,
                jump,
            )
            d_before = d
            found[y, x] = carry[0]
            if carry[0] > np.float32(0.0):
                for c in range(4):
                    found_rest[y, x, c] = carry[1 + c]


@nb.njit(cache=True, fastmath=True, parallel=True)
def sweep_columns(disparity, rgb, reach_px, jump, forward, found, found_rest):
    """Carry the background into the foreground along columns."""
    height, width = disparity.shape
    lanes = (width + LANE_PX - 1) // LANE_PX
    for lane in nb.prange(lanes):
        x0 = lane * LANE_PX
        x1 = min(x0 + LANE_PX, width)
        carry = np.zeros((LANE_PX, 15), np.float32)
        first = 0 if forward else height - 1
        step = 1 if forward else -1
        y_before = first
        for n in range(height):
            y = first + n * step
            for x in range(x0, x1):
                _step(
                    disparity[y, x],
                    disparity[y_before, x],
                    np.float32(rgb[y, x, 0]),
                    np.float32(rgb[y, x, 1]),
                    np.float32(rgb[y, x, 2]),
                    carry[x - x0],
                    reach_px,
                    jump,
                )
                found[y, x] = carry[x - x0, 0]
                if carry[x - x0, 0] > np.float32(0.0):
                    for c in range(4):
                        found_rest[y, x, c] = carry[x - x0, 1 + c]
            y_before = y


@nb.njit(cache=True, fastmath=True, parallel=True)
def join_sweeps(found, found_rest, jump, hidden_disparity, hidden_rgb):
    """Join the four sweeps: the disparity of the nearest edge, the colours of all that agree.

    `found` is the disparity behind each pixel, 0 = none; `found_rest` is steps, red, green, blue,
    and only written where there is one.
    """
    height, width = hidden_disparity.shape
    for y in nb.prange(height):
        for x in range(width):
            best = -1
            steps = np.float32(1e9)
            for s in range(4):
                if found[s, y, x] > np.float32(0.0) and found_rest[s, y, x, 0] < steps:
                    steps = found_rest[s, y, x, 0]
                    best = s
            if best < 0:
                hidden_disparity[y, x] = np.float32(0.0)
                continue
            at = found[best, y, x]
            total = np.float32(0.0)
            d_sum = np.float32(0.0)
            r = np.float32(0.0)
            g = np.float32(0.0)
            b = np.float32(0.0)
            for s in range(4):
                d = found[s, y, x]
                if d > np.float32(0.0) and abs(d - at) <= jump:
                    weight = np.float32(1.0) / found_rest[s, y, x, 0]
                    total += weight
                    d_sum += weight * d
                    r += weight * found_rest[s, y, x, 1]
                    g += weight * found_rest[s, y, x, 2]
                    b += weight * found_rest[s, y, x, 3]
            norm = np.float32(1.0) / total
            hidden_disparity[y, x] = d_sum * norm
            hidden_rgb[y, x, 0] = np.uint8(r * norm + np.float32(0.5))
            hidden_rgb[y, x, 1] = np.uint8(g * norm + np.float32(0.5))
            hidden_rgb[y, x, 2] = np.uint8(b * norm + np.float32(0.5))


@nb.njit(cache=True, fastmath=True, parallel=True)
def smooth_hidden(hidden_disparity, hidden_rgb, radius, smooth_rgb):
    """Average the colours of the pixels that have something behind them, over a square."""
    height, width = hidden_disparity.shape
    for y in nb.prange(height):
        for x in range(width):
            if hidden_disparity[y, x] == np.float32(0.0):
                continue
            r = 0
            g = 0
            b = 0
            count = 0
            for j in range(max(y - radius, 0), min(y + radius + 1, height)):
                for i in range(max(x - radius, 0), min(x + radius + 1, width)):
                    if hidden_disparity[j, i] > np.float32(0.0):
                        r += hidden_rgb[j, i, 0]
                        g += hidden_rgb[j, i, 1]
                        b += hidden_rgb[j, i, 2]
                        count += 1
            smooth_rgb[y, x, 0] = (2 * r + count) // (2 * count)
            smooth_rgb[y, x, 1] = (2 * g + count) // (2 * count)
            smooth_rgb[y, x, 2] = (2 * b + count) // (2 * count)


@nb.njit(cache=True, fastmath=True, inline="always")
def _put(texels, index, plane, x, y, r, g, b, alpha):
    """Write one texel into its tile and into the aprons of the tiles before it."""
    i = x + 1
    j = y + 1
    col = i // 15
    row = j // 15
    di = i - col * 15
    dj = j - row * 15
    scale = np.float32(alpha) * np.float32(1.0 / 255.0)
    half = np.float32(0.5)
    texel = (
        np.uint32(np.float32(r) * scale + half)
        | (np.uint32(np.float32(g) * scale + half) << np.uint32(8))
        | (np.uint32(np.float32(b) * scale + half) << np.uint32(16))
        | (np.uint32(alpha) << np.uint32(24))
    )
    texels[index[plane, row, col], dj * 16 + di] = texel
    left = di == 0 and col > 0
    up = dj == 0 and row > 0
    if left:
        texels[index[plane, row, col - 1], dj * 16 + 15] = texel
    if up:
        texels[index[plane, row - 1, col], 15 * 16 + di] = texel
    if left and up:
        texels[index[plane, row - 1, col - 1], 15 * 16 + 15] = texel


@nb.njit(cache=True, fastmath=True, inline="always")
def _mark(held, plane, x, y):
    i = x + 1
    j = y + 1
    col = i // 15
    row = j // 15
    held[plane, row, col] = True
    left = i - col * 15 == 0 and col > 0
    up = j - row * 15 == 0 and row > 0
    if left:
        held[plane, row, col - 1] = True
    if up:
        held[plane, row - 1, col] = True
    if left and up:
        held[plane, row - 1, col - 1] = True


@nb.njit(cache=True, fastmath=True, inline="always")
def _split(position, last):
    """Return the plane behind and the 8-bit opacity of the plane before it."""
    behind = min(int(position), last - 1)
    return behind, int((position - np.float32(behind)) * np.float32(255.0) + np.float32(0.5))


@nb.njit(cache=True, fastmath=True, parallel=True)
def mark_tiles(positions, lowest, hidden_positions, underlap, held):
    """Mark the places that hold a texel."""
    height, width = positions.shape
    last = held.shape[0] - 1
    for y in nb.prange(height):
        for x in range(width):
            behind, alpha = _split(positions[y, x], last)
            top = max(min(behind, int(lowest[y, x])), behind - underlap)
            if alpha < 255 or top < behind:
                _mark(held, behind, x, y)
            if alpha > 0:
                _mark(held, behind + 1, x, y)
            for plane in range(top, behind):
                _mark(held, plane, x, y)
            if hidden_positions[y, x] >= np.float32(0.0):
                deep, deep_alpha = _split(hidden_positions[y, x], last)
                if deep + 1 < top:
                    _mark(held, deep, x, y)
                    if deep_alpha > 0:
                        _mark(held, deep + 1, x, y)


@nb.njit(cache=True, fastmath=True, parallel=True)
def fill_tiles(positions, lowest, hidden_positions, underlap, rgb, hidden_rgb, index, texels):
    """Write the texels; the same cases as `mark_tiles`."""
    height, width = positions.shape
    last = index.shape[0] - 1
    for y in nb.prange(height):
        for x in range(width):
            behind, alpha = _split(positions[y, x], last)
            top = max(min(behind, int(lowest[y, x])), behind - underlap)
            r, g, b = rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2]
            if alpha < 255 or top < behind:
                _put(texels, index, behind, x, y, r, g, b, 255)
            if alpha > 0:
                _put(texels, index, behind + 1, x, y, r, g, b, alpha)
            for plane in range(top, behind):
                _put(texels, index, plane, x, y, r, g, b, 255)
            if hidden_positions[y, x] >= np.float32(0.0):
                deep, deep_alpha = _split(hidden_positions[y, x], last)
                if deep + 1 < top:
                    r, g, b = hidden_rgb[y, x, 0], hidden_rgb[y, x, 1], hidden_rgb[y, x, 2]
                    _put(texels, index, deep, x, y, r, g, b, 255)
                    if deep_alpha > 0:
                        _put(texels, index, deep + 1, x, y, r, g, b, deep_alpha)
