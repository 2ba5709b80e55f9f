"""A recording as strategies and reconstructions see it: small frames, MPIs that are made once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from peaking.datasets.nerfstudio import Recording
from peaking.frame import Frame
from peaking.generate.by_name import generator_named
from peaking.geometry import Camera
from peaking.mpi import Mpi
from peaking.pipeline import LocalLightField
from peaking.presets import Options

MOST_MPIS = 160
"""MPIs that are kept at once; at the paper's size they take 0.6 GB."""

MOST_FRAMES = 400
"""Pictures that are kept at once; at the paper's size they take 0.23 GB."""

UNKNOWN_DEPTH_M = 1.0
"""What counts as the depth of a scene that was recorded without."""

SAMPLED = 16
"""So many frames tell how deep a scene is."""


class Scene:
    """Frames at the working size, and their MPIs."""

    def __init__(
        self, recording: Recording, options: Options, *, most_mpis: int = MOST_MPIS
    ) -> None:
        """Look at a recording with the method's options."""
        self.recording = recording
        self.options = options
        self._generator = generator_named(
            options.generator, num_planes=options.num_planes, learned=options.learned
        )
        self._prepare = LocalLightField(options, generator=self._generator)
        self.frame = lru_cache(maxsize=MOST_FRAMES)(self._frame)
        self.mpi = lru_cache(maxsize=most_mpis)(self._mpi)

    def __len__(self) -> int:
        return len(self.recording)

    @cached_property
    def with_depth(self) -> Sequence[int]:
        """Numbers of the frames that have depth, so that an MPI can be made of them."""
        return [i for i, view in enumerate(self.recording.views) if view.depth is not None]

    @cached_property
    def cameras(self) -> Sequence[Camera]:
        """Cameras at the working size, in the order of the recording."""
        size_px = self.frame(0).camera.pinhole.size_px if len(self) else (1, 1)
        full_px = self.recording.cameras[0].pinhole.size_px
        if all(camera.pinhole.size_px == full_px for camera in self.recording.cameras):
            return [camera.resized(*size_px) for camera in self.recording.cameras]
        return [self.frame(i).camera for i in range(len(self))]

    @cached_property
    def depth_m(self) -> float:
        """How far away things typically are: the median of measured depths."""
        some = np.linspace(0, len(self.with_depth) - 1, SAMPLED).round().astype(int)
        measured: list[float] = []
        for i in sorted({self.with_depth[k] for k in some if self.with_depth}):
            depth_m = self.recording.read(i).depth_m
            if depth_m is not None and (depth_m > 0).any():
                measured.append(float(np.median(depth_m[depth_m > 0])))
        return float(np.median(measured)) if measured else UNKNOWN_DEPTH_M

    def light_field(self, views: Sequence[int]) -> LocalLightField:
        """Return the local light field of some views."""
        field = LocalLightField(self.options, generator=self._generator)
        field.views = [self.mpi(i) for i in views]
        return field

    def _frame(self, index: int) -> Frame:
        """Read a frame and make it small; its depth is left out, which would take the most room."""
        return replace(self._prepare.prepare(self.recording.read(index)), depth_m=None)

    def _mpi(self, index: int) -> Mpi:
        return self._prepare.mpi_of(self.recording.read(index))
