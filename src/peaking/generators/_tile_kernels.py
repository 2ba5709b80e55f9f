# pyright: basic
"""Kernels of `_numba.py` that split pixels between planes and write the tiles.

Images that tiles are cut from have the rim of the tiles around them, so pixel (y, x) of the
picture is (y + 1, x + 1) there, and every tile is a square of them. Per pixel they hold

- a split: the plane behind in the upper 16 bits, the opacity of the plane before it in the lower
  8; negative where there is no pixel;
- a colour: RGBA in the bytes of a uint32.

Numba's cache does not see that another file has changed: after a change of `packed_split`, touch
`_background_kernels.py` too.
"""

from __future__ import annotations

import numba as nb
import numpy as np

F, I32, U32 = np.float32, np.int32, np.uint32
CELL, TILE = 15, 16
TEXELS = TILE * TILE
BLOCK = 64
"""Pixels of a row that are split together; few planes are near all of them."""
NOWHERE = -(1 << 17)
"""A split whose planes are none."""


@nb.njit(cache=True)
def packed_split(d, disparities):
    """Return the split of one disparity between the ascending disparities of the planes."""
    last = disparities.shape[0] - 1
    if d <= disparities[0]:
        return I32(0)
    if d >= disparities[last]:
        return I32(((last - 1) << 16) | 255)
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) >> 1
        if disparities[middle] <= d:
            low = middle
        else:
            high = middle
    part = (d - disparities[low]) / (disparities[low + 1] - disparities[low])
    return I32((low << 16) | int(part * F(255.0) + F(0.5)))


@nb.njit(cache=True, parallel=True)
def split_pixels(disparity, disparities, per_step, behind, opacity):
    """Write for every pixel the plane behind it and the opacity of the plane before."""
    height, width = disparity.shape
    last = disparities.shape[0] - 2
    for y in nb.prange(height):
        row = disparity[y]
        plane = np.empty(width, np.int32)
        for first in range(0, width, BLOCK):
            block = row[first : first + BLOCK]
            planes = plane[first : first + BLOCK]
            least = most = block[0]
            for d in block:
                least, most = min(least, d), max(most, d)
            below = 0
            while below < last and disparities[below + 1] <= least:
                below += 1
            planes[:] = below
            while below < last and disparities[below + 1] <= most:
                below += 1
                for x in range(block.shape[0]):
                    planes[x] += I32(block[x] >= disparities[below])
        for x in range(width):
            k = plane[x]
            part = (row[x] - disparities[k]) * per_step[k]
            part = min(max(part, F(0.0)), F(1.0))
            behind[y, x] = k
            opacity[y, x] = np.uint8(part * F(255.0) + F(0.5))


@nb.njit(cache=True, parallel=True)
def pack_pixels(behind, opacity, lowest, underlap, seen, hidden):
    """Write the splits of the picture with how many planes go on below each, in bits 8 to 15.

    Takes what is hidden away where the picture's own planes are.
    """
    height, width = behind.shape
    for y in nb.prange(height):
        for x in range(width):
            plane = I32(behind[y, x])
            below = min(plane - min(plane, I32(lowest[y, x])), underlap)
            seen[y + 1, x + 1] = (plane << 16) | (below << 8) | I32(opacity[y, x])
            deep = hidden[y + 1, x + 1]
            hidden[y + 1, x + 1] = NOWHERE if (deep >> 16) + 1 >= plane - below else deep


@nb.njit(cache=True, parallel=True)
def mark_tiles(seen, hidden, held):
    """Mark the places that hold a texel."""
    planes, rows, cols = held.shape
    for row in nb.prange(rows):
        for col in range(cols):
            marks = np.zeros(planes + 1, np.bool_)
            done, deep_done = NOWHERE, NOWHERE
            for j in range(row * CELL, row * CELL + TILE):
                for i in range(col * CELL, col * CELL + TILE):
                    split, deep = seen[j, i], hidden[j, i]
                    alpha = split & 255
                    # Of the opacity it matters only whether it is none, all, or between.
                    alike = split - alpha + (0 if alpha == 0 else (2 if alpha == 255 else 1))
                    if alike != done and split >= 0:
                        done = alike
                        plane, below = split >> 16, (split >> 8) & 255
                        for k in range(plane - below, plane):
                            marks[k] = True
                        marks[plane] |= alpha < 255 or below > 0
                        marks[plane + 1] |= alpha > 0
                    alike = deep - (deep & 255) + (0 if deep & 255 == 0 else 1)
                    if alike != deep_done and deep >= 0:
                        deep_done = alike
                        marks[deep >> 16] = True
                        marks[(deep >> 16) + 1] |= (deep & 255) > 0
            for k in range(planes):
                held[k, row, col] = marks[k]


