"""Whether depth of an unstated unit can be metres: pictures and poses tell distances too.

Features of one picture are found in another, and where their rays meet is compared with the depth
map. What differs by more than `MOST` is another unit: TUM's data sets count in 1/5000 m, which lies
five times too far away where it is taken for millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

from peaking.depth.triangulation import triangulate
from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera

PLACES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Of the pictures that are looked at, in the recording."""
REACH = 30
"""Frames among which a picture's partner is looked for."""
WORKING_PIXELS = 200_000
LEAST_PIXELS = 10_000
"""Smaller pictures tell nothing."""
MIN_POINTS = 50
MOST = 1.8
"""Ratio of both distances that is still no other unit. Measured on five recordings, three drawn and
two real, 2026-11-30: 0.984 to 1.007."""
SPREAD = 1.5
"""Between the quartiles of the ratios; where they differ more, nothing is said."""
MIN_FACING = 0.9
"""Cosine between the directions of two pictures."""


def depth_over_distance(
    numbers: Sequence[int], cameras: Sequence[Camera], read: Callable[[int], Frame]
) -> float | None:
    """Return how many times as far away things are by depth as by pictures and poses.

    Args:
        numbers: Frames with depth, in the order they were taken.
        cameras: Of all frames.
        read: Returns a frame.

    Returns:
        The median ratio; None where too little is found, or the ratios disagree.

    Raises:
        RecordingError: A frame cannot be read.
    """
    found = [np.zeros(0)]
    for place in sorted({round(share * (len(numbers) - 1)) for share in PLACES}):
        partner = _partner(numbers, place, cameras)
        width_px, height_px = cameras[numbers[place]].pinhole.size_px
        if partner is not None and width_px * height_px >= LEAST_PIXELS:
            found.append(_ratios(read(numbers[place]), read(partner)))
    ratios = np.concatenate(found)
    if len(ratios) < MIN_POINTS:
        return None
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    return float(middle) if high < SPREAD * low else None


def typical_distance(cameras: Sequence[Camera], read: Callable[[int], Frame]) -> float | None:
    """Return how far away things typically are by pictures and poses, in the unit of the poses.

    Args:
        cameras: Of all frames, in the order they were taken.
        read: Returns a frame.

    Returns:
        The median distance along the optical axis; None where too little is found.

    Raises:
        RecordingError: A frame cannot be read.
    """
    numbers = range(len(cameras))
    found = [np.zeros(0)]
    for place in sorted({round(share * (len(cameras) - 1)) for share in PLACES}):
        partner = _partner(numbers, place, cameras)
        if partner is not None:
            small, there = (_small(read(number)) for number in (place, partner))
            found.append(triangulate(small, there).disparity_per_m)
    disparity_per_m = np.concatenate(found)
    positive = disparity_per_m[disparity_per_m > 0]
    return float(1 / np.median(positive)) if len(positive) >= MIN_POINTS else None


def _small(frame: Frame) -> Frame:
    return frame.resized(*working_size_px(*frame.camera.pinhole.size_px, pixels=WORKING_PIXELS))


def _partner(numbers: Sequence[int], place: int, cameras: Sequence[Camera]) -> int | None:
    """Return the frame that is farthest away of those nearby that look the same way."""
    here = cameras[numbers[place]]
    near = [
        number
        for number in numbers[max(0, place - REACH) : place + REACH]
        if float(cameras[number].forward @ here.forward) > MIN_FACING
    ]
    away_m = [float(np.linalg.norm(cameras[n].position_m - here.position_m)) for n in near]
    return near[int(np.argmax(away_m))] if near and max(away_m) > 0 else None


def _ratios(frame: Frame, other: Frame) -> Float64[np.ndarray, "points"]:
    if frame.depth_m is None:
        return np.zeros(0)
    small, there = _small(frame), _small(other)
    evidence = triangulate(small, there)
    if len(evidence.points_px) == 0:
        return np.zeros(0)
    rows, columns = frame.depth_m.shape
    share = evidence.points_px / np.array(small.camera.pinhole.size_px)
    x, y = np.minimum((share * (columns, rows)).astype(int), (columns - 1, rows - 1)).T
    depth_m = frame.depth_m[y, x].astype(np.float64)
    return (depth_m * evidence.disparity_per_m)[depth_m > 0]
