"""Where COLMAP says that the frames of a recording were taken, found once for all strategies.

Of all frames, the test views too: rendered from where it was recorded, a test view would be off
from Gaussians that were trained at COLMAP's cameras. No strategy sees these cameras. Frames that
COLMAP could not join to the others are neither trained on nor tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from peaking.datasets import Recording
from peaking.errors import CamerasNotFound
from peaking.frame import Frame
from peaking.geometry import Camera, Rigid
from peaking.poses.colmap import estimate_cameras, shrunk_for_features

Pose = tuple[float, ...]
"""`world_from_cam` in metres: the first three rows of its matrix, one after the other."""


@dataclass(frozen=True)
class Placement:
    """The frames of one recording as COLMAP placed them.

    Attributes:
        poses: In the recorded world, frame by frame; None where it could not tell.
        residual_m: Root mean square distance of the frames from where they were recorded.
    """

    poses: tuple[Pose | None, ...]
    residual_m: float

    @property
    def unplaced(self) -> list[int]:
        """Numbers of the frames that COLMAP could not place."""
        return [i for i, pose in enumerate(self.poses) if pose is None]

    def placed(self, frames: Sequence[int]) -> tuple[int, ...]:
        """Return those of some frames that COLMAP could place."""
        return tuple(i for i in frames if self.poses[i] is not None)

    @classmethod
    def read(cls, found: Mapping[str, Any]) -> Placement:
        """Make it again from its fields as JSON has them."""
        poses = tuple(None if pose is None else tuple(pose) for pose in found["poses"])
        return cls(poses, found["residual_m"])

    def at(self, frame: int) -> Pose:
        """Return where a frame was taken.

        Raises:
            ValueError: COLMAP could not place it.
        """
        pose = self.poses[frame]
        if pose is None:
            raise ValueError(f"need a frame that COLMAP placed, got {frame}")
        return pose

    def words(self) -> str:
        """Say how many frames were placed, how near to where they were recorded, and which not."""
        count = len(self.poses) - len(self.unplaced)
        text = (
            f"COLMAP placed {count} of {len(self.poses)} frames, "
            f"{100 * self.residual_m:.1f} cm (RMS) from where they were recorded"
        )
        if self.unplaced:
            text += f"; 3dgs neither trains on the other {len(self.unplaced)} nor is tested there"
        return text


def place(recording: Recording) -> Placement:
    """Let COLMAP say where all frames were taken; takes minutes.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        CamerasNotFound: COLMAP cannot join the pictures.
    """
    frames = [shrunk_for_features(recording.read(i)) for i in range(len(recording))]
    try:
        found = estimate_cameras(frames)
    except CamerasNotFound as error:
        raise CamerasNotFound(f"{recording.path}: {error}") from error
    return Placement(
        tuple(None if camera is None else pose_of(camera) for camera in found.cameras),
        found.residual_m,
    )


def pose_of(camera: Camera) -> Pose:
    """Return where a camera is, as plain data."""
    return tuple(camera.world_from_cam.matrix()[:3].ravel().tolist())


def at_pose(frame: Frame, pose: Pose) -> Frame:
    """Return the frame as if it had been taken from elsewhere."""
    matrix = np.eye(4)
    matrix[:3] = np.reshape(pose, (3, 4))
    camera = replace(frame.camera, world_from_cam=Rigid.from_matrix(matrix))
    return replace(frame, camera=camera)
