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
}
PX_PER_M = 150.0
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
    points_m = open_scene(scene).mesh.points_m
    between = points_m[(points_m[:, 2] > LOW_M) & (points_m[:, 2] < HIGH_M)][:, :2]
    low_m, high_m = between.min(axis=0) - 0.1, between.max(axis=0) + 0.1
    width, height = ((high_m - low_m) * PX_PER_M).astype(int)
    density = np.histogram2d(
        between[:, 1], between[:, 0], bins=(height // 3, width // 3),
        range=((low_m[1], high_m[1]), (low_m[0], high_m[0])),
    )[0]  # fmt: skip
    grey = 255 - 90 * np.clip(density / 4, 0, 1)
    image = cv2.resize(grey, (width, height), interpolation=cv2.INTER_LINEAR)[::-1]
    image = np.repeat(image[..., None], 3, axis=2).astype(np.uint8).copy()

    def px(at_m: Float[np.ndarray, "2"]) -> tuple[int, int]:
        x, y = (at_m - low_m) * PX_PER_M
        return int(x), int(height - y)

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
