"""What a recording holds: cameras, path, depth, sharpness, exposure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64

from peaking.datasets import Recording
from peaking.datasets.depth_unit import depth_over_distance, typical_distance
from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera, Pinhole
from peaking.selection.blur import relative_to_nearest, sharpness

LOOKED_AT_PIXELS = 120_000
"""Pictures are shrunk to so many before sharpness and brightness are measured."""
SAMPLED = 40
"""Depth maps that are looked at, at even steps."""
JUMP = 6.0
"""A step so many times the usual one around it is a jump."""
JUMP_SHARE = 0.05
"""And at least so much of the distance to what is seen."""
AROUND = 9
"""Steps around one that tell what is usual there."""
HELD_UPRIGHT = 0.9
"""Cosine between an axis of the world and the cameras' mean up, at which it is called up."""
TURNED_ABOUT = 0.3
"""Length of the mean of the cameras' ups below which nothing is said of up."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class PathFacts:
    """The path of the camera.

    Attributes:
        length_m: Of all steps.
        extent_m: Sides of the box that holds it, the longest first.
        step_m: Median.
        turn_deg: Median.
        jumps: Frames that lie far from the one before, beside the steps around.
        up: "+y" or the like, "between axes", or None: turned about in every direction.
        distance_m: How far away things typically are, by pictures and poses; None where too little
            is found.
    """

    length_m: float
    extent_m: tuple[float, float, float]
    step_m: float
    turn_deg: float
    jumps: tuple[int, ...]
    up: str | None
    distance_m: float | None


@dataclass(frozen=True)
class DepthFacts:
    """The depth maps.

    Attributes:
        frames: How many have one in which anything is known.
        size_px: Width and height of the first.
        known_share: Of pixels, 0…1.
        near_m: 5th percentile.
        median_m: Median.
        far_m: 95th percentile.
        over_pictures: Depth over what pictures and poses say, 1 where they agree; None where too
            little is found.
    """

    frames: int
    size_px: tuple[int, int]
    known_share: float
    near_m: float
    median_m: float
    far_m: float
    over_pictures: float | None


@dataclass(frozen=True)
class Looks:
    """Sharpness and brightness of every picture over those of pictures from nearby; 1 is usual."""

    sharpness: Float64[np.ndarray, "n"]
    brightness: Float64[np.ndarray, "n"]


@dataclass(frozen=True)
class Facts:
    """All of it; `looks` is None where pictures were not looked at."""

    cameras: tuple[Pinhole, ...]
    """One of each kind, the most frequent first."""
    path: PathFacts
    depth: DepthFacts | None
    looks: Looks | None
    seconds: float | None
    masks: int
    with_points: bool


def facts_of(
    recording: Recording,
    *,
    with_looks: bool = True,
    progress: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> Facts:
    """Look at a recording.

    Args:
        recording: Of any format.
        with_looks: Read every picture, for sharpness and exposure; else some.
        progress: Is given the numbers of frames that are read, and yields them.

    Raises:
        RecordingError: A file of it cannot be read.
    """
    read = lru_cache(maxsize=4)(recording.read)
    numbers = range(len(recording)) if with_looks else _even(range(len(recording)), SAMPLED)
    sharp: list[float] = []
    bright: list[float] = []
    masks, with_points = 0, False
    maps: list[np.ndarray] = []
    for_depth = set(_even(numbers, SAMPLED))
    for number in progress(numbers):
        frame = read(number)
        masks += frame.mask is not None
        with_points |= frame.points_m is not None and len(frame.points_m) > 0
        if with_looks:
            small = shrunk(frame)
            sharp.append(sharpness(small.rgb))
            bright.append(max(1e-3, float(np.mean(small.rgb))))
        if frame.depth_m is not None and number in for_depth:
            maps.append(frame.depth_m)
    looks = None
    if with_looks:
        looks = Looks(
            relative_to_nearest(recording.cameras, np.array(sharp)),
            relative_to_nearest(recording.cameras, np.array(bright)),
        )
    times_s = [time_s for time_s in recording.timestamps_s if time_s is not None]
    return Facts(
        cameras=_cameras(recording.cameras),
        path=_path(recording, read),
        depth=_depth(recording, maps, read),
        looks=looks,
        seconds=max(times_s) - min(times_s) if len(times_s) > 1 else None,
        masks=masks,
        with_points=with_points,
    )


def shrunk(frame: Frame) -> Frame:
    """Return a frame at the size at which pictures are looked at."""
    size_px = frame.camera.pinhole.size_px
    if size_px[0] * size_px[1] <= LOOKED_AT_PIXELS:
        return frame
    return frame.resized(*working_size_px(*size_px, pixels=LOOKED_AT_PIXELS))


def _even(numbers: Sequence[int], count: int) -> Sequence[int]:
    places = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [numbers[int(place)] for place in places]


def _cameras(cameras: Sequence[Camera]) -> tuple[Pinhole, ...]:
    counts: dict[Pinhole, int] = {}
    for camera in cameras:
        counts[camera.pinhole] = counts.get(camera.pinhole, 0) + 1
    return tuple(sorted(counts, key=lambda pinhole: -counts[pinhole]))


def _path(recording: Recording, read: Callable[[int], Frame]) -> PathFacts:
    cameras = recording.cameras
    places_m = np.array([camera.position_m for camera in cameras])
    steps_m = np.linalg.norm(np.diff(places_m, axis=0), axis=1)
    rotations = np.array([camera.world_from_cam.rotation for camera in cameras])
    traces = np.einsum("nij,nij->n", rotations[:-1], rotations[1:])
    turns_deg = np.degrees(np.arccos(np.clip((traces - 1) / 2, -1, 1)))
    extent = sorted(np.ptp(places_m, axis=0).tolist(), reverse=True)
    distance_m = typical_distance(cameras, read) if len(cameras) > 1 else None
    return PathFacts(
        length_m=float(steps_m.sum()),
        extent_m=(extent[0], extent[1], extent[2]),
        step_m=float(np.median(steps_m)) if len(steps_m) else 0.0,
        turn_deg=float(np.median(turns_deg)) if len(turns_deg) else 0.0,
        jumps=_jumps(steps_m, distance_m),
        up=_up(rotations),
        distance_m=distance_m,
    )


def _jumps(steps_m: Float64[np.ndarray, "n"], distance_m: float | None) -> tuple[int, ...]:
    """Return the frames before which the camera jumps."""
    if len(steps_m) < AROUND:
        return ()
    least_m = JUMP_SHARE * (distance_m or 0.0)
    found: list[int] = []
    for i, step_m in enumerate(steps_m):
        start = min(max(0, i - AROUND // 2), len(steps_m) - AROUND)
        around = np.median(steps_m[start : start + AROUND])
        usual_m = max(float(around), float(np.median(steps_m)))
        if step_m > max(JUMP * usual_m, least_m) and step_m > 0:
            found.append(i + 1)
    return tuple(found)


def _up(rotations: Float64[np.ndarray, "n 3 3"]) -> str | None:
    """Return which axis of the world is up, by how the cameras were held."""
    mean = -rotations[:, :, 1].mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length < TURNED_ABOUT:
        return None
    axis = int(np.argmax(np.abs(mean)))
    if abs(mean[axis]) < HELD_UPRIGHT * length:
        return "between axes"
    return ("+" if mean[axis] > 0 else "-") + _AXES[axis]


def _depth(
    recording: Recording, maps: Sequence[np.ndarray], read: Callable[[int], Frame]
) -> DepthFacts | None:
    with_depth = [i for i, has_depth in enumerate(recording.has_depth) if has_depth]
    if not with_depth or not maps:
        return None
    measured = np.concatenate([depth_m[depth_m > 0][::17] for depth_m in maps])
    if len(measured) == 0:
        return None
    near, median, far = np.percentile(measured, [5, 50, 95])
    return DepthFacts(
        frames=len(with_depth),
        size_px=(maps[0].shape[1], maps[0].shape[0]),
        known_share=float(np.mean([(depth_m > 0).mean() for depth_m in maps])),
        near_m=float(near),
        median_m=float(median),
        far_m=float(far),
        over_pictures=depth_over_distance(with_depth, recording.cameras, read),
    )
