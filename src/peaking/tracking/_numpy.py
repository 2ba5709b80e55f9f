"""The alignment as it is defined, in float64."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from peaking.geometry import Pinhole
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
    MIN_ALPHA,
    MIN_GRADIENT,
    MIN_PIXELS,
    MIN_SIGMA,
    OFFSET_SD,
    SMALL_MOVE_M,
    SMALL_TURN_RAD,
    Solution,
    first_and_last_level,
    halved,
    kept_of_256,
    nothing_found,
    rotation_of,
)


class Level(NamedTuple):
    """Brightness of the rendering and of the live picture, and depth where it counts, else 0."""

    rendered: Float64[np.ndarray, "h w"]
    depth_m: Float64[np.ndarray, "h w"]
    live: Float64[np.ndarray, "h w"]


class Chosen(NamedTuple):
    """The pixels of a level that are compared.

    Attributes:
        points_m: In the frame of the rendering's camera.
        brightness: Of the rendering.
        slopes: Change of the brightness with the camera's motion: 1/m along x, y, z; 1/rad.
    """

    points_m: Float64[np.ndarray, "n 3"]
    brightness: Float64[np.ndarray, "n"]
    slopes: Float64[np.ndarray, "n 6"]


class Motion(NamedTuple):
    """From the rendering to the live picture: of points, and of brightness."""

    rotation: Float64[np.ndarray, "3 3"]
    translation_m: Float64[np.ndarray, "3"]
    gain: float
    offset: float


def solve(
    rgba: Float32[np.ndarray, "h w 4"],
    depth_m: Float32[np.ndarray, "h w"],
    live: UInt8[np.ndarray, "h w 3"],
    pinhole: Pinhole,
    prior: Float64[np.ndarray, "6 6"],
) -> Solution:
    """Align; see `peaking.tracking.align`. `prior`: information of the given pose."""
    finest, coarsest = first_and_last_level(*depth_m.shape)
    levels = pyramid(rgba, depth_m, live, coarsest)
    motion = Motion(np.eye(3), np.zeros(3), 1.0, 0.0)
    first = True
    for number in range(coarsest, finest, -1):
        level, lens = levels[number], halved(pinhole, number)
        chosen = choose(level, lens)
        if np.count_nonzero(seen(chosen, lens, level, motion)[1]) < MIN_PIXELS:
            continue
        if first:
            motion, first = matched_brightness(chosen, level, lens, motion), False
        motion, _, _ = descend(chosen, level, lens, motion, prior)
    level, lens = levels[finest], halved(pinhole, finest)
    chosen = choose(level, lens)
    count = int(np.count_nonzero(seen(chosen, lens, level, motion)[1]))
    if count < MIN_PIXELS:
        return nothing_found(prior, count)
    if first:
        motion = matched_brightness(chosen, level, lens, motion)
    motion, information, last_step = descend(chosen, level, lens, motion, prior)
    live_there, there = seen(chosen, lens, level, motion)
    given = Motion(np.eye(3), np.zeros(3), motion.gain, motion.offset)
    live_here, here = seen(chosen, lens, level, given)
    both = here & there
    count = int(np.count_nonzero(there))
    if np.count_nonzero(both) < MIN_PIXELS:
        return nothing_found(prior, count)
    residuals = residuals_of(live_there, chosen, motion)
    sigma = sigma_of(residuals[there])
    allowed = AGREES * min(sigma, MAX_AGREEING_SIGMA)
    given = with_brightness(chosen, live_here, here, given)
    return Solution(
        motion.rotation,
        motion.translation_m,
        information,
        motion.gain,
        motion.offset,
        count,
        float(np.mean(np.abs(residuals[there]) <= allowed)),
        correlation(live_there, chosen.brightness, weights_of(residuals, there)),
        robust_error(residuals_of(live_here, chosen, given)[both], sigma),
        robust_error(residuals[both], sigma),
        last_step,
    )


def pyramid(
    rgba: Float32[np.ndarray, "h w 4"],
    depth_m: Float32[np.ndarray, "h w"],
    live: UInt8[np.ndarray, "h w 3"],
    coarsest: int,
) -> list[Level]:
    """Return the pictures, and their halves, down to the coarsest."""
    alpha = rgba[..., 3].astype(np.float64)
    rendered = (rgba[..., :3] @ np.array(LUMA)) / np.where(alpha > 0, alpha, 1.0)
    known_m = np.where((alpha >= MIN_ALPHA) & (depth_m > 0), depth_m.astype(np.float64), 0.0)
    levels = [Level(rendered, known_m, live @ np.array(LUMA) / 255.0)]
    for _ in range(coarsest):
        before = levels[-1]
        levels.append(
            Level(means(before.rendered), mean_depths_m(before.depth_m), means(before.live))
        )
    return levels


def quarters(picture: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "4 h2 w2"]:
    """Return the four pixels of each that is twice as wide and high."""
    height, width = (n // 2 * 2 for n in picture.shape)
    cut = picture[:height, :width]
    return np.stack([cut[::2, ::2], cut[::2, 1::2], cut[1::2, ::2], cut[1::2, 1::2]])


def means(picture: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "h2 w2"]:
    """Return the picture at half its size."""
    return quarters(picture).mean(axis=0)


def mean_depths_m(depth_m: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "h2 w2"]:
    """Return the depth at half its size; unknown where it has an edge or a hole."""
    four = quarters(depth_m)
    smooth = (four.min(axis=0) > 0) & (four.max(axis=0) < DEPTH_EDGE * four.min(axis=0))
    return np.where(smooth, four.mean(axis=0), 0.0)


def around(picture: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "3 3 h2 w2"]:
    """Return for all pixels but the outermost those around them."""
    height, width = picture.shape
    return np.stack(
        [
            np.stack([picture[y : y + height - 2, x : x + width - 2] for x in range(3)])
            for y in range(3)
        ]
    )


def choose(level: Level, lens: Pinhole) -> Chosen:
    """Choose the pixels that have a gradient, and surface all around."""
    t = around(level.rendered)
    smoothing = np.array([1.0, 2.0, 1.0]) / 8.0  # Sobel
    gx = np.einsum("y,yhw->hw", smoothing, t[:, 2] - t[:, 0])
    gy = np.einsum("x,xhw->hw", smoothing, t[2] - t[0])
    depths = around(level.depth_m)
    nearest, farthest = depths.min(axis=(0, 1)), depths.max(axis=(0, 1))
    good = (nearest > 0) & (farthest < DEPTH_EDGE * nearest)
    good &= np.abs(gx) + np.abs(gy) > MIN_GRADIENT
    rows, cols = np.nonzero(good)
    kept = ((rows + 1) * 151 + (cols + 1) * 97) % 256 < kept_of_256(len(rows))
    rows, cols = rows[kept], cols[kept]
    gx, gy = gx[rows, cols], gy[rows, cols]
    z = level.depth_m[rows + 1, cols + 1]
    x = (cols + 1.5 - lens.cx_px) / lens.fx_px * z
    y = (rows + 1.5 - lens.cy_px) / lens.fy_px * z
    points_m = np.stack([x, y, z], axis=-1)
    along_x, along_y = lens.fx_px * gx / z, lens.fy_px * gy / z
    along = np.stack([along_x, along_y, -(along_x * x + along_y * y) / z], axis=-1)
    slopes = np.concatenate([along, np.cross(points_m, along)], axis=-1)
    return Chosen(points_m, level.rendered[rows + 1, cols + 1], slopes)


def seen(
    chosen: Chosen, lens: Pinhole, level: Level, motion: Motion
) -> tuple[Float64[np.ndarray, "n"], Bool[np.ndarray, "n"]]:
    """Return the live picture's brightness where the points are seen in it, and which are."""
    moved_m = chosen.points_m @ motion.rotation.T + motion.translation_m
    ahead = moved_m[:, 2] > 1e-3
    z = np.where(ahead, moved_m[:, 2], 1.0)
    u = lens.fx_px * moved_m[:, 0] / z + lens.cx_px - 0.5
    v = lens.fy_px * moved_m[:, 1] / z + lens.cy_px - 0.5
    height, width = level.live.shape
    inside = ahead & (u >= 0) & (v >= 0) & (u < width - 1) & (v < height - 1)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    col, row = u.astype(int), v.astype(int)
    fu, fv = u - col, v - row
    above = level.live[row, col] * (1 - fu) + level.live[row, col + 1] * fu
    below = level.live[row + 1, col] * (1 - fu) + level.live[row + 1, col + 1] * fu
    return above * (1 - fv) + below * fv, inside


