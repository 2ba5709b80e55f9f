# pyright: basic
"""Loops of the baselines: project, splat with a z-buffer, rasterise a mesh with a z-buffer.

float32 throughout. Image coordinates in here have pixel centres at integers (u = x - 0.5), because
every coordinate is an index too.
"""

import numpy as np
from numba import njit, prange

FAR = np.float32(1e30)
BEHIND = np.float32(1e-6)
ON_EDGE = np.float32(-1e-4)


@njit(cache=True, parallel=True)
def project(depth_m, matrix, offset):
    """Return (u, v, z) of every source pixel in the target; z = 0 where there is nothing."""
    height, width = depth_m.shape
    uvz = np.zeros((height, width, 3), dtype=np.float32)
    half = np.float32(0.5)
    for row in prange(height):
        y = np.float32(row) + half
        for col in range(width):
            d = depth_m[row, col]
            if not d > BEHIND:
                continue
            x = np.float32(col) + half
            z = d * (matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]) + offset[2]
            if z <= BEHIND:
                continue
            u = d * (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]) + offset[0]
            v = d * (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]) + offset[1]
            uvz[row, col, 0] = u / z - half
            uvz[row, col, 1] = v / z - half
            uvz[row, col, 2] = z
    return uvz


@njit(cache=True)
def _spacing(depth_m, uvz, place, step, axis, same_surface):
    """Return the mean distance along `axis` to the two neighbours on the same surface, or -1."""
    row, col = place
    d = depth_m[row, col]
    total = np.float32(0.0)
    count = np.float32(0.0)
    for side in (-1, 1):
        r, c = row + side * step[0], col + side * step[1]
        if r < 0 or c < 0 or r >= uvz.shape[0] or c >= uvz.shape[1] or uvz[r, c, 2] <= 0:
            continue
        e = depth_m[r, c]
        if max(d, e) <= min(d, e) * same_surface:
            total += abs(uvz[r, c, axis] - uvz[row, col, axis])
            count += np.float32(1.0)
    return total / count if count > 0 else np.float32(-1.0)


@njit(cache=True, parallel=True)
def footprints(depth_m, uvz, same_surface, zoom, largest_px):
    """Return the half width and half height of every point's tent, in target pixels.

    The spacing to the neighbours on the same surface (depth ratio below `same_surface`); where
    there is none, the pixel's size at its depth. Rotation in the picture plane changes nothing.
    """
    height, width = depth_m.shape
    size = np.ones((height, width, 2), dtype=np.float32)
    one = np.float32(1.0)
    for row_unsigned in prange(height):
        row = np.int64(row_unsigned)
        for col in range(width):
            if uvz[row, col, 2] <= 0:
                continue
            plain = zoom * depth_m[row, col] / uvz[row, col, 2]
            for axis in range(2):
                along_x = _spacing(depth_m, uvz, (row, col), (0, 1), axis, same_surface)
                along_y = _spacing(depth_m, uvz, (row, col), (1, 0), axis, same_surface)
                if along_x < 0:
                    along_x = plain if axis == 0 else np.float32(0.0)
                if along_y < 0:
                    along_y = plain if axis == 1 else np.float32(0.0)
                spacing = np.sqrt(along_x * along_x + along_y * along_y)
                size[row, col, axis] = min(max(spacing, one), largest_px)
    return size


@njit(cache=True)
def splat_depth(uvz, size, reach, shape):
    """Return the z-buffer; a point covers the pixel centres within `reach` times its size."""
    height, width = shape
    nearest_m = np.full((height, width), FAR, dtype=np.float32)
    for row in range(uvz.shape[0]):
        for col in range(uvz.shape[1]):
            u, v, z = uvz[row, col, 0], uvz[row, col, 1], uvz[row, col, 2]
            if z <= 0:
                continue
            rx, ry = reach * size[row, col, 0], reach * size[row, col, 1]
            if u + rx < 0 or v + ry < 0 or u - rx > width - 1 or v - ry > height - 1:
                continue
            for py in range(max(0, int(np.ceil(v - ry))), min(height - 1, int(v + ry)) + 1):
                for px in range(max(0, int(np.ceil(u - rx))), min(width - 1, int(u + rx)) + 1):
                    if z < nearest_m[py, px]:
                        nearest_m[py, px] = z
    return nearest_m


@njit(cache=True, fastmath=True)
def splat_colour(rgb, uvz, size, nearest_m, depth_ratio):
    """Return the sums of weighted colour (0…1) and weight (last) of the points that are seen."""
    height, width = nearest_m.shape
    sums = np.zeros((height, width, 4), dtype=np.float32)
    one = np.float32(1.0)
    scale = np.float32(1.0 / 255.0)
    for row in range(uvz.shape[0]):
        for col in range(uvz.shape[1]):
            u, v, z = uvz[row, col, 0], uvz[row, col, 1], uvz[row, col, 2]
            if z <= 0:
                continue
            rx, ry = size[row, col, 0], size[row, col, 1]
            if u + rx < 0 or v + ry < 0 or u - rx > width - 1 or v - ry > height - 1:
                continue
            for py in range(max(0, int(np.ceil(v - ry))), min(height - 1, int(v + ry)) + 1):
                wy = one - abs(np.float32(py) - v) / ry
                for px in range(max(0, int(np.ceil(u - rx))), min(width - 1, int(u + rx)) + 1):
                    if z > nearest_m[py, px] * depth_ratio:
                        continue
                    weight = wy * (one - abs(np.float32(px) - u) / rx)
                    if weight <= 0:
                        continue
                    for c in range(3):
                        sums[py, px, c] += weight * scale * np.float32(rgb[row, col, c])
                    sums[py, px, 3] += weight
    return sums


