"""What is true about a recording: its depth, what things are made of, what views have seen.

Of drawn scenes the truth is exact; of others it is the sensor's depth, where that was measured.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.benchmarks.trust import _visibility_kernels as visibility
from peaking.datasets import Recording, open_recording
from peaking.errors import RecordingError
from peaking.geometry import Cam, Camera, Rigid

EXACT_TOLERANCE = 0.005
"""How far a point may be behind (or before) what a view measured there and still be the same
surface, as a part of the depth. Exact depth is rounded to 1 mm, 0.1 % at 0.5 m; between samples
of the depth map planes are exact, and what is left is the curvature of small things."""

SENSOR_TOLERANCE = 0.04
"""The same for a sensor, whose noise, quantisation and poses all count. Depths of the same place in
two views less than 0.6 m apart, by nearest samples: of a handheld Kinect 92 % agree to 4 %, and
another 1 % to 6 %; of a HoloLens 98 % and 0.4 %; of a RealSense close up 89 % and 3 %. Beyond, the
shares grow evenly: what is left are edges and things hidden from one of the two."""

HELD_OUT_EVERY = 8
"""Of a recording that does not say which frames are for asking, every such frame is."""

CAPTURED_PART = 0.75
"""Of such a recording, this part of the path may be captured; what follows goes beyond it."""

VIEW, BETWEEN, BEYOND = "view", "between", "beyond"


@dataclass(frozen=True)
class TrustScene:
    """A recording, split into views and held-out frames, with the truth about both.

    Attributes:
        recording: Where the pictures are.
        views: Numbers of the frames that may be captured, in the order of the recording.
        held_out: Numbers of the frames that are asked about, with the group of each: "between" the
            views, "beside", "above" or "behind" them, or "beyond" the captured part of the path.
    """

    recording: Recording
    views: tuple[int, ...]
    held_out: Mapping[int, str]
    _depths_m: dict[int, Float32[np.ndarray, "_ _"]] = field(
        default_factory=dict[int, Float32[np.ndarray, "_ _"]], repr=False, compare=False
    )

    @property
    def is_exact(self) -> bool:
        """Whether the depth is exact: the scene is drawn."""
        return self.recording.true_depth_m(self.views[0]) is not None

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"]:
        """Return a frame's depth in metres: exact where there is such, else the sensor's.

        It covers the picture, at a size of its own; 0 is unknown: not measured, or mirror or
        glass. It is kept in memory: write nothing into it.

        Raises:
            RecordingError: A file of the frame cannot be used.
        """
        if index not in self._depths_m:
            depth_m = self.recording.true_depth_m(index)
            if depth_m is None:
                depth_m = self.recording.read(index).depth_m
            assert depth_m is not None  # frames without depth are neither views nor held out
            self._depths_m[index] = depth_m
        return self._depths_m[index]

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return the labels of a drawn scene (`Recording.materials`), at the picture's size."""
        return self.recording.materials(index)

    def camera(self, index: int) -> Camera:
        """Return a frame's camera at the size of its true depth."""
        height, width = self.true_depth_m(index).shape
        return self.recording.cameras[index].resized(width, height)

    def seen_truth(
        self, view_numbers: Sequence[int], index: int
    ) -> tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
        """Return which surface points of a frame are visible in at least one of some views.

        A point is visible where its depth in the view lies within those of the four depth samples
        around it, give or take `EXACT_TOLERANCE` or `SENSOR_TOLERANCE`.

        Args:
            view_numbers: Of frames of the recording.
            index: The frame that is asked about.

        Returns:
            At the size of its true depth: `seen`; and `known`, which is False where the frame or,
            at that point, the only views that might decide it have no depth, where a view looks
            through the point (it moved, or was measured wrongly), and along the border between
            seen and not seen, as far as one sample of the sensor's depth map.

        Raises:
            RecordingError: A file of the frames cannot be used.
        """
        depth_m = self.true_depth_m(index)
        camera = self.camera(index)
        rays = camera.pinhole.rays()
        state = np.zeros(depth_m.shape, np.uint8)
        tolerance = EXACT_TOLERANCE if self.is_exact else SENSOR_TOLERANCE
        for number in view_numbers:
            view = self.camera(number)
            view_from_here: Rigid[Cam, Cam] = view.world_from_cam.inverse() @ camera.world_from_cam
            visibility.add_view(
                state,
                depth_m,
                rays,
                view_from_here,
                view.pinhole,
                self.true_depth_m(number),
                tolerance,
            )
        seen = state == visibility.SEEN
        known = (depth_m > 0) & (state != visibility.UNDECIDED)
        return seen, known & ~_border(seen, known, self._sample_px(index))

    def _sample_px(self, index: int) -> int:
        """Return how many pixels of the true depth one sample of the sensor's depth covers."""
        sensor_px = self.recording.depth_size_px(index)
        if sensor_px is None:
            return 1
        height, width = self.true_depth_m(index).shape
        return max(1, math.ceil(width / sensor_px[0]), math.ceil(height / sensor_px[1]))


def open_trust_scene(root: Path) -> TrustScene:
    """Open a recording with depth and split it.

    A drawn scene says itself which frames are views (`group`). Of any other, the first three
    quarters of the frames may be captured, but every eighth of them is held out as "between";
    the last quarter is held out as "beyond".

    Raises:
        RecordingError: It cannot be opened, too few frames have depth, or a group is missing.
    """
    recording = open_recording(root)
    usable = [i for i in range(len(recording)) if recording.has_depth[i]]
    groups = {i: recording.group(i) for i in usable}
    named = {i: group for i, group in groups.items() if group is not None}
    if named and len(named) < len(groups):
        missing = next(i for i in groups if i not in named)
        raise RecordingError(
            recording.path,
            "is missing, and other frames have one",
            field=f"frames[{missing}].group",
            remedy='give every frame a group, "view" or what it is held out for',
        )
    if not named:
        captured = math.ceil(CAPTURED_PART * len(usable))
        named = {
            index: BEYOND if k >= captured else BETWEEN if k % HELD_OUT_EVERY == 4 else VIEW
            for k, index in enumerate(usable)
        }
    views = tuple(i for i, group in named.items() if group == VIEW)
    held_out = {i: group for i, group in named.items() if group != VIEW}
    if not views or not held_out:
        raise RecordingError(
            recording.path,
            f"has {len(usable)} frames with depth: {len(views)} views, {len(held_out)} held out",
            remedy="measure on a recording with at least 8 frames with depth",
        )
    return TrustScene(recording, views, held_out)


def _border(
    seen: Bool[np.ndarray, "h w"], known: Bool[np.ndarray, "h w"], radius_px: int
) -> Bool[np.ndarray, "h w"]:
    """Return what has both seen and not seen points within `radius_px` (a square)."""
    around = np.ones((2 * radius_px + 1, 2 * radius_px + 1), np.uint8)
    near_seen = cv2.dilate((seen & known).astype(np.uint8), around)
    near_unseen = cv2.dilate((~seen & known).astype(np.uint8), around)
    return np.logical_and(near_seen, near_unseen)
