"""Depth completion as it is defined: float64, one step after the other.

Disparity is in 1/m, 0 where unknown; positions and slopes are in samples.
"""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Float64, Int, Int32, UInt8

SAME_SURFACE = 0.03
"""Samples of one cell that differ by less than this part are averaged when a sensor is reduced."""

ALONG, DIAGONAL = 1020, 1442
"""Lengths of steps to the next sample, in integers: then backends agree to the last tie."""

NEAR_IS_LATE = 2.0
"""What a known sample costs for each time its disparity that it is before its neighbourhood."""

SWEEPS = 2
"""Sweeps forth and back that find geodesic distances; more change next to nothing."""

SLOPE_RADIUS, SLOPE_RIDGE, SLOPE_RESIDUAL = 5, 30.0, 0.02
"""Slopes of known surfaces: half the window, what is added to the moments so that thin evidence
gives no slope, and the deviation (a part of the disparity) above which it is no plane."""

FLATTEN_SAMPLES = 12.0
"""Surfaces that are continued into holes become flat over this distance."""

MAX_CHANGE = 1.5
"""A continued surface changes its disparity by no more than this factor."""

PATCH_RADIUS, PATCH_SIGMA = 2, 1.2
"""Patches whose planes are used to sharpen: half the size and the deviation of the weights."""

REACH = 3
"""Centres of the patches that a sample may take its value from are as far away as this."""

OWN_VALUE = 0.2
"""How much a sample's own squared deviation counts beside that of a patch."""

SURFACE_SIGMA, SURFACE_RESIDUAL = 1.3, 0.02
"""Patches whose planes are interpolated: deviation of the weights, and what is still a plane."""

RANGE_OF_NOISE = 4.0
"""How far samples of one surface may differ because of noise, in deviations of it."""

IN_BETWEEN = 0.35
"""Samples farther than this part of the range from both its ends are mixtures of two surfaces."""

Grid = Float64[np.ndarray, "sh sw"]


def reduce(
    disparity: Float32[np.ndarray, "dh dw"], rows: int, cols: int
) -> Float32[np.ndarray, "rows cols"]:
    """Reduce a fine sensor: per cell, the known sample nearest to its middle and those like it.

    Averages of what differs by less than `SAME_SURFACE`, so that no cell mixes two surfaces.
    """
    high, wide = disparity.shape
    out = np.zeros((rows, cols), np.float32)
    for y in range(rows):
        y0, y1 = y * high // rows, (y + 1) * high // rows
        for x in range(cols):
            x0, x1 = x * wide // cols, (x + 1) * wide // cols
            cell = disparity[y0:y1, x0:x1].astype(np.float64)
            j, i = np.nonzero(cell > 0)
            if j.size == 0:
                continue
            from_middle = (2 * j + 1 - (y1 - y0)) ** 2 + (2 * i + 1 - (x1 - x0)) ** 2
            middle = cell[j, i][from_middle.argmin()]
            alike = np.abs(cell - middle) <= SAME_SURFACE * middle
            out[y, x] = cell[alike].mean()
    return out


def fill_holes(
    disparity: Float32[np.ndarray, "sh sw"],
    guide: UInt8[np.ndarray, "sh sw 3"],
    colour: float,
    noise: float,
) -> Float32[np.ndarray, "sh sw"]:
    """Continue known surfaces into the holes (see the package's docstring, step 2)."""
    known = disparity > 0
    if known.all():
        return disparity
    rows, cols = disparity.shape
    d = disparity.astype(np.float64)
    source = nearest_known(disparity, guide, colour)
    slope_x, slope_y = known_slopes(d, noise)
    y, x = np.mgrid[:rows, :cols]
    dy, dx = y - source // cols, x - source % cols
    away = np.maximum(np.hypot(dx, dy), 1e-9)
    damped = FLATTEN_SAMPLES * (1.0 - np.exp(-away / FLATTEN_SAMPLES)) / away
    start = d.ravel()[source]
    rise = (slope_x.ravel()[source] * dx + slope_y.ravel()[source] * dy) * damped
    continued = np.clip(start + rise, start / MAX_CHANGE, start * MAX_CHANGE)
    return np.where(known, disparity, continued).astype(np.float32)