@njit(cache=True)
def _triangle(uvz, texel, nearest_m, texture):
    """Draw one triangle: corners `uvz` (3, 3), their texture coordinates `texel` (3, 2)."""
    height, width = nearest_m.shape
    u0, v0, z0 = uvz[0, 0], uvz[0, 1], uvz[0, 2]
    u1, v1, z1 = uvz[1, 0], uvz[1, 1], uvz[1, 2]
    u2, v2, z2 = uvz[2, 0], uvz[2, 1], uvz[2, 2]
    low_u, high_u = min(u0, u1, u2), max(u0, u1, u2)
    low_v, high_v = min(v0, v1, v2), max(v0, v1, v2)
    slack = np.float32(1e-3)
    if high_u + slack < 0 or high_v + slack < 0 or low_u > width - 1 + slack:
        return
    if low_v > height - 1 + slack:
        return
    area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
    if area <= np.float32(1e-9):  # seen from behind, or on edge
        return
    one = np.float32(1.0)
    by_area = one / area
    i0, i1, i2 = one / z0, one / z1, one / z2
    for py in range(max(0, int(np.ceil(low_v - slack))), min(height - 1, int(high_v + slack)) + 1):
        y = np.float32(py)
        for px in range(
            max(0, int(np.ceil(low_u - slack))), min(width - 1, int(high_u + slack)) + 1
        ):
            x = np.float32(px)
            b0 = ((u1 - x) * (v2 - y) - (u2 - x) * (v1 - y)) * by_area
            b1 = ((u2 - x) * (v0 - y) - (u0 - x) * (v2 - y)) * by_area
            b2 = one - b0 - b1
            if b0 < ON_EDGE or b1 < ON_EDGE or b2 < ON_EDGE:
                continue
            p0, p1, p2 = b0 * i0, b1 * i1, b2 * i2  # perspective: linear in 1/z
            z = one / (p0 + p1 + p2)
            if z >= nearest_m[py, px]:
                continue
            nearest_m[py, px] = z
            texture[py, px, 0] = (p0 * texel[0, 0] + p1 * texel[1, 0] + p2 * texel[2, 0]) * z
            texture[py, px, 1] = (p0 * texel[0, 1] + p1 * texel[1, 1] + p2 * texel[2, 1]) * z


@njit(cache=True)
def rasterise(depth_m, uvz, matrix, offset, settings, shape):
    """Return the z-buffer and the source coordinates seen at every target pixel.

    `settings` is (cut ratio, flap): a quad whose depths differ by more than the ratio is cut, and
    each of its corners keeps a fronto-parallel flap of `flap` source pixels towards its middle.
    """
    height, width = shape
    nearest_m = np.full((height, width), FAR, dtype=np.float32)
    texture = np.zeros((height, width, 2), dtype=np.float32)
    cut_ratio, flap = settings
    corner = np.zeros((3, 3), dtype=np.float32)
    texel = np.zeros((3, 2), dtype=np.float32)
    rows = np.array([[0, 0, 1], [0, 1, 1]])
    cols = np.array([[0, 1, 0], [1, 1, 0]])
    for row in range(depth_m.shape[0] - 1):
        for col in range(depth_m.shape[1] - 1):
            low, high = FAR, np.float32(0.0)
            whole = True
            for r in (row, row + 1):
                for c in (col, col + 1):
                    whole = whole and uvz[r, c, 2] > 0
                    low = min(low, depth_m[r, c])
                    high = max(high, depth_m[r, c])
            if whole and high <= low * cut_ratio:
                for half in range(2):
                    for k in range(3):
                        r, c = row + rows[half, k], col + cols[half, k]
                        corner[k] = uvz[r, c]
                        texel[k, 0], texel[k, 1] = np.float32(c), np.float32(r)
                    _triangle(corner, texel, nearest_m, texture)
            elif flap > 0:
                for r in (row, row + 1):
                    for c in (col, col + 1):
                        if uvz[r, c, 2] > 0:
                            top = np.float32(r) - (flap if r > row else np.float32(0.0))
                            left = np.float32(c) - (flap if c > col else np.float32(0.0))
                            _flap(
                                (left, top, flap),
                                depth_m[r, c],
                                (matrix, offset),
                                (corner, texel),
                                (nearest_m, texture),
                                (np.float32(c), np.float32(r)),
                            )
    return nearest_m, texture


@njit(cache=True)
def _flap(box, depth_m, mapping, scratch, target, owner):
    """Draw a square of constant depth that has the colour of the pixel it belongs to."""
    left, top, side = box
    matrix, offset = mapping
    corner, texel = scratch
    nearest_m, texture = target
    half = np.float32(0.5)
    for part in range(2):
        for k in range(3):
            if part == 0:
                dx, dy = (0, 1, 0)[k], (0, 0, 1)[k]
            else:
                dx, dy = (1, 1, 0)[k], (0, 1, 1)[k]
            x = left + side * np.float32(dx) + half
            y = top + side * np.float32(dy) + half
            z = depth_m * (matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2]) + offset[2]
            if z <= BEHIND:
                return
            u = depth_m * (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2]) + offset[0]
            v = depth_m * (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2]) + offset[1]
            corner[k, 0], corner[k, 1], corner[k, 2] = u / z - half, v / z - half, z
            texel[k, 0], texel[k, 1] = owner
        _triangle(corner, texel, nearest_m, texture)
