# pyright: basic
"""Which surface points one view sees, by its depth map."""

from __future__ import annotations

import numba as nb
import numpy as np

NOT_SEEN, UNDECIDED, SEEN = 0, 1, 2
"""What is known of a pixel after some views; more is never forgotten for less."""


def add_view(state, depth_m, rays, view_from_here, pinhole, view_m, tolerance):
    """Raise `state` (h w) of the points `rays * depth_m` by what a view's depth tells of them.

    `pinhole` is the view's, at the size of its depth map `view_m`.
    """
    lens = (pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px)
    rotation, translation_m = view_from_here.rotation, view_from_here.translation_m
    _add_view(state, depth_m, rays, rotation, translation_m, lens, view_m, tolerance)


@nb.njit(cache=True, parallel=True)
def _add_view(state, depth_m, rays, rotation, translation_m, lens, view_m, tolerance):
    height, width = depth_m.shape
    high, wide = view_m.shape
    fx, fy, cx, cy = lens
    for y in nb.prange(height):
        for x in range(width):
            z_own = depth_m[y, x]
            if z_own == 0 or state[y, x] == SEEN:
                continue
            px, py, pz = rays[y, x, 0] * z_own, rays[y, x, 1] * z_own, z_own
            z = rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz + translation_m[2]
            if z <= 0:
                continue
            across = (
                rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz + translation_m[0]
            )
            down = (
                rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz + translation_m[1]
            )
            column, row = fx * across / z + cx, fy * down / z + cy
            if column < 0 or row < 0 or column > wide or row > high:
                continue
            found = _compare(z, column - 0.5, row - 0.5, view_m, tolerance)
            state[y, x] = max(state[y, x], found)


@nb.njit(cache=True)
def _compare(z, column, row, view_m, tolerance):
    """Compare a depth with the four samples around a place of the view's depth map."""
    high, wide = view_m.shape
    left, top = int(np.floor(column)), int(np.floor(row))
    nearest, farthest, unknown = np.inf, 0.0, False
    for k in range(4):
        sample = view_m[
            min(max(top + k // 2, 0), high - 1),
            min(max(left + k % 2, 0), wide - 1),
        ]
        if sample == 0:
            unknown = True
        else:
            nearest, farthest = min(nearest, sample), max(farthest, sample)
    if nearest * (1 - tolerance) <= z <= farthest * (1 + tolerance):
        return SEEN
    if unknown or z < nearest:  # the view looks through the point: one of the two is wrong
        return UNDECIDED
    return NOT_SEEN