def nearest_known(
    disparity: Float32[np.ndarray, "sh sw"], guide: UInt8[np.ndarray, "sh sw 3"], colour: float
) -> Int32[np.ndarray, "sh sw"]:
    """Return for each sample which known one (row · columns + column) is geodesically nearest.

    A step costs its length times `1 + colour · Σ_rgb |ΔI| / 255`; a known sample starts with
    `NEAR_IS_LATE` times the part by which it exceeds the least disparity of the 5×5 around it.
    """
    rows, cols = disparity.shape
    per_level = round(colour * ALONG / 255.0), round(colour * DIAGONAL / 255.0)
    cost = first_costs(disparity).tolist()
    source = np.where(disparity > 0, np.arange(rows * cols).reshape(rows, cols), -1).tolist()
    picture = guide.astype(int).tolist()
    unknown = (disparity <= 0).tolist()
    for sweep in range(2 * SWEEPS):
        forth = sweep % 2 == 0
        back = -1 if forth else 1
        steps = ((0, back), (back, 0), (back, back), (back, -back))
        for y in range(rows) if forth else range(rows - 1, -1, -1):
            for x in range(cols) if forth else range(cols - 1, -1, -1):
                if not unknown[y][x]:
                    continue
                for dy, dx in steps:
                    j, i = y + dy, x + dx
                    if not (0 <= j < rows and 0 <= i < cols) or source[j][i] < 0:
                        continue
                    unlike = sum(
                        abs(a - b) for a, b in zip(picture[y][x], picture[j][i], strict=True)
                    )
                    diagonal = dy != 0 and dx != 0
                    step = (DIAGONAL if diagonal else ALONG) + per_level[diagonal] * unlike
                    if cost[j][i] + step < cost[y][x]:
                        cost[y][x] = cost[j][i] + step
                        source[y][x] = source[j][i]
    return np.array(source, np.int32)


def first_costs(disparity: Float32[np.ndarray, "sh sw"]) -> Int32[np.ndarray, "sh sw"]:
    """Return what known samples cost to begin with; unknown ones cost more than any way."""
    rows, cols = disparity.shape
    known = disparity > 0
    padded = np.pad(np.where(known, disparity, np.float32(np.inf)), 2, constant_values=np.inf)
    around = [padded[j : j + rows, i : i + cols] for j in range(5) for i in range(5)]
    least = np.min(around, axis=0)
    before = disparity / np.where(known, least, np.float32(1.0)) - np.float32(1.0)
    late = np.minimum(before * np.float32(NEAR_IS_LATE * ALONG), np.float32(1e6))
    return np.where(known, late, 2**30).astype(np.int32)


def known_slopes(d: Grid, noise: float) -> tuple[Grid, Grid]:
    """Return slopes (x, y) of the planes through the known samples around; 0 where it is none."""
    a = np.arange(-SLOPE_RADIUS, SLOPE_RADIUS + 1, dtype=np.float64)
    one = np.ones_like(a)
    known = (d > 0).astype(np.float64)

    def moment(samples: Grid, y: Float64[np.ndarray, "k"], x: Float64[np.ndarray, "k"]) -> Grid:
        return weighted_sums(np.pad(samples, SLOPE_RADIUS), y, x)

    n = np.maximum(moment(known, one, one), 1.0)
    mean_x, mean_y = moment(known, one, a) / n, moment(known, a, one) / n
    mean = moment(d, one, one) / n
    xx = moment(known, one, a * a) - n * mean_x**2 + SLOPE_RIDGE
    yy = moment(known, a * a, one) - n * mean_y**2 + SLOPE_RIDGE
    xy = moment(known, a, a) - n * mean_x * mean_y
    xd = moment(d, one, a) - n * mean_x * mean
    yd = moment(d, a, one) - n * mean_y * mean
    determinant = xx * yy - xy**2
    slope_x = (yy * xd - xy * yd) / determinant
    slope_y = (xx * yd - xy * xd) / determinant
    variance = (moment(d * d, one, one) - n * mean**2 - slope_x * xd - slope_y * yd) / n
    plane = variance <= (SLOPE_RESIDUAL * mean) ** 2 + noise**2
    return np.where(plane, slope_x, 0.0), np.where(plane, slope_y, 0.0)


