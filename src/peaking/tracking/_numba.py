# pyright: basic
"""The alignment on the CPU, on one core; the same as `_numpy.py` but for rounding.

Room is taken once per thread and size. The median is read from a histogram of residuals.
"""

from __future__ import annotations

import threading

import numba as nb
import numpy as np

from peaking.tracking.solution import (
    AGREES,
    CAUCHY,
    CORRELATED,
    DEPTH_EDGE,
    GAIN_RANGE,
    GAIN_SD,
    ITERATIONS,
    LUMA,
    MAX_AGREEING_SIGMA,
    MAX_CHOSEN,
    MIN_ALPHA,
    MIN_GRADIENT,
    MIN_PIXELS,
    MIN_SIGMA,
    OFFSET_SD,
    SMALL_MOVE_M,
    SMALL_TURN_RAD,
    Solution,
    first_and_last_level,
)

BINS = 1024
BINS_PER_UNIT = 2048.0
"""Residuals of half the range of brightness and more are in the last bin."""

OUTSIDE = 1e9
"""In place of the residual of a pixel that is not seen in the live picture."""

_rooms = threading.local()


class Room:
    """Everything that an alignment of one size writes into."""

    def __init__(self, height: int, width: int) -> None:
        """Take it."""
        self.size = height, width
        self.levels = first_and_last_level(height, width)
        finest, coarsest = self.levels
        pixels = sum((height >> k) * (width >> k) for k in range(coarsest + 1))
        most = (height >> finest) * (width >> finest)
        self.pictures = np.empty((3, pixels), np.float32)
        self.chosen = np.empty((most, 10), np.float32)
        self.places = np.empty(most, np.uint8)
        self.residuals = np.empty((2, most), np.float32)
        self.motion = np.empty(14)
        self.information = np.empty((6, 6))
        self.numbers = np.empty(4)
        self.last_step = np.empty(6)


def _room(height: int, width: int) -> Room:
    room = getattr(_rooms, "last", None)
    if room is None or room.size != (height, width):
        room = _rooms.last = Room(height, width)
    return room


