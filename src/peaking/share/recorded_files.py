"""The files of a recording's views, made one by one: photographs, multi-plane images, points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Float64

from peaking.datasets import Recording
from peaking.errors import PeakingError
from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera, near_origin_m
from peaking.options import Options
from peaking.share import pictures
from peaking.share.compact_mpi import WHOLE, Coding
from peaking.share.points import encode_points, seen_points
from peaking.share.sampling import evenly
from peaking.view_builder import ViewBuilder

FRAMES_OF_POINTS = 24
"""So many frames tell where surfaces are."""


class RecordedFiles:
    """What a place takes from a recording; a frame is read once for all that is made of it."""

    def __init__(self, recording: Recording, options: Options) -> None:
        """Read nothing yet.

        Raises:
            BackendUnavailable: The generator needs PyTorch, or CUDA, which is not there.
            CheckpointError: Its checkpoint is missing or cannot be used.
        """
        self.recording = recording
        self.options = options
        self.origin_m: Float64[np.ndarray, "3"] = near_origin_m(recording.cameras)
        self._builders = {options: ViewBuilder(options)}
        self._read = lru_cache(maxsize=1)(recording.read)

    @cached_property
    def usable(self) -> Sequence[int]:
        """Numbers of the frames of which multi-plane images can be made."""
        if self._builders[self.options].estimates_depth:
            return range(len(self.recording))
        return [i for i, has_depth in enumerate(self.recording.has_depth) if has_depth]

    @cached_property
    def has_points(self) -> bool:
        """Whether frames tell where surfaces are, by depth or by points."""
        return any(self.recording.has_depth) or self._read(0).points_m is not None

    def camera(self, index: int) -> Camera:
        """Return a frame's camera at the working size, in the place's world."""
        full = self.recording.cameras[index]
        size_px = working_size_px(*full.pinhole.size_px, pixels=self.options.pixels)
        return full.resized(*size_px).relative_to(self.origin_m)

    def photo(self, index: int) -> bytes:
        """Return a frame's photograph.

        Raises:
            RecordingError: It cannot be read.
        """
        return pictures.photo(self._read(index))

    def thumbnail(self, index: int) -> bytes:
        """Return a small one.

        Raises:
            RecordingError: It cannot be read.
        """
        return pictures.thumbnail(self._read(index))

    def mpi(self, index: int, coding: Coding = WHOLE) -> bytes:
        """Return a frame's multi-plane image, in the place's world.

        Raises:
            RecordingError: The frame cannot be read.
            PeakingError: No multi-plane image can be made of it.
        """
        frame = self._read(index)
        near = replace(
            frame,
            camera=frame.camera.relative_to(self.origin_m),
            points_m=None if frame.points_m is None else frame.points_m - self.origin_m,
        )
        options = coding.options(self.options)
        if options not in self._builders:
            self._builders[options] = ViewBuilder(options)
        made = self._builders[options].build(near)
        if not made.metric:
            raise PeakingError(
                f"{frame.name}: nothing tells how far away things are; record with depth, or give "
                "a point cloud (docs/generators.md)"
            )
        return coding.encode(made.mpi)

    def points(self, indices: Sequence[int]) -> bytes:
        """Return points that some of the frames saw.

        Raises:
            RecordingError: A frame cannot be read.
        """
        chosen = evenly(indices, FRAMES_OF_POINTS)
        return encode_points(seen_points(self.recording.read(i) for i in chosen), self.origin_m)

    def small_frame(self, index: int, pixels: int) -> Frame:
        """Return a frame of about so many pixels, in the place's world.

        Raises:
            RecordingError: It cannot be read.
        """
        frame = self._read(index)
        small = frame.resized(*working_size_px(*frame.camera.pinhole.size_px, pixels=pixels))
        return replace(small, camera=small.camera.relative_to(self.origin_m))
