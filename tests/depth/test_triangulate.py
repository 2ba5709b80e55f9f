"""Distances from matched pixels."""

from __future__ import annotations

import numpy as np

from peaking.depth.triangulation import _met, triangulate
from peaking.frame import Frame
from recordings import lateral_cameras

EXACT_PER_M = 1e-9


def frames() -> tuple[Frame, Frame]:
    first, second = lateral_cameras(2, 96, 72)
    black = np.zeros((72, 96, 3), np.uint8)
    return Frame("a", black, first), Frame("b", black, second)


def test_rays_through_one_point_meet_there() -> None:
    here, there = frames()
    points_m = np.random.default_rng(0).uniform([-0.3, -0.2, 1.0], [0.3, 0.2, 2.0], (20, 3))
    seen: list[np.ndarray] = []
    for frame in (here, there):
        in_camera_m = frame.camera.world_from_cam.inverse().apply(points_m)
        projected = in_camera_m @ frame.camera.pinhole.px_from_cam.T
        seen.append(projected[:, :2] / projected[:, 2:])
    evidence = _met(here, there, seen[0], seen[1])
    assert len(evidence) == 20
    depth_m = here.camera.world_from_cam.inverse().apply(points_m)[:, 2]
    np.testing.assert_allclose(evidence.disparity_per_m, 1 / depth_m, atol=EXACT_PER_M)
    seen[1][3] += [0.0, 9.0]  # off its epipolar line
    assert len(_met(here, there, seen[0], seen[1])) == 19


def test_from_one_place_nothing_can_be_told() -> None:
    here, _ = frames()
    pixels = np.random.default_rng(0).uniform(10, 60, (20, 2))
    assert len(_met(here, here, pixels, pixels)) == 0


def test_pictures_without_features_say_nothing() -> None:
    assert len(triangulate(*frames())) == 0