def residuals_of(
    live: Float64[np.ndarray, "n"], chosen: Chosen, motion: Motion
) -> Float64[np.ndarray, "n"]:
    """Return by how much the live picture is brighter than the rendering as it is exposed."""
    return live - (motion.gain * chosen.brightness + motion.offset)


def sigma_of(residuals: Float64[np.ndarray, "n"]) -> float:
    """Return the standard deviation by the median, which half of the pixels cannot spoil."""
    return max(1.4826 * float(np.median(np.abs(residuals))), MIN_SIGMA)


def robust_error(residuals: Float64[np.ndarray, "n"], sigma: float) -> float:
    """Return the mean of Cauchy's loss, whose derivative the weights are."""
    return float(np.mean(np.log1p((residuals / (CAUCHY * sigma)) ** 2)))


def correlation(
    a: Float64[np.ndarray, "n"], b: Float64[np.ndarray, "n"], weights: Float64[np.ndarray, "n"]
) -> float:
    """Return Pearson's correlation with weights; 0 where one of the two does not vary."""
    share = weights / weights.sum()
    a, b = a - (share * a).sum(), b - (share * b).sum()
    spread = (share * a * a).sum() * (share * b * b).sum()
    return float((share * a * b).sum() / np.sqrt(spread)) if spread > 1e-12 else 0.0


