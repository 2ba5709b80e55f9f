"""COLMAP's cameras aligned with the recorded ones: algebra by hand, and (`-m colmap`) COLMAP."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import CamerasNotFound
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.poses.colmap import (
    estimate_cameras,
    pairs_to_match,
    similarity_to,
)
from recordings import lateral_cameras

DESK = Path(__file__).parents[2] / "scenes" / "desk"
POSITIONS_AGREE_M = 0.005
"""Root mean square, of 10 cameras over the sample scene. Measured with 16 of them: 0.0006."""
DIRECTIONS_AGREE_DEG = 0.2
"""The worst. Measured with 16 cameras: 0.03."""


def turned(axis: int, degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    matrix = np.eye(3)
    a, b = [k for k in range(3) if k != axis]
    matrix[a, a] = matrix[b, b] = np.cos(angle)
    matrix[a, b], matrix[b, a] = -np.sin(angle), np.sin(angle)
    return matrix


def moved(
    poses: list[Rigid[World, Cam]], scale: float, rotation: np.ndarray, shift: np.ndarray
) -> list[Rigid[World, Cam]]:
    return [
        Rigid(rotation @ pose.rotation, scale * rotation @ pose.translation_m + shift)
        for pose in poses
    ]


@pytest.mark.parametrize("straight", (True, False))
def test_a_known_similarity_is_found(straight: bool) -> None:
    """A straight path leaves the turn about itself to the cameras' axes."""
    rng = np.random.default_rng(0)
    off = np.zeros((6, 3)) if straight else 0.2 * rng.normal(size=(6, 3))
    poses: list[Rigid[World, Cam]] = [
        Rigid(turned(1, 5.0 * i), np.array([0.1 * i, 0.0, 0.0]) + off[i]) for i in range(6)
    ]
    rotation, shift = turned(0, 30) @ turned(2, -70), np.array([1.0, -2.0, 0.5])
    found = similarity_to(poses, moved(poses, 2.5, rotation, shift))
    assert found.scale == pytest.approx(2.5)
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation_m, shift, atol=1e-12)
    np.testing.assert_allclose(
        found.apply(np.array([[1.0, 2, 3]])), [2.5 * rotation @ [1, 2, 3] + shift], atol=1e-12
    )


def test_noise_shrinks_nothing_by_much() -> None:
    rng = np.random.default_rng(1)
    poses: list[Rigid[World, Cam]] = [Rigid(np.eye(3), rng.normal(size=3)) for _ in range(50)]
    noisy = [
        Rigid[World, Cam](p.rotation, p.translation_m + 0.01 * rng.normal(size=3)) for p in poses
    ]
    assert similarity_to(poses, noisy).scale == pytest.approx(1.0, abs=0.01)


def test_cameras_in_one_place_have_no_scale() -> None:
    poses: list[Rigid[World, Cam]] = [Rigid.identity()] * 4
    with pytest.raises(CamerasNotFound, match="scale stays unknown"):
        similarity_to(poses, poses)


def test_pairs_are_near_and_face_the_same_way() -> None:
    cameras = lateral_cameras(40, 64, 48)
    back = replace(
        cameras[0],
        world_from_cam=Rigid(
            cameras[0].world_from_cam.rotation @ turned(1, 180), cameras[0].position_m
        ),
    )
    pairs = pairs_to_match([*cameras, back], 6)
    assert all(a < b for a, b in pairs)
    assert {(10, 11), (10, 12), (10, 13)} <= set(pairs)
    assert (0, 39) not in pairs
    assert {a for a, b in pairs if b == 40} == {39}  # by order alone


@pytest.mark.colmap
@pytest.mark.filterwarnings("default")
def test_colmap_finds_the_cameras_of_the_sample_scene() -> None:
    """Its pictures are ray-traced, so the recorded cameras are exact."""
    recording = open_recording(DESK)
    frames = [recording.read(index) for index in range(0, len(recording), 15)]
    found = estimate_cameras(frames)
    placed = [(c, f.camera) for c, f in zip(found.cameras, frames, strict=True) if c is not None]
    assert len(placed) >= len(frames) - 1
    assert found.residual_m < POSITIONS_AGREE_M
    for camera, recorded in placed:
        assert camera.pinhole == recorded.pinhole
        assert camera.forward @ recorded.forward > np.cos(np.radians(DIRECTIONS_AGREE_DEG))
    depth_m = frames[0].depth_m
    assert depth_m is not None
    in_cam_m = frames[0].camera.world_from_cam.inverse().apply(found.points.xyz_m)
    assert len(in_cam_m) > 200
    assert 0.5 * depth_m[depth_m > 0].min() < np.median(in_cam_m[:, 2]) < 2 * depth_m.max()


@pytest.mark.colmap
@pytest.mark.filterwarnings("default")
def test_pictures_of_nothing_cannot_be_joined() -> None:
    camera: Camera = lateral_cameras(1, 320, 240)[0]
    noise = np.random.default_rng(0).integers(0, 256, (3, 240, 320, 3)).astype(np.uint8)
    with pytest.raises(CamerasNotFound, match="could not join"):
        estimate_cameras([Frame("", rgb, camera) for rgb in noise])
