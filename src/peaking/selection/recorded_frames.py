"""The frames of a recording at the working size, and their MPIs, each made once."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

import peaking
from peaking.datasets import Recording
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.light_field import (
    Scratch,
    choose_views,
    compare_with,
    fill_holes,
    render_views,
)
from peaking.mpi import Mpi
from peaking.options import DEFAULT, Options
from peaking.rendering import Rendering
from peaking.selection.blur import sharpness
from peaking.selection.mpi_files import MpiFiles
from peaking.selection.policy import CandidatePath
from peaking.selection.registry import SelectionOptions, select_from
from peaking.timing import Stopwatch
from peaking.view_builder import ViewBuilder
from peaking.view_weights import Neighbour

MAX_MPIS = 48
"""MPIs that are in memory at once; at the paper's size they take 0.2 GB."""

MAX_FRAMES = 400
"""Pictures that are kept at once; at the paper's size they take 0.23 GB."""

MAX_SHARES = 100_000
"""Peaked shares that are remembered, so that no walk looks again at what another saw."""

UNKNOWN_DEPTH_M = 1.0
"""What counts as the depth of a scene that was recorded without."""

SAMPLED = 16
"""So many frames tell how deep a scene is."""


class RecordedFrames:
    """Frames at the working size, and their MPIs."""

    def __init__(
        self,
        recording: Recording,
        options: Options,
        *,
        max_mpis: int = MAX_MPIS,
        shared: Path | None = None,
        clock_s: Callable[[], float] = time.process_time,
        read: Callable[[int], Frame] | None = None,
    ) -> None:
        """Look at a recording with the method's options.

        Args:
            recording: What to look at.
            options: How.
            max_mpis: So many are in memory at once.
            shared: Folder for MPIs that other processes make or need too; none: those that are not
                in memory are made again.
            clock_s: Of the stages.
            read: Returns a frame of the recording; none: as it does, each frame once in a row.
        """
        self.stopwatch = Stopwatch(clock_s)
        """Takes the processor time of reading, generating and rendering; not that of the rest."""
        self.mpis_made = 0
        self._max_mpis = max_mpis
        self._other_sizes: dict[int, RecordedFrames] = {}
        self._shared = shared
        self._clock_s = clock_s
        self._files = None if shared is None else MpiFiles(shared / _name_of(options))
        self.recording = recording
        self.options = options
        self._read = lru_cache(maxsize=1)(recording.read) if read is None else read
        self._builder = ViewBuilder(options)
        self._scratch = Scratch()
        self.frame = lru_cache(maxsize=MAX_FRAMES)(self._frame)
        self.mpi = lru_cache(maxsize=max_mpis)(self._mpi)
        self.sharpness = lru_cache(maxsize=MAX_SHARES)(self._sharpness)
        self.peaked_share = lru_cache(maxsize=MAX_SHARES)(self._peaked_share)

    def __len__(self) -> int:
        return len(self.recording)

    @cached_property
    def with_depth(self) -> Sequence[int]:
        """Numbers of the frames that have depth, so that an MPI can be made of them."""
        return [i for i, has_depth in enumerate(self.recording.has_depth) if has_depth]

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
        for i in sorted({self.with_depth[int(k)] for k in some if self.with_depth}):
            depth_m = self.recording.read(i).depth_m
            if depth_m is not None and (depth_m > 0).any():
                measured.append(float(np.median(depth_m[depth_m > 0])))
        return float(np.median(measured)) if measured else UNKNOWN_DEPTH_M

    def path(self, numbers: Sequence[int]) -> CandidatePath:
        """Return some frames as the candidates of a policy."""
        return CandidatePath([RecordedCandidate(self, i) for i in numbers], self.depth_m)

    def with_pixels(self, pixels: int) -> RecordedFrames:
        """Return the frames and MPIs with about so many pixels; the same object each time."""
        if pixels == self.options.pixels:
            return self
        if pixels not in self._other_sizes:
            # So many times more of smaller MPIs are in memory: all of them, as a rule.
            smaller = max(1, self.options.pixels // pixels)
            self._other_sizes[pixels] = RecordedFrames(
                self.recording,
                replace(self.options, pixels=pixels),
                max_mpis=smaller * self._max_mpis,
                shared=self._shared,
                clock_s=self._clock_s,
                read=self._read,
            )
        return self._other_sizes[pixels]

    def neighbours(self, views: Sequence[int], camera: Camera) -> tuple[Neighbour, ...]:
        """Return which of some views a camera is shown by, with their numbers in the recording."""
        found = choose_views(
            [self.cameras[i] for i in views],
            camera,
            self.options,
            get_mpi=lambda k: self.mpi(views[k]),
        )
        return tuple(replace(neighbour, index=views[neighbour.index]) for neighbour in found)

    def render(self, views: Sequence[int], camera: Camera) -> Rendering:
        """Render what some views show."""
        neighbours = self.neighbours(views, camera)
        mpis = [self.mpi(neighbour.index) for neighbour in neighbours]
        weights = [neighbour.weight for neighbour in neighbours]
        with self.stopwatch.stage("rendering"):
            blended = render_views(
                mpis, weights, camera, opacity=self.options.opacity, scratch=self._scratch
            )
            rendering, _ = fill_holes(
                blended,
                [self.cameras[i] for i in views],
                camera,
                self.options,
                neighbours=[
                    replace(neighbour, index=list(views).index(neighbour.index))
                    for neighbour in neighbours
                ],
                get_mpi=lambda k: self.mpi(views[k]),
            )
        return rendering

    def take_costs(self) -> tuple[dict[str, float], int]:
        """Return milliseconds by stage, and how many MPIs were made, since the last time."""
        stages_ms, made = self.stopwatch.take(), self.mpis_made
        self.mpis_made = 0
        for others in self._other_sizes.values():
            its_ms, its_made = others.take_costs()
            for stage, ms in its_ms.items():
                stages_ms[stage] = stages_ms.get(stage, 0.0) + ms
            made += its_made
        return stages_ms, made

    def _peaked_share(self, index: int, views: tuple[int, ...]) -> float:
        """Return how much of a frame is red where these views show it."""
        frame = self.frame(index)
        rendering = self.render(views, frame.camera)
        return compare_with(self.options, rendering, frame.rgb).within(frame.mask).peaked_share

    def _sharpness(self, index: int) -> float:
        return sharpness(self.frame(index).rgb)

    def _frame(self, index: int) -> Frame:
        """Read a frame and make it small; its depth is left out, which would take the most room."""
        with self.stopwatch.stage("reading"):
            return replace(self._builder.prepare(self._read(index)), depth_m=None)

    def _mpi(self, index: int) -> Mpi:
        if self._files is None:
            return self._made(index)
        with self.stopwatch.stage("reading"):
            kept = self._files.read(index)
        return self._files.get(index, lambda: self._made(index)) if kept is None else kept

    def _made(self, index: int) -> Mpi:
        with self.stopwatch.stage("reading"):
            frame = self._read(index)
        self.mpis_made += 1
        with self.stopwatch.stage("generating"):
            return self._builder.generate(frame)


@dataclass(frozen=True)
class RecordedCandidate:
    """A frame of a recording as a policy sees it (`policy.Candidate`)."""

    frames: RecordedFrames
    number: int

    @property
    def camera(self) -> Camera:
        """Its camera at the working size."""
        return self.frames.cameras[self.number]

    @property
    def accepted(self) -> bool:
        """Whether it has depth, or none has and there are only poses to go by."""
        return self.frames.recording.has_depth[self.number] or not self.frames.with_depth

    def sharpness(self) -> float:
        """How sharp it is at the working size."""
        return self.frames.sharpness(self.number)

    def frame(self, pixels: int) -> Frame:
        """Return the picture and its camera with about so many pixels."""
        return self.frames.with_pixels(pixels).frame(self.number)

    def mpi(self, pixels: int) -> Mpi:
        """Return its MPI with about so many pixels."""
        return self.frames.with_pixels(pixels).mpi(self.number)

    def peaked_share(self, views: Sequence[int]) -> float:
        """Return how much of it is red, 0…1, where these views show it."""
        return self.frames.peaked_share(self.number, tuple(views))


def select(
    recording: Recording,
    num_views: int | None = None,
    *,
    selection: SelectionOptions | None = None,
    options: Options = DEFAULT,
) -> list[int]:
    """Return the numbers of the frames of a recording that a policy chooses.

    Args:
        recording: What to choose from; frames without depth are left out where any has it.
        num_views: How many to choose by our own policy, unless `selection` says otherwise.
        selection: Which policy, and by what it goes.
        options: How views are built, rendered and compared.

    Raises:
        ValueError: What the policy goes by is missing, or there are too few frames.
        RecordingError: A frame cannot be read.
    """
    frames = RecordedFrames(recording, options)
    usable = list(frames.with_depth) or list(range(len(frames)))
    chosen = selection or SelectionOptions("peaking", num_views=num_views)
    return select_from(frames.path(usable), chosen, options)


def _name_of(options: Options) -> str:
    """Return a name that changes with everything that an MPI depends on."""
    text = json.dumps({"version": peaking.__version__, **options.as_dict()}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
