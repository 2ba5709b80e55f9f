# pyright: basic
"""Pictures: a sheet of views of each scene, and the paths of a photographer from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from peaking.photographers.tasks import TASKS, SceneName, open_scene

COLOURS: Mapping[str, tuple[int, int, int]] = {
    "interval": (96, 96, 96),
    "llff": (0, 132, 110),
    "threshold": (150, 90, 190),
    "red": (225, 120, 0),
    "auto": (10, 95, 200),
    "next": (190, 30, 90),
}
PX_PER_M = 200.0
AROUND_M = 0.6
"""So much around the volume is drawn."""

MAP_VIEWS = 64
"""Test views that tell where the volume ends."""

LOW_M, HIGH_M = 0.25, 1.7
"""What is drawn of a scene from above lies between these heights."""


def sheet(scene: SceneName, count: int = 6) -> UInt8[np.ndarray, "h w 3"]:
    """Return some test views beside each other."""
    drawn = open_scene(scene)
    return np.hstack([drawn.draw(camera)[0] for camera in TASKS[scene].test_cameras(count)])


def paths(
    scene: SceneName, walked: Mapping[str, tuple[Sequence[Any], Sequence[Any]]], test_views: int
) -> UInt8[np.ndarray, "h w 3"]:
    """Return a map for every guide: the path as a line, photos as wedges, test views as dots.

    Args:
        scene: Where.
        walked: By guide: positions and directions along the path, and 3×4 poses of the photos.
        test_views: So many are drawn.
    """
    maps = [
        _map(scene, guide, np.array(path, dtype=float), photos, test_views)
        for guide, (path, photos) in walked.items()
    ]
    return np.hstack(maps)


def _map(
    scene: SceneName, guide: str, path: np.ndarray, photos: Sequence[Any], test_views: int
) -> np.ndarray:
    cameras = TASKS[scene].test_cameras(MAP_VIEWS)
    places_m = np.array([camera.position_m[:2] for camera in cameras])
    low_m, high_m = places_m.min(axis=0) - AROUND_M, places_m.max(axis=0) + AROUND_M
    width, height = ((high_m - low_m) * PX_PER_M).astype(int)
    image = np.full((height, width, 3), 255, np.uint8)

    def px(at_m: Float[np.ndarray, "2"]) -> tuple[int, int]:
        x, y = (at_m - low_m) * PX_PER_M
        return int(x), int(height - y)

    mesh = open_scene(scene).mesh
    corners_m = mesh.points_m[mesh.faces]
    middle_m = corners_m.mean(axis=1)
    shown = (middle_m[:, 2] > LOW_M) & (middle_m[:, 2] < HIGH_M)
    order = np.argsort(middle_m[shown, 2])
    for triangle in corners_m[shown][order]:
        grey = 235 - int(60 * (triangle[0, 2] - LOW_M) / (HIGH_M - LOW_M))
        cv2.fillConvexPoly(image, np.array([px(at) for at in triangle[:, :2]]), (grey,) * 3)
    colour = COLOURS[guide]
    for camera in TASKS[scene].test_cameras(test_views):
        cv2.circle(image, px(camera.position_m[:2]), 3, (205, 60, 60), 1, cv2.LINE_AA)
    if len(path):
        line = np.array([px(at) for at in path[:, :2]])
        cv2.polylines(image, [line], False, colour, 1, cv2.LINE_AA)
    for pose in photos:
        rows = np.array(pose).reshape(3, 4)
        at_m, forward = rows[:2, 3], rows[:2, 2]
        forward = forward / (np.linalg.norm(forward) + 1e-9)
        side = np.array([-forward[1], forward[0]])
        wedge = [px(at_m), px(at_m + 0.1 * forward + 0.045 * side)]
        wedge.append(px(at_m + 0.1 * forward - 0.045 * side))
        cv2.fillPoly(image, [np.array(wedge)], colour, cv2.LINE_AA)
    cv2.putText(image, guide, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 2, cv2.LINE_AA)
    return image
