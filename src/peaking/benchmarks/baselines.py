"""Two simple ways to render a new view from a picture with depth, to compare MPIs with.

`splat` draws every pixel as a point; `mesh` joins the pixels to a textured surface that is cut at
depth edges. Both are given what makes them good: they are what a method has to beat.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.geometry import Camera, source_from_target

SAME_SURFACE_RATIO = 1.1
"""Depth ratio up to which neighbours are taken for one surface (sizes of points)."""

SPLAT_DEPTH_RATIO = 1.05
"""Points up to this factor behind the nearest one are blended with it."""

SPLAT_REACH = 0.55
"""Share of a point's size within which it hides what is behind; 0.5 leaves no slack."""

SPLAT_LARGEST_PX = 4.0
"""Limit of a point's size: surfaces seen at a grazing angle get no larger points."""

SPLAT_FULL_WEIGHT = 0.5
"""Sum of weights from which a pixel is opaque: half covered, as a pixel centre is."""

MESH_CUT_RATIO = 1.1
"""Depth ratio across a quad of four pixels above which it is cut."""

MESH_FLAP_PX = 0.5
"""At a cut every pixel keeps its own half of the gap, so a hole is as wide as the parallax."""


def splat(
    frame_rgb: UInt8[np.ndarray, "h w 3"],
    depth_m: Float32[np.ndarray, "h w"],
    source: Camera,
    target: Camera,
) -> tuple[Float32[np.ndarray, "th tw 3"], Float32[np.ndarray, "th tw"]]:
    """Draw every pixel as a point and return premultiplied colour (0…1) and alpha.

    Two passes (Zwicker et al. 2001, "Surface splatting", simplified): a z-buffer of the points'
    own extent, then the mean of all points within `SPLAT_DEPTH_RATIO` of it, weighted by a tent as
    wide as the spacing of the points in the target (at least one pixel). On a plane that moves
    sideways this is bilinear interpolation, so it leaves no pinholes and blurs no more than that.

    Raises:
        ValueError: Picture, depth and source camera differ in size.
    """
    from peaking.benchmarks import _baseline_kernels as kernels

    _check_sizes(frame_rgb, depth_m, source)
    shape = (target.pinhole.height_px, target.pinhole.width_px)
    matrix, offset = _target_from_source_px(source, target)
    uvz = kernels.project(depth_m, matrix, offset)
    zoom = np.float32(target.pinhole.fx_px / source.pinhole.fx_px)
    size = kernels.footprints(
        depth_m, uvz, np.float32(SAME_SURFACE_RATIO), zoom, np.float32(SPLAT_LARGEST_PX)
    )
    nearest_m = kernels.splat_depth(uvz, size, np.float32(SPLAT_REACH), shape)
    sums = kernels.splat_colour(frame_rgb, uvz, size, nearest_m, np.float32(SPLAT_DEPTH_RATIO))
    weight = sums[..., 3]
    alpha = np.minimum(weight / np.float32(SPLAT_FULL_WEIGHT), np.float32(1.0))
    rgb = sums[..., :3] * (alpha / np.maximum(weight, np.float32(1e-12)))[..., None]
    return rgb, alpha


def mesh(
    frame_rgb: UInt8[np.ndarray, "h w 3"],
    depth_m: Float32[np.ndarray, "h w"],
    source: Camera,
    target: Camera,
) -> tuple[Float32[np.ndarray, "th tw 3"], Float32[np.ndarray, "th tw"]]:
    """Draw the picture as a surface cut at depth edges; return premultiplied colour and alpha.

    Every pixel is a vertex, four neighbours make two triangles unless their depths differ by more
    than `MESH_CUT_RATIO`; z-buffer, perspective-correct and bilinearly filtered texture.

    Raises:
        ValueError: Picture, depth and source camera differ in size.
    """
    from peaking.benchmarks import _baseline_kernels as kernels

    _check_sizes(frame_rgb, depth_m, source)
    shape = (target.pinhole.height_px, target.pinhole.width_px)
    matrix, offset = _target_from_source_px(source, target)
    uvz = kernels.project(depth_m, matrix, offset)
    settings = (np.float32(MESH_CUT_RATIO), np.float32(MESH_FLAP_PX))
    nearest_m, texture = kernels.rasterise(depth_m, uvz, matrix, offset, settings, shape)
    alpha = (nearest_m < kernels.FAR).astype(np.float32)
    sampled = cv2.remap(
        frame_rgb.astype(np.float32) / np.float32(255.0),
        np.ascontiguousarray(texture[..., 0]),
        np.ascontiguousarray(texture[..., 1]),
        interpolation=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return sampled * alpha[..., None], alpha


def _target_from_source_px(
    source: Camera, target: Camera
) -> tuple[Float32[np.ndarray, "3 3"], Float32[np.ndarray, "3"]]:
    """Return A and b of: homogeneous target pixel = depth · A · (x, y, 1) + b (corner origin)."""
    target_from_source = source_from_target(source, target).inverse()
    k: Float64[np.ndarray, "3 3"] = target.pinhole.px_from_cam
    matrix = k @ target_from_source.rotation @ source.pinhole.cam_from_px
    offset = k @ target_from_source.translation_m
    return matrix.astype(np.float32), offset.astype(np.float32)


def _check_sizes(
    frame_rgb: UInt8[np.ndarray, "h w 3"], depth_m: Float32[np.ndarray, "h w"], source: Camera
) -> None:
    width, height = source.pinhole.size_px
    if frame_rgb.shape != (height, width, 3) or depth_m.shape != (height, width):
        raise ValueError(
            f"need picture and depth of the camera's size {width}x{height}, got shapes "
            f"{frame_rgb.shape} and {depth_m.shape}"
        )