@nb.njit(cache=True)
def number_tiles(held, index, places):
    """Number the marked places in order; return how many there are."""
    planes, rows, cols = held.shape
    count = 0
    for plane in range(planes):
        for row in range(rows):
            for col in range(cols):
                if held[plane, row, col]:
                    index[plane, row, col] = count
                    places[count, 0] = plane
                    places[count, 1] = row
                    places[count, 2] = col
                    count += 1
                else:
                    index[plane, row, col] = -1
    return count


@nb.njit(cache=True)
def _premultiplied(rgba, alpha):
    scale = F(alpha) * F(1.0 / 255.0)
    r = U32(I32(F(I32(rgba & U32(255))) * scale + F(0.5)))
    g = U32(I32(F(I32((rgba >> U32(8)) & U32(255))) * scale + F(0.5)))
    b = U32(I32(F(I32((rgba >> U32(16)) & U32(255))) * scale + F(0.5)))
    return U32(r | U32(g << U32(8)) | U32(b << U32(16)) | U32(U32(alpha) << U32(24)))


@nb.njit(cache=True, parallel=True)
def fill_tiles(seen, rgba, hidden, hidden_rgba, index, texels):
    """Write every texel of the numbered tiles.

    All loops over texels are over flat arrays, so that they become SIMD, and all steps are cast
    back to 32 bits, so that it works on eight at once.
    """
    planes, rows, cols = index.shape
    for row in nb.prange(rows):
        lowest = np.empty(TEXELS, np.int32)
        front = np.empty(TEXELS, np.int32)
        highest = np.empty(TEXELS, np.int32)
        deep = np.empty(TEXELS, np.int32)
        colour = np.empty(TEXELS, np.uint32)
        before = np.empty(TEXELS, np.uint32)
        deep_colour = np.empty(TEXELS, np.uint32)
        deep_before = np.empty(TEXELS, np.uint32)
        for col in range(cols):
            for j in range(TILE):
                for i in range(TILE):
                    y, x = row * CELL + j, col * CELL + i
                    front[j * TILE + i] = seen[y, x]
                    deep[j * TILE + i] = hidden[y, x]
                    colour[j * TILE + i] = rgba[y, x]
                    deep_colour[j * TILE + i] = hidden_rgba[y, x]
            for n in range(TEXELS):
                split = front[n]
                below, alpha = I32((split >> I32(8)) & I32(255)), I32(split & I32(255))
                plane = I32(split >> I32(16))
                lowest[n] = plane - below
                highest[n] = plane - I32(1) if alpha == 255 and below == 0 else plane
                front[n] = plane + I32(1)
                before[n] = _premultiplied(colour[n], alpha)
            any_deep = NOWHERE
            for n in range(TEXELS):
                any_deep = max(any_deep, deep[n])
            if any_deep >= 0:
                for n in range(TEXELS):
                    deep_before[n] = _premultiplied(deep_colour[n], I32(deep[n] & I32(255)))
                    deep[n] = I32(deep[n] >> I32(16))
            for k in range(planes):
                number = index[k, row, col]
                if number < 0:
                    continue
                here, tile = I32(k), texels[number]
                for n in range(TEXELS):
                    inside = lowest[n] <= here and here <= highest[n]
                    texel = colour[n] if inside else U32(0)
                    tile[n] = before[n] if front[n] == here else texel
                if any_deep >= 0:
                    one_back = I32(here - I32(1))
                    for n in range(TEXELS):
                        texel = deep_colour[n] if deep[n] == here else tile[n]
                        tile[n] = deep_before[n] if deep[n] == one_back else texel
