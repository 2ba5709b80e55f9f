"""Replay with a guide: scan the recording first, then capture the frames at the targets.

The recorded path decides what can be reached: a target without a frame within its tolerance stays
open, and how many there are is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from peaking.datasets import Recording
from peaking.errors import RecordingError
from peaking.frame import working_size_px
from peaking.geometry import Camera
from peaking.guidance.guide import Guide, Tolerance
from peaking.guidance.hemisphere_guide import hemisphere
from peaking.guidance.planes import plane_stack
from peaking.guidance.plenoptic import PlenopticBound, plenoptic_grid
from peaking.guidance.scan import DepthScan, middle_depth_m
from peaking.options import Options

GuideKind = Literal["plenoptic", "planes", "hemisphere"]

MAX_TARGETS = 20_000
"""A scene that is too near for its area asks for more than anyone can take."""


@dataclass(frozen=True, kw_only=True)
class GuideOptions:
    """Which guide, and how."""

    kind: GuideKind
    area_side_m: float = 0.15
    """Side of the square in which views are taken."""
    near_m: float | None = None
    """How near is near enough; without it, what follows from the spacing."""
    angle_deg: float = 10.0
    """Largest angle between viewing directions."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.area_side_m) and self.area_side_m > 0):
            raise ValueError(f"need area_m > 0, got {self.area_side_m}")
        if self.near_m is not None and not (math.isfinite(self.near_m) and self.near_m > 0):
            raise ValueError(f"need near_m > 0, got {self.near_m}")
        if not 0 < self.angle_deg <= 90:
            raise ValueError(f"need 0 < angle_deg <= 90, got {self.angle_deg}")


@dataclass(frozen=True)
class GuidedWalk:
    """What a guide asks of a recording, and which frames answer it."""

    guide: Guide
    bound: PlenopticBound
    target_of_frame: dict[int, int]
    """The frames to capture, each with the target that it takes."""

    def as_dict(self) -> dict[str, object]:
        """Return it as it is written into reports."""
        near = self.guide.near_enough
        return {
            "targets": len(self.guide.targets),
            "reached": len(self.target_of_frame),
            "z_min_m": self.bound.z_min_m,
            "area_side_m": self.bound.area_side_m,
            "spacing_m": self.bound.spacing_m,
            "num_views": self.bound.num_views,
            "pitch_m": self.bound.pitch_m,
            "position_tolerance_m": near.position_m,
            "direction_tolerance_deg": math.degrees(near.direction_rad),
        }


def guided_walk(
    recording: Recording, choice: GuideOptions, *, num_frames: int, options: Options
) -> GuidedWalk:
    """Scan the first frames of a recording, place a guide in the middle of its path, choose frames.

    The anchor is the camera with the least sum of distances to all others. Pairs of a target and a
    frame within the tolerance are taken from the nearest on; each counts once.

    Raises:
        RecordingError: The depth of the scene is not known, or no target can be reached.
    """
    scan = DepthScan()
    middle_m: dict[int, float | None] = {}
    for index in range(num_frames):
        depth_m = recording.read(index).depth_m
        if depth_m is not None:
            scan.add(depth_m)
            middle_m[index] = middle_depth_m(depth_m)
    z_min_m = scan.z_min_m
    if z_min_m is None:
        raise _refused(
            recording,
            f"{scan.frames} of {num_frames} frames have enough depth, and a scan needs "
            f"{scan.confirmations}",
            "replay a recording with depth, or without --guide",
        )
    cameras = {index: recording.cameras[index] for index in middle_m}
    anchor = _middle_of(cameras)
    bound = PlenopticBound.of_camera(
        cameras[anchor].pinhole.resized(
            *working_size_px(*cameras[anchor].pinhole.size_px, pixels=options.pixels)
        ),
        z_min_m,
        area_side_m=choice.area_side_m,
        num_planes=options.num_planes,
    )
    if bound.views_per_side**2 > MAX_TARGETS:
        raise _refused(
            recording,
            f"the nearest thing, {z_min_m:.3f} m away, asks for {bound.views_per_side**2} views",
            "choose a smaller --area-m",
        )
    guide = _guide_of(choice, bound, cameras[anchor], middle_m[anchor] or z_min_m)
    chosen = _frames_of_targets(guide, cameras)
    if not chosen:
        raise _refused(
            recording,
            f"no frame is within {100 * guide.near_enough.position_m:.1f} cm and "
            f"{choice.angle_deg:g}° of one of {len(guide.targets)} targets",
            "choose a larger --near-m, --angle-deg or --area-m",
        )
    return GuidedWalk(guide, bound, chosen)


def _guide_of(
    choice: GuideOptions, bound: PlenopticBound, anchor: Camera, radius_m: float
) -> Guide:
    pose = anchor.world_from_cam
    if choice.kind == "plenoptic":
        guide = plenoptic_grid(pose, bound)
    elif choice.kind == "planes":
        guide = plane_stack(pose, bound)
    else:
        guide = hemisphere(pose, radius_m)
    near = Tolerance(
        position_m=choice.near_m or guide.near_enough.position_m,
        direction_rad=math.radians(choice.angle_deg),
    )
    return Guide(guide.targets, near)


def _middle_of(cameras: dict[int, Camera]) -> int:
    """Return the frame whose camera has the least sum of distances to the others."""
    indices = list(cameras)
    positions_m = np.array([cameras[index].position_m for index in indices])
    sums_m = [np.linalg.norm(positions_m - position_m, axis=1).sum() for position_m in positions_m]
    return indices[int(np.argmin(sums_m))]


def _frames_of_targets(guide: Guide, cameras: dict[int, Camera]) -> dict[int, int]:
    """Return for each frame that is to be captured the target that it takes."""
    target_m = np.array([target.translation_m for target in guide.targets])
    target_forward = np.array([target.rotation[:, 2] for target in guide.targets])
    near = guide.near_enough
    pairs: list[tuple[float, int, int]] = []
    for index, camera in cameras.items():
        distance_m = np.linalg.norm(target_m - camera.position_m, axis=1)
        chord = np.linalg.norm(target_forward - camera.forward, axis=1)
        angle_rad = 2 * np.arcsin(np.minimum(chord / 2, 1.0))
        fits = (distance_m <= near.position_m) & (angle_rad <= near.direction_rad)
        pairs += [(float(distance_m[t]), index, int(t)) for t in np.flatnonzero(fits)]
    chosen: dict[int, int] = {}
    taken: set[int] = set()
    for _, index, target in sorted(pairs):
        if index not in chosen and target not in taken:
            chosen[index] = target
            taken.add(target)
    return chosen


def _refused(recording: Recording, problem: str, remedy: str) -> RecordingError:
    return RecordingError(recording.path, problem, remedy=remedy)
