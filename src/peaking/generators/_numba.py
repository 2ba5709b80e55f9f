"""The `layered` generator, fast on the CPU; the same result as `_numpy.py`."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from peaking.generators import _background_kernels as background
from peaking.generators import _tile_kernels as tiles
from peaking.generators._numpy import COLOUR_PX, LAG_PX, SMOOTH_PX
from peaking.mpi import CELL_PX, tile_grid


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
    rows, cols = tile_grid(width, height)
    rim = rows * CELL_PX + 1, cols * CELL_PX + 1
    picture = np.s_[1 : height + 1, 1 : width + 1]
    steps = disparities.astype(np.float32)

    rgba = np.empty((*rim, 4), np.uint8)
    cv2.cvtColor(rgb, cv2.COLOR_RGB2RGBA, dst=rgba[picture])
    colours = rgba.view(np.uint32)[..., 0]
    seen = np.full(rim, tiles.NOWHERE, np.int32)
    hidden = np.full(rim, tiles.NOWHERE, np.int32)
    hidden_rgba = np.zeros((*rim, 4), np.uint8)

    behind = np.empty(disparity.shape, np.int16)
    opacity = np.empty(disparity.shape, np.uint8)
    tiles.split_pixels(disparity, steps, 1 / np.diff(steps), behind, opacity)
    around = np.ones((2 * underlap_px + 1, 2 * underlap_px + 1), np.uint8)
    lowest = cv2.erode(behind, around)

    reach, jump = np.float32(reach_px), np.float32(jump_per_m)
    away = np.zeros((height, width, 4), np.uint16)
    edge_rgba = np.empty((height, width, 4), np.uint32)
    background.carry_background(
        disparity, colours[picture], reach, jump, LAG_PX, COLOUR_PX, away, edge_rgba
    )
    joined = np.zeros_like(hidden_rgba)
    background.join_background(
        disparity, away, edge_rgba, jump, steps, hidden, joined.view(np.uint32)[..., 0]
    )
    flat = rim[0], rim[1] * 4
    background.smooth_background(joined.reshape(flat), SMOOTH_PX // 2, hidden_rgba.reshape(flat))

    tiles.pack_pixels(behind, opacity, lowest, underlap_planes, seen, hidden)
    held = np.empty((len(disparities), rows, cols), np.bool_)
    tiles.mark_tiles(seen, hidden, held)
    index = np.empty(held.shape, np.int32)
    places = np.empty((held.size, 3), np.int32)
    count = tiles.number_tiles(held, index, places)
    texels = np.empty((count, 256), np.uint32)
    tiles.fill_tiles(seen, colours, hidden, hidden_rgba.view(np.uint32)[..., 0], index, texels)
    return places[:count].copy(), texels.view(np.uint8).reshape(-1, 16, 16, 4)
