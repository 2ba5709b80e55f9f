"""Coloured points to start from: fused depth maps, or a plane sweep where there is no depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera

SWEEP_PIXELS = 8000
SWEEP_PLANES = 64
SWEEP_NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class Points:
    """Coloured points on surfaces: places in the world, and RGB in 0…1."""

    places_m: Float64[np.ndarray, "n 3"]
    rgb: Float32[np.ndarray, "n 3"]

    def __len__(self) -> int:
        return len(self.places_m)

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """Return all points of several sets."""
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.places_m for part in parts)]),
            np.concatenate([np.zeros((0, 3), np.float32), *(part.rgb for part in parts)]),
        )


def seed_points(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> Points:
    """Return about `count` points on surfaces (fewer where there are fewer).

    Frames with depth give theirs; without any depth, each frame is compared with its nearest
    others over a range of distances, and pixels where the best distance stands out are kept.
    """
    small = [_small(frame) for frame in frames]
    found: list[Points] = []
    with_depth = [frame for frame in small if frame.depth_m is not None]
    if with_depth:
        found = [_from_depth(frame) for frame in with_depth]
    elif len(frames) > 1:
        near_m, far_m = _range_m([frame.camera for frame in frames])
        found = [_swept(i, small, near_m, far_m) for i in range(len(small))]
    points = Points.joined(found)
    if len(points) < 100:
        points = _in_frusta(small, count, rng)
    return thinned(points, count, rng)


def _small(frame: Frame) -> Frame:
    width, height = working_size_px(*frame.camera.pinhole.size_px, pixels=SWEEP_PIXELS)
    return frame.resized(width, height)


def _from_depth(frame: Frame) -> Points:
    height, width = frame.rgb.shape[:2]
    stored_m = np.asarray(frame.depth_m)
    depth_m = cv2.resize(stored_m, (width, height), interpolation=cv2.INTER_NEAREST)
    known = np.isfinite(depth_m) & (depth_m > 0)
    points_m = frame.camera.pinhole.rays()[known] * depth_m[known][:, None]
    return Points(frame.camera.world_from_cam.apply(points_m), _unit(frame.rgb)[known])


def _range_m(cameras: Sequence[Camera]) -> tuple[float, float]:
    """Return the distances to look at, from where the optical axes come nearest each other."""
    positions = np.array([camera.position_m for camera in cameras])
    spread = float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max())
    across = [np.eye(3) - np.outer(camera.forward, camera.forward) for camera in cameras]
    total = np.sum(across, axis=0)
    right = np.sum([a @ p for a, p in zip(across, positions, strict=True)], axis=0)
    focus = np.linalg.lstsq(total, right, rcond=1e-3)[0]
    ahead = [float((focus - camera.position_m) @ camera.forward) for camera in cameras]
    middle = float(np.median(ahead))
    if not middle > 0.5 * spread:
        middle = max(2 * spread, 0.5)
    return 0.2 * middle, 6.0 * middle


def _swept(index: int, frames: Sequence[Frame], near_m: float, far_m: float) -> Points:
    """Return where a frame's pixels look alike in its nearest others (Collins 1996)."""
    here = frames[index]
    height, width = here.rgb.shape[:2]
    eye = here.camera.position_m
    apart = [float(np.linalg.norm(frame.camera.position_m - eye)) for frame in frames]
    facing = [float(frame.camera.forward @ here.camera.forward) for frame in frames]
    usable = [i for i in np.argsort(apart) if i != index and apart[i] > 0 and facing[i] > 0.5]
    others = [frames[int(i)] for i in usable[:SWEEP_NEIGHBOURS]]
    if not others:
        return Points.joined([])
    photo = _unit(here.rgb)
    depths_m = 1 / np.linspace(1 / near_m, 1 / far_m, SWEEP_PLANES)
    costs = np.empty((SWEEP_PLANES, height, width), np.float32)
    for plane, depth_m in enumerate(depths_m):
        each = [_difference(photo, here.camera, other, float(depth_m)) for other in others]
        best = np.sort(np.stack(each), axis=0)[: max(1, len(each) // 2)]
        costs[plane] = best.mean(axis=0)
    plane = costs.argmin(axis=0)
    lowest = costs.min(axis=0)
    kept = (lowest < 0.06) & (lowest < 0.5 * np.median(costs, axis=0))
    kept &= (plane > 0) & (plane < SWEEP_PLANES - 1)
    points_m = here.camera.pinhole.rays()[kept] * depths_m[plane[kept]][:, None]
    return Points(here.camera.world_from_cam.apply(points_m), photo[kept])


def _difference(
    photo: Float32[np.ndarray, "h w 3"], camera: Camera, other: Frame, depth_m: float
) -> Float32[np.ndarray, "h w"]:
    """Return how unlike the other picture is, seen by way of a plane; 1 outside of it."""
    other_from_here = other.camera.world_from_cam.inverse() @ camera.world_from_cam
    normal = np.array([[0.0, 0.0, 1 / depth_m]])
    plane = other_from_here.rotation + other_from_here.translation_m[:, None] @ normal
    # OpenCV counts pixels from the centre of the first one.
    to_corner = np.array([[1.0, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    homography = np.linalg.inv(to_corner) @ other.camera.pinhole.px_from_cam
    homography = homography @ plane @ camera.pinhole.cam_from_px @ to_corner
    size = photo.shape[1], photo.shape[0]
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpPerspective(_unit(other.rgb), homography, size, flags=how, borderValue=(9, 9, 9))
    difference = np.minimum(np.abs(seen - photo).mean(axis=2), 1.0)
    return cv2.blur(difference, (5, 5))


def _in_frusta(frames: Sequence[Frame], count: int, rng: np.random.Generator) -> Points:
    """Return points at random pixels and random disparities."""
    near_m, far_m = _range_m([frame.camera for frame in frames])
    found: list[Points] = []
    for frame in frames:
        each = -(-count // len(frames))
        pixels = rng.integers(0, frame.rgb.shape[0] * frame.rgb.shape[1], each)
        depth_m = 1 / rng.uniform(1 / far_m, 1 / near_m, each)
        rays = frame.camera.pinhole.rays().reshape(-1, 3)[pixels]
        places_m = frame.camera.world_from_cam.apply(rays * depth_m[:, None])
        found.append(Points(places_m, _unit(frame.rgb).reshape(-1, 3)[pixels]))
    return Points.joined(found)


def thinned(points: Points, count: int, rng: np.random.Generator) -> Points:
    """Return one point for each occupied voxel, with voxels so large that about `count` are."""
    if len(points) <= count:
        return points
    low, high = np.percentile(points.places_m, [1, 99], axis=0)
    side = float(np.max(high - low)) / 1000 + 1e-9
    while True:
        cells = np.floor(points.places_m / side).astype(np.int64)
        first = np.unique(cells, axis=0, return_index=True)[1]
        if len(first) <= 1.3 * count:
            break
        side *= 1.2
    chosen = rng.permutation(first)[:count]
    return Points(points.places_m[chosen], points.rgb[chosen])


def _unit(rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    return rgb.astype(np.float32) / np.float32(255)
