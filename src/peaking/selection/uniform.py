"""Even steps along the path: the paper's "Uniform". It needs the whole path."""

# Some functions of NumPy and OpenCV have types that pyright cannot resolve.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera
from peaking.selection.policy import CandidatePath


def choose_uniform(
    path: CandidatePath,
    count: int,
    rng: np.random.Generator,
    *,
    metres_per_rad: float = 0.0,
) -> list[int]:
    """Choose views at equal distances along the path, "as far as possible" (paper, section 4.2).

    With `metres_per_rad` a rotation is a part of the path too (`spread_along`).
    """
    return path.numbers(spread_along(path.cameras, count, metres_per_rad=metres_per_rad))


def spread_along(
    cameras: Sequence[Camera], count: int, *, metres_per_rad: float = 0.0
) -> list[int]:
    """Return the places of the cameras nearest to `count` even marks on the path, none twice.

    Args:
        cameras: In the order of capture.
        count: At most as many as there are cameras.
        metres_per_rad: What a rotation counts as, in metres of path; 0 leaves it out.
    """
    way_m = path_m(cameras, metres_per_rad=metres_per_rad)
    free = np.ones(len(cameras), dtype=bool)
    for mark_m in np.linspace(0.0, way_m[-1], count):
        free[np.argmin(np.where(free, np.abs(way_m - mark_m), np.inf))] = False
    return np.flatnonzero(~free).tolist()


def path_m(cameras: Sequence[Camera], *, metres_per_rad: float = 0.0) -> Float64[np.ndarray, "n"]:
    """Return how far the camera had come at each view, in metres (and rotations, if they count)."""
    positions_m = np.array([camera.position_m for camera in cameras])
    steps_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
    if metres_per_rad > 0:
        turned = [rotation_rad(a, b) for a, b in itertools.pairwise(cameras)]
        steps_m = steps_m + metres_per_rad * np.array(turned)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def rotation_rad(a: Camera, b: Camera) -> float:
    """Return the angle between two cameras' orientations."""
    turn = a.world_from_cam.rotation.T @ b.world_from_cam.rotation
    return float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1.0, 1.0)))
