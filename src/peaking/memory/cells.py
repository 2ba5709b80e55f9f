"""Cells of the surface: a grid in the world for every distance that it was seen from.

A surface seen from `2^k … 2^(k+1)` metres is cut into cells of `2^k / PER_DEPTH` metres. The
number of a cell holds its level k and its place in that level's grid.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Float64, Int64

PER_DEPTH = 64
"""So many cells make as much as the distance that a surface was seen from."""

LEVELS = (-6, 9)
"""Distances of 2^-6 to 2^9 metres are told apart."""

BITS = 18
"""Of a place along one axis, counted from the middle: a level's grid has 2^18 cells per axis."""


def cells_at(
    points_m: Float64[np.ndarray, "n 3"], depth_m: Float64[np.ndarray, "n"]
) -> Int64[np.ndarray, "held"]:
    """Return the cell of each point, seen from so far away; points beyond the grids are left out.

    Args:
        points_m: From the middle of the grids.
        depth_m: How far away they were seen from, > 0.
    """
    level = np.clip(np.floor(np.log2(depth_m)), *LEVELS).astype(np.int64)
    place = np.floor(points_m / _size_m(level)[:, None]).astype(np.int64) + (1 << (BITS - 1))
    held = ((place >= 0) & (place < 1 << BITS)).all(axis=1)
    place, level = place[held], level[held]
    number = level - LEVELS[0]
    for axis in range(3):
        number = (number << BITS) | place[:, axis]
    return number


def centres_m(cells: Int64[np.ndarray, "n"]) -> Float32[np.ndarray, "n 3"]:
    """Return the centres of cells, from the middle of the grids."""
    places = [(cells >> (BITS * k)) & ((1 << BITS) - 1) for k in (2, 1, 0)]
    steps = np.stack(places, axis=1) - (1 << (BITS - 1)) + 0.5
    return (steps * sizes_m(cells)[:, None]).astype(np.float32)


def sizes_m(cells: Int64[np.ndarray, "n"]) -> Float32[np.ndarray, "n"]:
    """Return the lengths of the sides of cells."""
    return _size_m((cells >> (3 * BITS)) + LEVELS[0]).astype(np.float32)


def _size_m(level: Int64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    return np.exp2(level.astype(np.float64)) / PER_DEPTH
