"""Coverage: far from all others in place and direction, and the surface from new directions.

It needs the whole path, and neither looks at the pictures nor knows of errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from peaking.geometry import Camera
from peaking.selection.policy import CandidatePath
from peaking.view_weights import overlap_points_m

METRES_PER_RAD = 0.5
"""Of the scene's depth: what a rotation by one radian counts as (`peaking.selection.farthest`)."""

CELLS_PER_DEPTH = 10
"""Cells of the surface along each axis, per typical depth of the scene."""

LEAST = 0.1
"""What a frame counts at least, where it shows nothing new or is not sharp."""

DIRECTION_STEPS = 3
"""Steps along each axis of a cube's face: directions are told apart by about 30°."""


@dataclass(frozen=True)
class Cover:
    """Frames in the order in which they are taken.

    Attributes:
        places: Places of the path, the first taken first; each beginning of it covers best.
        gaps_m: How far each was from all those taken before it, rotations counted; infinite for the
            first.
        left_m: How far the frame that is farthest from all those taken is.
    """

    places: tuple[int, ...]
    gaps_m: tuple[float, ...]
    left_m: float


def choose_by_coverage(path: CandidatePath, count: int, rng: np.random.Generator) -> list[int]:
    """Choose `count` frames by `cover`."""
    found = cover(path.cameras, path.scene_depth_m, count)
    return path.numbers(sorted(found.places))


def cover(
    cameras: Sequence[Camera],
    scene_depth_m: float,
    count: int,
    *,
    worth: Float64[np.ndarray, "n"] | None = None,
) -> Cover:
    """Take, again and again, the frame that adds most to those taken.

    What it adds is its distance from the nearest one taken (position, and rotation), times the part
    of what it sees that none has seen from about there: cells of the surface, each with the
    directions it was seen from, as coverage is counted in IndoorTraj (arXiv 2409.07098). The
    surface is taken to be at the scene's typical depth.

    Args:
        cameras: Of all frames.
        scene_depth_m: How far away things typically are.
        count: How many to take, at most as many as there are cameras.
        worth: What each frame counts beforehand, 0…1; all the same without it.
    """
    positions_m = np.array([camera.position_m for camera in cameras])
    forward = np.array([camera.forward for camera in cameras])
    numbers = np.stack([_seen_from(camera, scene_depth_m) for camera in cameras])
    cells = np.unique(numbers, return_inverse=True)[1].reshape(numbers.shape)
    new = np.ones(cells.max() + 1)
    worth = np.ones(len(cameras)) if worth is None else worth
    gap_m = np.full(len(cameras), np.inf)
    places: list[int] = []
    gaps_m: list[float] = []
    free = np.ones(len(cameras), dtype=bool)
    while len(places) < count:
        finite_m = np.where(np.isfinite(gap_m), gap_m, 1.0)
        # What shows nothing new may still be the farthest from all others.
        gain = finite_m * (LEAST + new[cells].mean(axis=1)) * (LEAST + worth)
        place = int(np.argmax(np.where(free, gain, -1.0)))
        free[place] = False
        places.append(place)
        gaps_m.append(float(gap_m[place]))
        new[cells[place]] = 0.0
        angle_rad = np.arccos(np.clip(forward @ forward[place], -1.0, 1.0))
        away_m = np.linalg.norm(positions_m - positions_m[place], axis=1)
        gap_m = np.minimum(gap_m, away_m + METRES_PER_RAD * scene_depth_m * angle_rad)
    return Cover(tuple(places), tuple(gaps_m), float(gap_m.max()))


def _seen_from(camera: Camera, scene_depth_m: float) -> Int64[np.ndarray, "points"]:
    """Return a number for each cell of the surface with the direction it is seen from."""
    points_m = overlap_points_m(camera, scene_depth_m)
    cell = np.floor(points_m * (CELLS_PER_DEPTH / scene_depth_m)).astype(np.int64)
    to_camera = camera.position_m - points_m
    to_camera = to_camera / np.abs(to_camera).max(axis=1, keepdims=True)
    step = np.clip(((to_camera + 1) / 2 * DIRECTION_STEPS).astype(np.int64), 0, DIRECTION_STEPS)
    mixed = np.concatenate([cell, step], axis=1)
    primes = np.array([73856093, 19349663, 83492791, 2654435761, 805459861, 3674653429])
    return (mixed * primes).sum(axis=1)
