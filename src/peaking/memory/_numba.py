# pyright: basic
"""The look on the CPU; the same result as `_numpy.py` but for rounding."""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.memory._numpy import MIN_HALF_PX, MIN_THROUGH, NEAR_M, THROUGH

BANDS = 2
"""Rows are cut into so many bands, each drawn by one thread."""


def look(points_m, radius_m, rotation, translation_m, pinhole):
    """Look; see `_numpy.look`."""
    width, height = pinhole.size_px
    depth_m = np.empty((height, width), np.float32)
    cell = np.empty((height, width), np.int32)
    inner = np.array([pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px], np.float32)
    _look(
        points_m,
        radius_m.astype(np.float32),
        rotation.astype(np.float32),
        translation_m.astype(np.float32),
        inner,
        depth_m,
        cell,
    )
    return depth_m, cell


@nb.njit(cache=True, fastmath=True, parallel=True)
def _look(points_m, radius_m, rotation, translation_m, inner, depth_m, cell):
    height, width = cell.shape
    fx, fy, cx, cy = inner[0], inner[1], inner[2], inner[3]
    half = np.float32(0.5)
    nothing = np.float32(1e30)
    for band in nb.prange(BANDS):
        first = band * height // BANDS
        end = (band + 1) * height // BANDS
        for y in range(first, end):
            for x in range(width):
                depth_m[y, x] = nothing
                cell[y, x] = -1
        for number in range(len(points_m)):
            px, py, pz = points_m[number, 0], points_m[number, 1], points_m[number, 2]
            z = rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz + translation_m[2]
            if z < np.float32(NEAR_M):
                continue
            per_m = np.float32(1.0) / z
            reach = max(radius_m[number] * fx * per_m, np.float32(MIN_HALF_PX))
            y_m = rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz + translation_m[1]
            v = fy * y_m * per_m + cy
            if v + reach < first or v - reach > end:
                continue
            x_m = rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz + translation_m[0]
            u = fx * x_m * per_m + cx
            if u + reach < 0 or u - reach > width:
                continue
            left = int(np.ceil(max(u - reach - half, np.float32(0.0))))
            right = int(np.floor(min(u + reach - half, np.float32(width - 1))))
            top = max(int(np.ceil(max(v - reach - half, np.float32(0.0)))), first)
            bottom = min(int(np.floor(min(v + reach - half, np.float32(height - 1)))), end - 1)
            for y in range(top, bottom + 1):
                for x in range(left, right + 1):
                    if z < depth_m[y, x]:
                        depth_m[y, x] = z
                        cell[y, x] = number
        for y in range(first, end):
            for x in range(width):
                if cell[y, x] < 0:
                    depth_m[y, x] = np.float32(0.0)


def _ask(kernel, live_m, pinhole, asked, answer):
    """Let a kernel write its answer for every pixel."""
    inner = np.array([pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px], np.float32)
    kernel(
        live_m,
        inner,
        asked.depth_m,
        asked.first,
        asked.size_px,
        asked.inner,
        asked.rotation,
        asked.translation_m,
        answer,
    )
    return answer


def behind(live_m, pinhole, asked):
    """Ask the views; see `_numpy.behind`."""
    return _ask(_behind, live_m, pinhole, asked, np.empty(live_m.shape, np.float32))


@nb.njit(cache=True, parallel=True)
def _behind(live_m, inner, depth_m, first, size_px, inners, rotation, translation_m, hidden):
    height, width = live_m.shape
    half = np.float32(0.5)
    nothing = np.float32(np.inf)
    for y in nb.prange(height):
        for x in range(width):
            z = live_m[y, x]
            if not z > np.float32(0.0):
                hidden[y, x] = np.float32(0.0)
                continue
            px = (np.float32(x) + half - inner[2]) / inner[0] * z
            py = (np.float32(y) + half - inner[3]) / inner[1] * z
            least = nothing
            for k in range(len(first)):
                r, t = rotation[k], translation_m[k]
                z_m = r[2, 0] * px + r[2, 1] * py + r[2, 2] * z + t[2]
                if not z_m > np.float32(NEAR_M):
                    continue
                x_m = r[0, 0] * px + r[0, 1] * py + r[0, 2] * z + t[0]
                y_m = r[1, 0] * px + r[1, 1] * py + r[1, 2] * z + t[1]
                u = inners[k, 0] * x_m / z_m + inners[k, 2]
                v = inners[k, 1] * y_m / z_m + inners[k, 3]
                if not (u >= 0 and v >= 0 and u < size_px[k, 0] and v < size_px[k, 1]):
                    continue
                seen_m = depth_m[first[k] + int(v) * size_px[k, 0] + int(u)]
                if seen_m > np.float32(0.0):
                    least = min(least, z_m / seen_m - np.float32(1.0))
                    if least <= np.float32(0.0):
                        break  # it was seen; by how much does not matter
            hidden[y, x] = least


def looked_through(live_m, pinhole, asked):
    """Ask the views; see `_numpy.looked_through`."""
    return _ask(_looked_through, live_m, pinhole, asked, np.zeros(live_m.shape, np.bool_))


@nb.njit(cache=True, parallel=True)
def _looked_through(
    live_m, inner, depth_m, first, size_px, inners, rotation, translation_m, through
):
    height, width = live_m.shape
    half = np.float32(0.5)
    nothing = np.float32(np.inf)
    for y in nb.prange(height):
        for x in range(width):
            z = live_m[y, x]
            if not z > np.float32(0.0):
                continue
            px = (np.float32(x) + half - inner[2]) / inner[0] * z
            py = (np.float32(y) + half - inner[3]) / inner[1] * z
            count = 0
            for k in range(len(first)):
                r, t = rotation[k], translation_m[k]
                z_m = r[2, 0] * px + r[2, 1] * py + r[2, 2] * z + t[2]
                if not z_m > np.float32(NEAR_M):
                    continue
                x_m = r[0, 0] * px + r[0, 1] * py + r[0, 2] * z + t[0]
                y_m = r[1, 0] * px + r[1, 1] * py + r[1, 2] * z + t[1]
                u = inners[k, 0] * x_m / z_m + inners[k, 2]
                v = inners[k, 1] * y_m / z_m + inners[k, 3]
                cols, rows = size_px[k, 0], size_px[k, 1]
                if not (u >= 0 and v >= 0 and u < cols and v < rows):
                    continue
                if not depth_m[first[k] + int(v) * cols + int(u)] > np.float32(0.0):
                    continue
                nearest = nothing
                for row in range(max(int(v) - 1, 0), min(int(v) + 2, rows)):
                    for col in range(max(int(u) - 1, 0), min(int(u) + 2, cols)):
                        seen_m = depth_m[first[k] + row * cols + col]
                        if seen_m > np.float32(0.0):
                            nearest = min(nearest, seen_m)
                if z_m < np.float32(1.0 - THROUGH) * nearest:
                    count += 1
                    if count >= MIN_THROUGH:
                        through[y, x] = True
                        break
