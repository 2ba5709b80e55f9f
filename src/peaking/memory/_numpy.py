"""The look as it is defined: cells are squares that face the camera; views are asked in turn."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64

from peaking.geometry import Pinhole
from peaking.memory.depth_maps import AskedViews

NEAR_M = 0.05
"""Cells nearer than this are not drawn."""

MIN_HALF_PX = 0.5
"""A cell covers at least one pixel."""

NOWHERE_M = 1e30
"""Farther than anything."""

THROUGH, MIN_THROUGH = 0.06, 2
"""A view looked through a point when all that it saw around there is farther away by this part of
the point's depth; so many views have to have."""


def look(
    points_m: Float32[np.ndarray, "n 3"],
    radius_m: Float32[np.ndarray, "n"],
    rotation: Float64[np.ndarray, "3 3"],
    translation_m: Float64[np.ndarray, "3"],
    pinhole: Pinhole,
) -> tuple[Float32[np.ndarray, "h w"], Int32[np.ndarray, "h w"]]:
    """Return depth (0 = nothing) and number of the nearest cell in every pixel."""
    width, height = pinhole.size_px
    depth_m = np.full((height, width), np.inf)
    cell = np.full((height, width), -1, np.int32)
    in_cam_m = points_m.astype(np.float64) @ rotation.T + translation_m
    for number, ((x_m, y_m, z_m), size_m) in enumerate(zip(in_cam_m, radius_m, strict=True)):
        if z_m < NEAR_M:
            continue
        u_px = pinhole.fx_px * x_m / z_m + pinhole.cx_px
        v_px = pinhole.fy_px * y_m / z_m + pinhole.cy_px
        half_px = max(size_m * pinhole.fx_px / z_m, MIN_HALF_PX)
        left, right = _span(u_px, half_px, width)
        top, bottom = _span(v_px, half_px, height)
        there = depth_m[top:bottom, left:right]
        closer = z_m < there
        there[closer] = z_m
        cell[top:bottom, left:right][closer] = number
    return np.where(cell >= 0, depth_m, 0.0).astype(np.float32), cell


def behind(
    live_m: Float32[np.ndarray, "h w"], pinhole: Pinhole, asked: AskedViews
) -> Float32[np.ndarray, "h w"]:
    """Return by which part of its depth the surface here is hidden from the view it is least in.

    For a view that the surface is at depth z of, and that saw a surface at depth d there, that is
    `z / d - 1`; not above 0 when the view saw it, or saw through where it is. Infinite where no
    view has it in its picture; 0 where `live_m` is 0.
    """
    least = np.full(live_m.shape, np.inf)
    points_m = pinhole.rays() * live_m[..., None]
    for k in range(len(asked.first)):
        z_m, (u, v), inside = _in_view(points_m, asked, k)
        seen_m = _map_of(asked, k)[v, u]
        told = inside & (seen_m > 0)
        hidden = np.where(told, z_m / np.where(told, seen_m, 1.0) - 1.0, np.inf)
        least = np.minimum(least, hidden)
    return np.where(live_m > 0, least, 0.0).astype(np.float32)


def looked_through(
    live_m: Float32[np.ndarray, "h w"], pinhole: Pinhole, asked: AskedViews
) -> Bool[np.ndarray, "h w"]:
    """Return where at least `MIN_THROUGH` views looked through the surface that is here now.

    False where `live_m` is 0.
    """
    count = np.zeros(live_m.shape, np.int32)
    points_m = pinhole.rays() * live_m[..., None]
    for k in range(len(asked.first)):
        z_m, (u, v), inside = _in_view(points_m, asked, k)
        seen_m = _map_of(asked, k)
        known_m = np.where(seen_m > 0, seen_m, np.float32(NOWHERE_M))
        nearest_m = cv2.erode(known_m, np.ones((3, 3), np.uint8))[v, u]
        told = inside & (seen_m[v, u] > 0)
        count += told & (z_m < (1.0 - THROUGH) * nearest_m)
    return (live_m > 0) & (count >= MIN_THROUGH)


def _in_view(
    points_m: Float64[np.ndarray, "h w 3"], asked: AskedViews, k: int
) -> tuple[Float64[np.ndarray, "h w"], Int64[np.ndarray, "2 h w"], Bool[np.ndarray, "h w"]]:
    """Return depth, column and row of points in a view, and which are in its picture."""
    in_view_m = points_m @ asked.rotation[k].astype(np.float64).T + asked.translation_m[k]
    width, height = asked.size_px[k]
    fx, fy, cx, cy = asked.inner[k].astype(np.float64)
    z_m = in_view_m[..., 2]
    ahead = z_m > NEAR_M
    safe_m = np.where(ahead, z_m, 1.0)
    u = np.floor(fx * in_view_m[..., 0] / safe_m + cx)
    v = np.floor(fy * in_view_m[..., 1] / safe_m + cy)
    inside = ahead & (u >= 0) & (v >= 0) & (u < width) & (v < height)
    return z_m, np.where(inside, np.stack([u, v]), 0).astype(np.int64), inside


def _map_of(asked: AskedViews, k: int) -> Float32[np.ndarray, "h w"]:
    width, height = asked.size_px[k]
    first = asked.first[k]
    return asked.depth_m[first : first + width * height].reshape(height, width)


def _span(centre_px: float, half_px: float, size_px: int) -> tuple[int, int]:
    """Return the pixels, first and one after the last, whose centres are that close."""
    first = int(np.ceil(np.clip(centre_px - half_px - 0.5, 0, size_px)))
    last = int(np.floor(np.clip(centre_px + half_px - 0.5, -1, size_px - 1)))
    return first, max(last + 1, first)