def weighted_sums(
    padded: Float64[np.ndarray, "ph pw"], y: Float64[np.ndarray, "k"], x: Float64[np.ndarray, "k"]
) -> Float64[np.ndarray, "rows cols"]:
    """Correlate with the product of two kernels, without the rim."""
    rows, cols = padded.shape[0] - y.size + 1, padded.shape[1] - x.size + 1
    down = np.zeros((rows, padded.shape[1]))
    for k in range(y.size):
        down += y[k] * padded[k : k + rows]
    out = np.zeros((rows, cols))
    for k in range(x.size):
        out += x[k] * down[:, k : k + cols]
    return out


def patch_planes(d: Grid, sigma: float) -> tuple[Grid, Grid, Grid, Grid]:
    """Fit a plane to the patch around every sample, with Gaussian weights.

    Returns:
        Value in the middle, slopes in x and y, mean squared deviation. Beyond the rim, samples are
        continued by reflection in the point at the rim, which keeps planes planes.
    """
    a = np.arange(-PATCH_RADIUS, PATCH_RADIUS + 1, dtype=np.float64)
    g = np.exp(-a * a / (2.0 * sigma**2))
    g /= g.sum()
    spread = float((g * a * a).sum())
    padded = odd_rim(d, PATCH_RADIUS)
    middle = weighted_sums(padded, g, g)
    slope_x = weighted_sums(padded, g, g * a / spread)
    slope_y = weighted_sums(padded, g * a / spread, g)
    squares = weighted_sums(padded * padded, g, g)
    variance = squares - middle**2 - spread * (slope_x**2 + slope_y**2)
    return middle, slope_x, slope_y, np.maximum(variance, 0.0)


def odd_rim(d: Grid, radius: int) -> Float64[np.ndarray, "ph pw"]:
    """Continue samples beyond the rim: twice the rim minus the mirrored sample."""
    mirrored = [_mirrored(np.arange(-radius, n + radius), n) for n in d.shape]
    return 2.0 * np.pad(d, radius, mode="edge") - d[np.ix_(*mirrored)]


def _mirrored(index: Int[np.ndarray, "n"], size: int) -> Int[np.ndarray, "n"]:
    """Fold indices at the centres of the first and the last sample."""
    folded = np.abs(index) % max(2 * size - 2, 1)
    return np.minimum(folded, 2 * size - 2 - folded) if size > 1 else folded


def sharpen(disparity: Float32[np.ndarray, "sh sw"], noise: float) -> Float32[np.ndarray, "sh sw"]:
    """Give every sample the mean of what the planar patches around say about it.

    A patch counts with `(noise² + v + OWN_VALUE · e)⁻⁴`: v is its mean squared deviation from a
    plane, e the sample's own squared deviation from that plane. A patch on an edge has a
    large v, so that samples near edges follow one of the sides (Kuwahara et al. 1976).
    """
    rows, cols = disparity.shape
    d = disparity.astype(np.float64)
    middle, slope_x, slope_y, variance = patch_planes(d, PATCH_SIGMA)
    total, weights = np.zeros_like(d), np.zeros_like(d)
    for dy in range(max(-REACH, 1 - rows), min(REACH + 1, rows)):
        for dx in range(max(-REACH, 1 - cols), min(REACH + 1, cols)):
            here = (
                slice(max(-dy, 0), min(rows - dy, rows)),
                slice(max(-dx, 0), min(cols - dx, cols)),
            )
            there = slice(max(dy, 0), min(rows + dy, rows)), slice(max(dx, 0), min(cols + dx, cols))
            said = middle[there] - dx * slope_x[there] - dy * slope_y[there]
            own = (said - d[here]) ** 2
            weight = (noise**2 + variance[there] + OWN_VALUE * own) ** -4
            total[here] += weight * said
            weights[here] += weight
    return np.clip(total / weights, d.min(), d.max()).astype(np.float32)