def solve(rgba, depth_m, live, pinhole, prior):
    """Align; see `peaking.tracking.align`. `prior`: information of the given pose."""
    room = _room(*depth_m.shape)
    lens = np.array([pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px])
    count = _solve(
        rgba,
        depth_m,
        live,
        lens,
        np.asarray(prior),
        room.levels[0],
        room.levels[1],
        room.pictures,
        room.chosen,
        room.places,
        room.residuals,
        room.motion,
        room.information,
        room.numbers,
        room.last_step,
    )
    motion, numbers = room.motion, room.numbers
    return Solution(
        motion[:9].reshape(3, 3).copy(),
        motion[9:12].copy(),
        room.information.copy(),
        float(motion[12]),
        float(motion[13]),
        count,
        float(numbers[0]),
        float(numbers[1]),
        float(numbers[2]),
        float(numbers[3]),
        room.last_step.copy(),
    )


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _solve(
    rgba, depth_m, live, lens, prior, finest, coarsest,
    pictures, chosen, places, residuals, motion, information, numbers, last_step,
):  # fmt: skip
    height, width = depth_m.shape
    motion[:] = 0.0
    motion[0] = motion[4] = motion[8] = motion[12] = 1.0
    information[:] = prior
    numbers[:] = 0.0
    last_step[:] = 0.0
    histogram = np.empty(BINS + 1, np.int32)
    _first_level(rgba, depth_m, live, pictures)
    start = 0
    for level in range(coarsest):
        h, w = height >> level, width >> level
        _halve(pictures, start, h, w)
        start += h * w
    first = True
    for level in range(coarsest, finest - 1, -1):
        h, w = height >> level, width >> level
        if level < coarsest:
            start -= h * w
        count = _choose(pictures, start, h, w, lens, 0.5**level, chosen, places)
        picture = pictures[2, start : start + h * w].reshape(h, w)
        seen = _residuals(chosen, count, picture, lens, 0.5**level, motion, residuals[0], histogram)
        if seen < MIN_PIXELS:
            if level == finest:
                return seen
            continue
        if first:
            _match_brightness(chosen, count, residuals[0], motion)
            first = False
        _descend(
            chosen, count, picture, lens, 0.5**level, motion, prior, residuals[0], histogram,
            information, last_step,
        )  # fmt: skip
    return _judge(
        chosen, count, picture, lens, 0.5**finest, motion, prior, residuals, histogram,
        information, numbers, last_step,
    )  # fmt: skip


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _first_level(rgba, depth_m, live, pictures):
    height, width = depth_m.shape
    red, green, blue = np.float32(LUMA[0]), np.float32(LUMA[1]), np.float32(LUMA[2])
    unit = np.float32(1.0 / 255.0)
    opaque = np.float32(MIN_ALPHA)
    for y in range(height):
        for x in range(width):
            at = y * width + x
            alpha = rgba[y, x, 3]
            luma = red * rgba[y, x, 0] + green * rgba[y, x, 1] + blue * rgba[y, x, 2]
            pictures[0, at] = luma / alpha if alpha > np.float32(0.0) else np.float32(0.0)
            pictures[1, at] = depth_m[y, x] if alpha >= opaque else np.float32(0.0)
            pictures[2, at] = unit * (
                red * np.float32(live[y, x, 0])
                + green * np.float32(live[y, x, 1])
                + blue * np.float32(live[y, x, 2])
            )


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _halve(pictures, start, height, width):
    edge = np.float32(DEPTH_EDGE)
    quarter = np.float32(0.25)
    into = start + height * width
    for y in range(height // 2):
        for x in range(width // 2):
            a = start + 2 * y * width + 2 * x
            b = a + width
            for k in (0, 2):
                pictures[k, into] = quarter * (
                    pictures[k, a] + pictures[k, a + 1] + pictures[k, b] + pictures[k, b + 1]
                )
            z0, z1 = pictures[1, a], pictures[1, a + 1]
            z2, z3 = pictures[1, b], pictures[1, b + 1]
            low = min(min(z0, z1), min(z2, z3))
            high = max(max(z0, z1), max(z2, z3))
            smooth = low > np.float32(0.0) and high < edge * low
            pictures[1, into] = quarter * (z0 + z1 + z2 + z3) if smooth else np.float32(0.0)
            into += 1


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _choose(pictures, start, height, width, lens, scale, chosen, places):
    """Write the pixels that are compared: point, brightness, slopes. Return how many there are."""
    t, z = pictures[0], pictures[1]
    edge = np.float32(DEPTH_EDGE)
    least = np.float32(MIN_GRADIENT)
    two, eighth = np.float32(2.0), np.float32(0.125)
    fx, fy = np.float32(lens[0] * scale), np.float32(lens[1] * scale)
    cx, cy = np.float32(lens[2] * scale), np.float32(lens[3] * scale)
    count = 0
    for row in range(1, height - 1):
        for col in range(1, width - 1):
            m = start + row * width + col
            a, b = m - width, m + width
            gx = eighth * (t[a + 1] - t[a - 1] + two * (t[m + 1] - t[m - 1]) + t[b + 1] - t[b - 1])
            gy = eighth * (t[b - 1] - t[a - 1] + two * (t[b] - t[a]) + t[b + 1] - t[a + 1])
            if abs(gx) + abs(gy) <= least:
                continue
            low = min(min(min(z[a - 1], z[a]), min(z[a + 1], z[m - 1])), z[m])
            low = min(min(low, z[m + 1]), min(min(z[b - 1], z[b]), z[b + 1]))
            high = max(max(max(z[a - 1], z[a]), max(z[a + 1], z[m - 1])), z[m])
            high = max(max(high, z[m + 1]), max(max(z[b - 1], z[b]), z[b + 1]))
            if low <= np.float32(0.0) or high >= edge * low:
                continue
            depth = z[m]
            x = (np.float32(col) + np.float32(0.5) - cx) / fx * depth
            y = (np.float32(row) + np.float32(0.5) - cy) / fy * depth
            along_x, along_y = fx * gx / depth, fy * gy / depth
            along_z = -(along_x * x + along_y * y) / depth
            c = chosen[count]
            c[0], c[1], c[2], c[3] = x, y, depth, t[m]
            c[4], c[5], c[6] = along_x, along_y, along_z
            c[7] = y * along_z - depth * along_y
            c[8] = depth * along_x - x * along_z
            c[9] = x * along_y - y * along_x
            places[count] = (row * 151 + col * 97) & 255
            count += 1
    return count if count <= MAX_CHOSEN else _thin(chosen, places, count)


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _thin(chosen, places, count):
    """Keep an even part; see `solution.kept_of_256`."""
    keep = 256 * MAX_CHOSEN // count
    kept = 0
    for k in range(count):
        if places[k] < keep:
            for c in range(10):
                chosen[kept, c] = chosen[k, c]
            kept += 1
    return kept


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _residuals(chosen, count, picture, lens, scale, motion, residuals, histogram):
    """Write by how much the live picture is brighter. Return how many of the pixels are in it."""
    height, width = picture.shape
    fx, fy = np.float32(lens[0] * scale), np.float32(lens[1] * scale)
    cx, cy = np.float32(lens[2] * scale - 0.5), np.float32(lens[3] * scale - 0.5)
    r00, r01, r02 = np.float32(motion[0]), np.float32(motion[1]), np.float32(motion[2])
    r10, r11, r12 = np.float32(motion[3]), np.float32(motion[4]), np.float32(motion[5])
    r20, r21, r22 = np.float32(motion[6]), np.float32(motion[7]), np.float32(motion[8])
    t0, t1, t2 = np.float32(motion[9]), np.float32(motion[10]), np.float32(motion[11])
    gain, offset = np.float32(motion[12]), np.float32(motion[13])
    right, bottom = np.float32(width - 1), np.float32(height - 1)
    zero, one = np.float32(0.0), np.float32(1.0)
    outside = np.float32(OUTSIDE)
    per_bin = np.float32(BINS_PER_UNIT)
    histogram[:] = 0
    seen = 0
    for k in range(count):
        x, y, z = chosen[k, 0], chosen[k, 1], chosen[k, 2]
        ahead = r20 * x + r21 * y + r22 * z + t2
        residuals[k] = outside
        if not ahead > np.float32(1e-3):
            continue
        inverse = one / ahead
        u = fx * (r00 * x + r01 * y + r02 * z + t0) * inverse + cx
        v = fy * (r10 * x + r11 * y + r12 * z + t1) * inverse + cy
        if not (u >= zero and v >= zero and u < right and v < bottom):
            continue
        col, row = int(u), int(v)
        fu, fv = u - np.float32(col), v - np.float32(row)
        above = picture[row, col] + fu * (picture[row, col + 1] - picture[row, col])
        below = picture[row + 1, col] + fu * (picture[row + 1, col + 1] - picture[row + 1, col])
        residual = above + fv * (below - above) - (gain * chosen[k, 3] + offset)
        residuals[k] = residual
        histogram[min(int(abs(residual) * per_bin), BINS)] += 1
        seen += 1
    return seen


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _sigma(histogram, seen):
    half = 0.5 * seen
    below = 0
    median = BINS / BINS_PER_UNIT
    for k in range(BINS):
        if below + histogram[k] >= half:
            median = (k + (half - below) / histogram[k]) / BINS_PER_UNIT
            break
        below += histogram[k]
    return max(1.4826 * median, MIN_SIGMA)


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _match_brightness(chosen, count, residuals, motion):
    """Gain and offset that make mean and spread of both pictures equal."""
    n = 0
    sum_t = sum_tt = sum_i = sum_ii = 0.0
    for k in range(count):
        if residuals[k] < np.float32(OUTSIDE):
            t = chosen[k, 3]
            i = residuals[k] + motion[12] * t + motion[13]
            n += 1
            sum_t += t
            sum_tt += t * t
            sum_i += i
            sum_ii += i * i
    mean_t, mean_i = sum_t / n, sum_i / n
    spread = max(np.sqrt(max(sum_tt / n - mean_t * mean_t, 0.0)), 1e-3)
    gain = np.sqrt(max(sum_ii / n - mean_i * mean_i, 0.0)) / spread
    motion[12] = min(max(gain, GAIN_RANGE[0]), GAIN_RANGE[1])
    motion[13] = mean_i - motion[12] * mean_t


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _descend(
    chosen, count, picture, lens, scale, motion, prior, residuals, histogram,
    information, last_step,
):  # fmt: skip
    hessian = np.empty((8, 8))
    rhs = np.empty(8)
    step = np.empty(8)
    away = np.empty(6)
    for _ in range(ITERATIONS):
        seen = _residuals(chosen, count, picture, lens, scale, motion, residuals, histogram)
        if seen < MIN_PIXELS:
            information[:] = prior
            last_step[:] = np.float64(1e9)
            return
        _normal_equations(
            chosen, count, residuals, _sigma(histogram, seen), motion[12], hessian, rhs
        )
        away[:3] = motion[9:12]
        away[3] = 0.5 * (motion[7] - motion[5])
        away[4] = 0.5 * (motion[2] - motion[6])
        away[5] = 0.5 * (motion[3] - motion[1])
        for a in range(6):
            for b in range(6):
                hessian[a, b] += prior[a, b]
                rhs[a] += prior[a, b] * away[b]
        hessian[6, 6] += 1.0 / GAIN_SD**2
        hessian[7, 7] += 1.0 / OFFSET_SD**2
        rhs[6] += (1.0 - motion[12]) / GAIN_SD**2
        rhs[7] -= motion[13] / OFFSET_SD**2
        _without_brightness(hessian, information)
        _solve_positive(hessian, rhs, step)
        _go_back(motion, step)
        last_step[:] = step[:6]
        move2 = step[0] ** 2 + step[1] ** 2 + step[2] ** 2
        turn2 = step[3] ** 2 + step[4] ** 2 + step[5] ** 2
        if move2 < SMALL_MOVE_M**2 and turn2 < SMALL_TURN_RAD**2:
            break


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _normal_equations(chosen, count, residuals, sigma, gain, hessian, rhs):
    """Sum over the pixels; the last two rows are those of gain and offset."""
    sums = np.zeros(44, np.float64)
    row = np.empty(8)
    per_unit = 1.0 / (CAUCHY * sigma)
    scale = 1.0 / (CORRELATED * sigma * sigma)
    row[7] = 1.0
    for k in range(count):
        r = np.float64(residuals[k])
        if r >= OUTSIDE:
            continue
        x = r * per_unit
        weight = scale / (1.0 + x * x)
        for a in range(6):
            row[a] = gain * chosen[k, 4 + a]
        row[6] = chosen[k, 3]
        at = 0
        for a in range(8):
            weighted = weight * row[a]
            sums[36 + a] += weighted * r
            for b in range(a + 1):
                sums[at] += weighted * row[b]
                at += 1
    at = 0
    for a in range(8):
        rhs[a] = sums[36 + a]
        for b in range(a + 1):
            hessian[a, b] = hessian[b, a] = sums[at]
            at += 1


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _without_brightness(hessian, information):
    """What is left when gain and offset are free: the Schur complement."""
    a, b, c = hessian[6, 6], hessian[6, 7], hessian[7, 7]
    det = a * c - b * b
    for i in range(6):
        for j in range(6):
            p, q = hessian[i, 6], hessian[i, 7]
            s, t = hessian[6, j], hessian[7, j]
            information[i, j] = hessian[i, j] - (p * (c * s - b * t) + q * (a * t - b * s)) / det


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _solve_positive(matrix, rhs, out):
    """Cholesky, in place."""
    n = len(rhs)
    for i in range(n):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(max(left, 1e-300)) if i == j else left / matrix[j, j]
    for i in range(n):
        left = rhs[i]
        for k in range(i):
            left -= matrix[i, k] * out[k]
        out[i] = left / matrix[i, i]
    for i in range(n - 1, -1, -1):
        left = out[i]
        for k in range(i + 1, n):
            left -= matrix[k, i] * out[k]
        out[i] = left / matrix[i, i]


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _go_back(motion, step):
    """Take the rendering's step back: `R ← R Eᵀ`, `t ← t - R Eᵀ step`, E of the turn."""
    x, y, z = step[3], step[4], step[5]
    angle2 = x * x + y * y + z * z
    angle = np.sqrt(angle2)
    sine = np.sin(angle) / angle if angle > 1e-9 else 1.0
    cosine = (1.0 - np.cos(angle)) / angle2 if angle > 1e-9 else 0.5
    back = np.empty((3, 3))
    back[0, 0] = 1.0 - cosine * (y * y + z * z)
    back[1, 1] = 1.0 - cosine * (x * x + z * z)
    back[2, 2] = 1.0 - cosine * (x * x + y * y)
    back[0, 1], back[1, 0] = cosine * x * y + sine * z, cosine * x * y - sine * z
    back[0, 2], back[2, 0] = cosine * x * z - sine * y, cosine * x * z + sine * y
    back[1, 2], back[2, 1] = cosine * y * z + sine * x, cosine * y * z - sine * x
    for i in range(3):
        a, b, c = motion[3 * i], motion[3 * i + 1], motion[3 * i + 2]
        for j in range(3):
            motion[3 * i + j] = a * back[0, j] + b * back[1, j] + c * back[2, j]
            motion[9 + i] -= motion[3 * i + j] * step[j]
    motion[12] = min(max(motion[12] + step[6], GAIN_RANGE[0]), GAIN_RANGE[1])
    motion[13] += step[7]


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _judge(
    chosen, count, picture, lens, scale, motion, prior, residuals, histogram, information, numbers,
    last_step,
):  # fmt: skip
    """Write agreeing share and robust errors; return how many pixels were compared."""
    there, here = residuals[0], residuals[1]
    seen = _residuals(chosen, count, picture, lens, scale, motion, there, histogram)
    if seen < MIN_PIXELS:
        return seen
    sigma = _sigma(histogram, seen)
    given = np.zeros(14)
    given[0] = given[4] = given[8] = 1.0
    given[12:] = motion[12:]
    for _ in range(3):
        before = _residuals(chosen, count, picture, lens, scale, given, here, histogram)
        if before < MIN_PIXELS:
            return before
        _suit_brightness(chosen, count, here, _sigma(histogram, before), given)
    _residuals(chosen, count, picture, lens, scale, given, here, histogram)
    allowed = np.float32(AGREES * min(sigma, MAX_AGREEING_SIGMA))
    per_unit = 1.0 / (CAUCHY * sigma)
    agreeing = both = 0
    sum_w = sum_t = sum_i = sum_tt = sum_ti = sum_ii = 0.0
    error_here = error_there = 0.0
    for k in range(count):
        a, b = here[k], there[k]
        if b >= np.float32(OUTSIDE):
            continue
        if abs(b) <= allowed:
            agreeing += 1
        t = np.float64(chosen[k, 3])
        i = b + motion[12] * t + motion[13]
        x = b * per_unit
        w = 1.0 / (1.0 + x * x)
        sum_w += w
        sum_t += w * t
        sum_i += w * i
        sum_tt += w * t * t
        sum_ti += w * t * i
        sum_ii += w * i * i
        if a < np.float32(OUTSIDE):
            both += 1
            error_here += np.log1p((a * per_unit) ** 2)
            error_there += np.log1p((b * per_unit) ** 2)
    if both < MIN_PIXELS:
        return both
    numbers[0] = agreeing / seen
    spread_t = sum_tt / sum_w - (sum_t / sum_w) ** 2
    spread_i = sum_ii / sum_w - (sum_i / sum_w) ** 2
    spread = spread_t * spread_i
    together = sum_ti / sum_w - sum_t / sum_w * (sum_i / sum_w)
    numbers[1] = together / np.sqrt(spread) if spread > 1e-12 else 0.0
    numbers[2] = error_here / both
    numbers[3] = error_there / both
    return seen


@nb.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _suit_brightness(chosen, count, residuals, sigma, motion):
    """One step to the gain and offset that suit a motion best."""
    per_unit = np.float32(1.0 / (CAUCHY * sigma))
    scale = np.float32(1.0 / (CORRELATED * sigma * sigma))
    a, b, c = 1.0 / GAIN_SD**2, 0.0, 1.0 / OFFSET_SD**2
    p, q = (1.0 - motion[12]) * a, -motion[13] * c
    for k in range(count):
        r = residuals[k]
        if r >= np.float32(OUTSIDE):
            continue
        x = r * per_unit
        weight = scale / (np.float32(1.0) + x * x)
        t = chosen[k, 3]
        a += weight * t * t
        b += weight * t
        c += weight
        p += weight * t * r
        q += weight * r
    det = a * c - b * b
    motion[12] = min(max(motion[12] + (c * p - b * q) / det, GAIN_RANGE[0]), GAIN_RANGE[1])
    motion[13] += (a * q - b * p) / det