def matched_brightness(chosen: Chosen, level: Level, lens: Pinhole, motion: Motion) -> Motion:
    """Return gain and offset that make mean and spread of both pictures equal, to begin with."""
    live, inside = seen(chosen, lens, level, motion)
    live, rendered = live[inside], chosen.brightness[inside]
    spread = max(float(rendered.std()), 1e-3)
    gain = float(np.clip(live.std() / spread, *GAIN_RANGE))
    return motion._replace(gain=gain, offset=float(live.mean() - gain * rendered.mean()))


def with_brightness(
    chosen: Chosen,
    live: Float64[np.ndarray, "n"],
    inside: Bool[np.ndarray, "n"],
    motion: Motion,
) -> Motion:
    """Return the motion with the gain and offset that suit it best."""
    for _ in range(3):
        residuals = residuals_of(live, chosen, motion)
        weights = weights_of(residuals, inside)
        ones = np.stack([chosen.brightness, np.ones(len(live))], axis=-1)
        hessian = (ones * weights[:, None]).T @ ones + np.diag([GAIN_SD**-2, OFFSET_SD**-2])
        rhs = (ones * weights[:, None]).T @ residuals
        rhs += np.array([(1.0 - motion.gain) / GAIN_SD**2, -motion.offset / OFFSET_SD**2])
        gain, offset = np.linalg.solve(hessian, rhs)
        motion = brightened(motion, gain, offset)
    return motion


def brightened(motion: Motion, more_gain: float, more_offset: float) -> Motion:
    """Return the motion with another gain and offset."""
    return motion._replace(
        gain=float(np.clip(motion.gain + more_gain, *GAIN_RANGE)),
        offset=float(motion.offset + more_offset),
    )


def weights_of(
    residuals: Float64[np.ndarray, "n"], inside: Bool[np.ndarray, "n"]
) -> Float64[np.ndarray, "n"]:
    """Return how much each pixel tells, 1/brightness²."""
    sigma = sigma_of(residuals[inside])
    weights = 1.0 / (1.0 + (residuals / (CAUCHY * sigma)) ** 2) / (CORRELATED * sigma**2)
    return np.where(inside, weights, 0.0)


def descend(
    chosen: Chosen,
    level: Level,
    lens: Pinhole,
    motion: Motion,
    prior: Float64[np.ndarray, "6 6"],
) -> tuple[Motion, Float64[np.ndarray, "6 6"], Float64[np.ndarray, "6"]]:
    """Take Gauss-Newton steps until they are small.

    Returns:
        Where they end, the information there (without gain and offset), and the last step.
    """
    information, step = prior, np.zeros(6)
    for _ in range(ITERATIONS):
        live, inside = seen(chosen, lens, level, motion)
        if np.count_nonzero(inside) < MIN_PIXELS:
            return motion, prior, np.full(6, np.inf)
        residuals = residuals_of(live, chosen, motion)
        weights = weights_of(residuals, inside)
        slopes = np.concatenate(
            [motion.gain * chosen.slopes, chosen.brightness[:, None], np.ones((len(live), 1))],
            axis=-1,
        )
        hessian = (slopes * weights[:, None]).T @ slopes
        rhs = (slopes * weights[:, None]).T @ residuals
        away = np.concatenate([motion.translation_m, turn_of(motion.rotation)])
        hessian[:6, :6] += prior
        rhs[:6] += prior @ away
        hessian[6, 6] += GAIN_SD**-2
        hessian[7, 7] += OFFSET_SD**-2
        rhs[6] += (1.0 - motion.gain) / GAIN_SD**2
        rhs[7] += -motion.offset / OFFSET_SD**2
        full_step = np.linalg.solve(hessian, rhs)
        step = full_step[:6]
        # The rendering was moved by the step, so the live picture's motion goes back by it.
        back = rotation_of(step[3:]).T
        motion = Motion(
            motion.rotation @ back,
            motion.translation_m - motion.rotation @ back @ step[:3],
            motion.gain,
            motion.offset,
        )
        motion = brightened(motion, full_step[6], full_step[7])
        # What is left when gain and offset are free: the Schur complement.
        free = np.linalg.solve(hessian[6:, 6:], hessian[6:, :6])
        information = hessian[:6, :6] - hessian[:6, 6:] @ free
        move_m, turn_rad = np.linalg.norm(step[:3]), np.linalg.norm(step[3:])
        if move_m < SMALL_MOVE_M and turn_rad < SMALL_TURN_RAD:
            break
    return motion, information, step


def turn_of(rotation: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3"]:
    """Return the axis of a small rotation, as long as its angle in radians."""
    return 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