def choose_sides(
    disparity: Float32[np.ndarray, "sh sw"],
    guide: UInt8[np.ndarray, "sh sw 3"],
    rgb: UInt8[np.ndarray, "h w 3"],
    surface_range: float,
    colour_sigma: float,
    noise: float,
) -> Float32[np.ndarray, "h w"]:
    """Interpolate on surfaces; at edges take the side that is close and has the pixel's colour.

    Of the 4×4 samples around a pixel, each votes for its side with
    `1/(1 + distance²)² · 1/(1 + |ΔI|²/σ²)²`; the winner's weighted mean is the result. On surfaces
    the planes of the four patches around are blended bilinearly.
    """
    height, width = rgb.shape[:2]
    rows, cols = disparity.shape
    d = disparity.astype(np.float64)
    v = (np.arange(height) + 0.5) * rows / height - 0.5
    u = (np.arange(width) + 0.5) * cols / width - 0.5
    j0, i0 = np.floor(v).astype(int), np.floor(u).astype(int)
    samples, votes = [], []
    for dj in range(-1, 3):
        for di in range(-1, 3):
            at = np.ix_(np.clip(j0 + dj, 0, rows - 1), np.clip(i0 + di, 0, cols - 1))
            apart = (j0 + dj - v)[:, None] ** 2 + (i0 + di - u)[None, :] ** 2
            unlike = (((rgb.astype(np.float64) - guide[at]) / 255.0) ** 2).sum(axis=-1)
            samples.append(d[at])
            votes.append(1.0 / ((1.0 + apart) * (1.0 + unlike / colour_sigma**2)) ** 2)
    around, vote = np.stack(samples), np.stack(votes)
    low, high = around.min(axis=0), around.max(axis=0)
    far = around <= low + IN_BETWEEN * (high - low)
    near = around >= high - IN_BETWEEN * (high - low)
    side = np.where((vote * far).sum(axis=0) >= (vote * near).sum(axis=0), far, near)
    chosen = (vote * side * around).sum(axis=0) / (vote * side).sum(axis=0)
    one_surface = high - low <= surface_range * high + RANGE_OF_NOISE * noise
    return np.where(one_surface, on_surfaces(d, v, u, noise), chosen).astype(np.float32)


def on_surfaces(
    d: Grid, v: Float64[np.ndarray, "h"], u: Float64[np.ndarray, "w"], noise: float
) -> Float64[np.ndarray, "h w"]:
    """Blend the planes of the four patches around; where one is no plane, its middle sample."""
    rows, cols = d.shape
    middle, slope_x, slope_y, variance = patch_planes(d, SURFACE_SIGMA)
    bent = variance > (SURFACE_RESIDUAL * middle) ** 2 + noise**2
    middle = np.where(bent, d, middle)
    slope_x, slope_y = np.where(bent, 0.0, slope_x), np.where(bent, 0.0, slope_y)
    j0, i0 = np.floor(v).astype(int), np.floor(u).astype(int)
    out = np.zeros((v.size, u.size))
    for dj in range(2):
        for di in range(2):
            j, i = np.clip(j0 + dj, 0, rows - 1), np.clip(i0 + di, 0, cols - 1)
            at = np.ix_(j, i)
            weight = (1.0 - np.abs(v - j0 - dj))[:, None] * (1.0 - np.abs(u - i0 - di))[None, :]
            plane = middle[at] + slope_x[at] * (u - i)[None, :] + slope_y[at] * (v - j)[:, None]
            out += weight * plane
    return np.clip(out, d.min(), d.max())
