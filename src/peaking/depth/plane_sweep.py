"""Depth from pictures alone by a plane sweep (Collins 1996).

Each picture is compared with a few others, warped through planes in front of it. A pixel gets the
depth of the plane on which it differs least from the others, where that plane is clearly the best
and the depth of another picture agrees.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from peaking.depth._plane_sweep_numba import plane_differences
from peaking.frame import Frame, as_float
from peaking.geometry import Camera

FIRST_PLANES, SECOND_PLANES = 32, 64
NUM_OTHERS = 4
BASELINE_SHARE = 0.12
"""The preferred distance to the other cameras, in focus distances."""
NEAREST, FARTHEST = 0.2, 6.0
"""Range of the first sweep, in focus distances."""
WINDOW_PX = 5
MAX_DIFFERENCE = 0.08
"""A mean absolute difference of colours above this is no match."""
MAX_SHARE_OF_MEDIAN = 0.6
"""The best difference must be below this share of the median over all planes."""
MAX_PLANES_APART = 1.5
"""Two pictures agree on a depth when their disparities are no more planes apart."""


def plane_sweep_depths_m(frames: Sequence[Frame]) -> list[Float64[np.ndarray, "_ _"]]:
    """Return a depth map for each (small) picture, 0 where no plane is clearly the best.

    A second sweep spreads its planes over the depths that the first one found.
    """
    cameras = [frame.camera for frame in frames]
    focus_m = focus_distance_m(cameras)
    others = [_others(index, cameras, BASELINE_SHARE * focus_m) for index in range(len(frames))]
    photos = [as_float(frame.rgb) for frame in frames]
    disparities: np.ndarray = np.linspace(1 / FARTHEST, 1 / NEAREST, FIRST_PLANES) / focus_m
    found = [np.zeros(photo.shape[:2]) for photo in photos]
    for _ in range(2):
        step = float(disparities[1] - disparities[0])
        found = [
            _best(index, photos, cameras, others[index], disparities)
            for index in range(len(frames))
        ]
        found = [
            _agreed(index, found, cameras, others[index], step) for index in range(len(frames))
        ]
        seen = np.concatenate([one[one > 0] for one in found])
        if len(seen) < 100:
            break
        low, high = np.percentile(seen, [1, 99])
        disparities = np.linspace(0.9 * low, 1.1 * high, SECOND_PLANES)
    return [np.divide(1, one, out=np.zeros_like(one), where=one > 0) for one in found]


def focus_distance_m(cameras: Sequence[Camera]) -> float:
    """Return the median distance from the cameras to their focus point.

    The focus point is where the viewing axes come nearest to each other. Where there is no such
    point in front of the cameras, the distance is twice their spread, at least 0.5 m.
    """
    positions = np.array([camera.position_m for camera in cameras])
    spread_m = float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max())
    across = [np.eye(3) - np.outer(camera.forward, camera.forward) for camera in cameras]
    right = np.sum([a @ p for a, p in zip(across, positions, strict=True)], axis=0)
    focus: np.ndarray = np.linalg.lstsq(np.sum(across, axis=0), right, rcond=1e-3)[0]
    ahead_m = [float((focus - camera.position_m) @ camera.forward) for camera in cameras]
    median_m = float(np.median(ahead_m))
    return median_m if median_m > 0.5 * spread_m else max(2 * spread_m, 0.5)


def _others(index: int, cameras: Sequence[Camera], baseline_m: float) -> list[int]:
    """Return the pictures to compare with: facing the same way, about `baseline_m` away."""
    here = cameras[index]
    away_m = np.array([np.linalg.norm(c.position_m - here.position_m) for c in cameras])
    facing = np.array([float(c.forward @ here.forward) for c in cameras])
    usable = (facing > 0.6) & (away_m > 0.02 * baseline_m)
    usable[index] = False
    off = np.where(usable, np.abs(np.log(np.maximum(away_m, 1e-12) / baseline_m)), np.inf)
    return [int(i) for i in np.argsort(off, kind="stable")[:NUM_OTHERS] if usable[i]]


def _best(
    index: int,
    photos: Sequence[Float32[np.ndarray, "_ _ 3"]],
    cameras: Sequence[Camera],
    others: Sequence[int],
    disparities: Float64[np.ndarray, "planes"],
) -> Float64[np.ndarray, "h w"]:
    """Return each pixel's best disparity, 0 where none is clearly the best."""
    photo = photos[index]
    if not others:
        return np.zeros(photo.shape[:2])
    each = np.empty((len(others), len(disparities), *photo.shape[:2]), np.float32)
    for place, other in enumerate(others):
        homographies = _homographies(cameras[index], cameras[other], disparities)
        plane_differences(photo, photos[other], homographies, each[place])
        for plane in each[place]:
            cv2.blur(plane, (WINDOW_PX, WINDOW_PX), dst=plane)
    # A surface may be hidden in some of the others: only the better half counts.
    half = max(1, len(others) // 2)
    costs = np.partition(each, half - 1, axis=0)[:half].mean(axis=0)
    best = costs.argmin(axis=0)
    inner = np.clip(best, 1, len(disparities) - 2)
    before, here, after = (
        np.take_along_axis(costs, (inner + k)[None], axis=0)[0] for k in (-1, 0, 1)
    )
    bend = before + after - 2 * here
    shift = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend > 1e-9)
    step = disparities[1] - disparities[0]
    disparity = disparities[inner] + np.clip(shift, -0.5, 0.5) * step
    clear = here < MAX_SHARE_OF_MEDIAN * np.median(costs, axis=0)
    return np.where((here < MAX_DIFFERENCE) & clear & (best == inner), disparity, 0.0)


def _homographies(
    here: Camera, other: Camera, disparities: Float64[np.ndarray, "planes"]
) -> Float64[np.ndarray, "planes 3 3"]:
    """Return the other camera's pixels from this one's, through each plane."""
    other_from_here = other.world_from_cam.inverse() @ here.world_from_cam
    shift = np.zeros((len(disparities), 3, 3))
    shift[:, :, 2] = disparities[:, None] * other_from_here.translation_m
    between = other_from_here.rotation + shift
    return other.pinhole.px_from_cam @ between @ here.pinhole.cam_from_px


def _agreed(
    index: int,
    found: Sequence[Float64[np.ndarray, "_ _"]],
    cameras: Sequence[Camera],
    others: Sequence[int],
    step: float,
) -> Float64[np.ndarray, "h w"]:
    """Return a picture's disparities where those of at least one other picture agree."""
    disparity = found[index]
    ys, xs = np.nonzero(disparity)
    rays = cameras[index].pinhole.rays()[ys, xs]
    in_world_m = cameras[index].world_from_cam.apply(rays / disparity[ys, xs][:, None])
    agreed = np.zeros(len(ys), bool)
    for other in others:
        xy_px, depth_m = cameras[other].project(in_world_m)
        within = (xy_px >= 0) & (xy_px < cameras[other].pinhole.size_px)
        inside = within[:, 0] & within[:, 1]
        column, row = np.where(inside[:, None], xy_px, 0).astype(np.int64).T
        there = found[other][row, column]
        near = np.abs(there - 1 / np.where(inside, depth_m, 1)) < MAX_PLANES_APART * step
        agreed |= inside & (there > 0) & near
    kept = np.zeros_like(disparity)
    kept[ys[agreed], xs[agreed]] = disparity[ys, xs][agreed]
    return kept
