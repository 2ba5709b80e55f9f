"""The `layered` generator as it is defined: float64, dense planes, one line after the other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int32, UInt8
from numpy.lib.stride_tricks import sliding_window_view

from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.mpi import Mpi

COLOUR_PX = 8
"""Pixels of the surface before an edge whose mean colour is carried on."""

LAG_PX = 2
"""Pixels before an edge that do not count for its colour: they are mixtures of both sides."""

SMOOTH_PX = 5
"""Side of the square over which the continued background is smoothed."""


def layers(
    rgb: UInt8[np.ndarray, "h w 3"],
    disparity: Float32[np.ndarray, "h w"],
    disparities: Float64[np.ndarray, "planes"],
    *,
    reach_px: float,
    jump_per_m: float,
    underlap_px: int,
    underlap_planes: int,
) -> tuple[Int32[np.ndarray, "tiles 3"], UInt8[np.ndarray, "tiles 16 16 4"]]:
    """Split a picture into layers; return the places of the tiles and the tiles."""
    height, width = disparity.shape
    planes = np.zeros((len(disparities), height, width, 4), np.uint8)
    behind, opacity = split(disparity, disparities)
    lowest = np.maximum(lowest_around(behind, underlap_px), behind - underlap_planes)
    put(planes, behind, (opacity < 255) | (lowest < behind), rgb, np.full_like(opacity, 255))
    put(planes, behind + 1, opacity > 0, rgb, opacity)
    for below in range(1, underlap_planes + 1):
        put(planes, behind - below, behind - below >= lowest, rgb, np.full_like(opacity, 255))

    hidden, hidden_rgb = continued_background(rgb, disparity, reach_px, jump_per_m)
    deep, deep_opacity = split(np.where(hidden > 0, hidden, disparities[0]), disparities)
    free = (hidden > 0) & (deep + 1 < lowest)
    put(planes, deep, free, hidden_rgb, np.full_like(opacity, 255))
    put(planes, deep + 1, free & (deep_opacity > 0), hidden_rgb, deep_opacity)

    here = Rigid[World, Cam].identity()
    camera = Camera(Pinhole(width, height, 1.0, 1.0, 0.0, 0.0), here)
    mpi = Mpi.from_dense(planes, 1.0 / disparities, camera)
    return mpi.tile_places, mpi.texels


def split(
    disparity: Float[np.ndarray, "h w"], disparities: Float64[np.ndarray, "planes"]
) -> tuple[Int32[np.ndarray, "h w"], Int32[np.ndarray, "h w"]]:
    """Return the plane behind each pixel and the 8-bit opacity of the plane before it."""
    position = np.interp(disparity, disparities, np.arange(len(disparities), dtype=np.float64))
    behind = np.minimum(np.floor(position), len(disparities) - 2).astype(np.int32)
    opacity = np.floor((position - behind) * 255.0 + 0.5).astype(np.int32)
    return behind, opacity


def lowest_around(behind: Int32[np.ndarray, "h w"], radius_px: int) -> Int32[np.ndarray, "h w"]:
    """Return the farthest plane within a square of ± `radius_px`."""
    padded = np.pad(behind, radius_px, mode="edge")
    side = 2 * radius_px + 1
    return sliding_window_view(padded, (side, side)).min(axis=(2, 3)).astype(np.int32)


def put(
    planes: UInt8[np.ndarray, "planes h w 4"],
    plane: Int32[np.ndarray, "h w"],
    where: Bool[np.ndarray, "h w"],
    rgb: UInt8[np.ndarray, "h w 3"],
    opacity: Int32[np.ndarray, "h w"],
) -> None:
    """Write premultiplied texels into one plane per pixel."""
    y, x = np.nonzero(where)
    alpha = opacity[y, x]
    colour = np.floor(rgb[y, x] * (alpha[:, None] / 255.0) + 0.5)
    planes[plane[y, x], y, x, :3] = colour.astype(np.uint8)
    planes[plane[y, x], y, x, 3] = alpha.astype(np.uint8)


def continued_background(
    rgb: UInt8[np.ndarray, "h w 3"],
    disparity: Float[np.ndarray, "h w"],
    reach_px: float,
    jump_per_m: float,
) -> tuple[Float64[np.ndarray, "h w"], UInt8[np.ndarray, "h w 3"]]:
    """Continue the background behind depth edges; disparity 0 where nothing is behind.

    Each pixel is reached from the left, right, top and bottom (`carry_line`). The nearest edge
    decides which surface is continued; the colours of all directions that found the same surface
    are averaged with the inverse of the distance.
    """
    height, width = disparity.shape
    d = disparity.astype(np.float64)
    colours = rgb.astype(np.float64)
    found = np.zeros((4, height, width, 5))
    for y in range(height):
        found[0, y] = carry_line(d[y], colours[y], reach_px, jump_per_m)
        found[1, y, ::-1] = carry_line(d[y, ::-1], colours[y, ::-1], reach_px, jump_per_m)
    for x in range(width):
        found[2, :, x] = carry_line(d[:, x], colours[:, x], reach_px, jump_per_m)
        found[3, ::-1, x] = carry_line(d[::-1, x], colours[::-1, x], reach_px, jump_per_m)

    carried, steps = found[..., 0], found[..., 1]
    distance = np.where(carried > 0, steps, np.inf)
    nearest = np.argmin(distance, axis=0)[None]
    at = np.take_along_axis(carried, nearest, axis=0)
    agrees = (carried > 0) & (np.abs(carried - at) <= jump_per_m)
    weight = np.where(agrees, 1.0 / np.maximum(steps, 1.0), 0.0)
    total = weight.sum(axis=0)
    norm = np.where(total > 0, total, 1.0)
    hidden = (weight * carried).sum(axis=0) / norm
    hidden_rgb = (weight[..., None] * found[..., 2:]).sum(axis=0) / norm[..., None]
    return hidden, smoothed(np.floor(hidden_rgb + 0.5), hidden > 0)


def smoothed(
    rgb: Float64[np.ndarray, "h w 3"], held: Bool[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Average the held pixels over squares of `SMOOTH_PX`; the others do not count."""
    half, side = SMOOTH_PX // 2, (SMOOTH_PX, SMOOTH_PX)
    padded = np.pad(np.where(held[..., None], rgb, 0.0), ((half, half), (half, half), (0, 0)))
    total = sliding_window_view(padded, side, axis=(0, 1)).sum(axis=(-2, -1))
    count = sliding_window_view(np.pad(held, half), side).sum(axis=(-2, -1))
    mean = total / np.maximum(count, 1)[..., None]
    return np.where(held[..., None], np.floor(mean + 0.5), 0.0).astype(np.uint8)


