"""The `layered` generator, fast on the CPU; the same result as `_numpy.py`."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from peaking.generate import _kernels
from peaking.generate._numpy import SMOOTH_PX
from peaking.mpi import tile_grid


def layers(
    rgb: UInt8[np.ndarray, "h w 3"],
    disparity: Float32[np.ndarray, "h w"],
    ladder: Float64[np.ndarray, "planes"],
    *,
    reach_px: float,
    jump_per_m: float,
    underlap_px: int,
    underlap_planes: int,
) -> tuple[Int32[np.ndarray, "tiles 3"], UInt8[np.ndarray, "tiles 16 16 4"]]:
    """Split a picture into layers; return the places of the tiles and the tiles."""
    height, width = disparity.shape
    steps = ladder.astype(np.float32)
    positions = np.empty_like(disparity)
    _kernels.plane_positions(disparity, steps, positions)
    behind = np.minimum(np.floor(positions), np.float32(len(ladder) - 2))
    around = np.ones((2 * underlap_px + 1, 2 * underlap_px + 1), np.uint8)
    lowest = cv2.erode(behind, around)

    hidden, hidden_rgb = continued_background(rgb, disparity, reach_px, jump_per_m)
    hidden_positions = np.empty_like(disparity)
    _kernels.plane_positions(hidden, steps, hidden_positions)
    hidden_positions[hidden == 0] = -1.0

    held = np.zeros((len(ladder), *tile_grid(width, height)), np.bool_)
    _kernels.mark_tiles(positions, lowest, hidden_positions, underlap_planes, held)
    places = np.argwhere(held).astype(np.int32)
    index = np.full(held.shape, -1, np.int32)
    index[held] = np.arange(len(places), dtype=np.int32)
    texels = np.zeros((len(places), 256), np.uint32)
    _kernels.fill_tiles(
        positions, lowest, hidden_positions, underlap_planes, rgb, hidden_rgb, index, texels
    )
    return places, texels.view(np.uint8).reshape(-1, 16, 16, 4)


def continued_background(
    rgb: UInt8[np.ndarray, "h w 3"],
    disparity: Float32[np.ndarray, "h w"],
    reach_px: float,
    jump_per_m: float,
) -> tuple[Float32[np.ndarray, "h w"], UInt8[np.ndarray, "h w 3"]]:
    """Continue the background behind depth edges; disparity 0 where nothing is behind."""
    height, width = disparity.shape
    reach, jump = np.float32(reach_px), np.float32(jump_per_m)
    found = np.empty((4, height, width), np.float32)
    found_rest = np.empty((4, height, width, 4), np.float32)
    sweeps = (
        (_kernels.sweep_rows, True),
        (_kernels.sweep_rows, False),
        (_kernels.sweep_columns, True),
        (_kernels.sweep_columns, False),
    )
    for n, (sweep, forward) in enumerate(sweeps):
        sweep(disparity, rgb, reach, jump, forward, found[n], found_rest[n])
    hidden = np.empty_like(disparity)
    hidden_rgb = np.zeros_like(rgb)
    _kernels.join_sweeps(found, found_rest, jump, hidden, hidden_rgb)
    smooth_rgb = np.zeros_like(rgb)
    _kernels.smooth_hidden(hidden, hidden_rgb, SMOOTH_PX // 2, smooth_rgb)
    return hidden, smooth_rgb