def carry_line(
    disparity: Float64[np.ndarray, "n"],
    rgb: Float64[np.ndarray, "n 3"],
    reach_px: float,
    jump_per_m: float,
) -> Float64[np.ndarray, "n 5"]:
    """Carry the background on along one line of pixels.

    At a step towards the camera (more than `jump_per_m` of disparity between two pixels) the
    surface before it is taken along: its disparity, and the mean colour of its last `COLOUR_PX`
    pixels without the `LAG_PX` at the edge (of the last one, if it is too narrow). It is dropped
    where it comes to light again, or once it has gone `reach_px` times the difference of the
    disparities, which is how far a camera that moves by the reach can look behind the edge.

    Returns:
        For every pixel: disparity behind it (0 = none), pixels from the edge, red, green, blue.
    """
    found = np.zeros((len(disparity), 5))
    carried, steps, carried_rgb = 0.0, 0, np.zeros(3)
    begun = 0
    before = disparity[0]
    for n, d in enumerate(disparity):
        if abs(d - before) > jump_per_m:
            if d > before:
                wide = n - begun > LAG_PX + 1
                first = max(begun + 1, n - LAG_PX - COLOUR_PX) if wide else n - 1
                surface_rgb = rgb[first : n - LAG_PX if wide else n]
                carried, steps = before, 0
                carried_rgb = np.floor(surface_rgb.mean(axis=0) + 0.5)
            begun = n
        if carried > 0:
            steps += 1
            if d - carried <= jump_per_m or steps > reach_px * (d - carried):
                carried = 0.0
        found[n] = [carried, steps, *carried_rgb]
        before = d
    return found
