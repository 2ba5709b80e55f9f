"""The whole method on one screen.

    frame ── complete ── generate ── align ──► Mpi in metres ──► views        add_view()
                                                                  │ nearest K
    live picture + camera ──────────────► render each, blend ◄────┘           see()
                             └──────────► compare ──► peaks

>>> scene = LocalLightField(PRESETS["default"])
>>> scene.add_view(frame)                      # the shutter
>>> seen = scene.see(live.rgb, live.camera)    # every frame of the video
>>> seen.errors.peaked_share
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.align import align
from peaking.depth import complete
from peaking.depth.estimator import DepthEstimator, estimator_named
from peaking.error_map import Comparison, ErrorMap, compare
from peaking.errors import NothingToAlign, PeakingError
from peaking.frame import Frame, working_size_px
from peaking.generate import Generator
from peaking.generate.by_name import generator_named
from peaking.geometry import Camera
from peaking.metric_depth import Captured, estimate_depth
from peaking.mpi import Mpi
from peaking.nearest import Neighbour, nearest_by_distance, nearest_by_overlap
from peaking.presets import DEFAULT, Options
from peaking.render import Rendering, render
from peaking.render.blend import blend
from peaking.timing import Stopwatch

LEAST_SAMPLES = 1000
"""Of a sensor. Fewer are not completed where depth can be estimated, but tell its scale."""


@dataclass(frozen=True)
class Seen:
    """What the photographer is shown at one moment.

    Attributes:
        view: The scene as the captured views know it.
        errors: Where that differs from the live picture.
        neighbours: The captured views it was made from.
    """

    view: Rendering
    errors: ErrorMap
    neighbours: tuple[Neighbour, ...]


def neighbours_of(
    cameras: Sequence[Camera], target: Camera, options: Options, *, mpi_of: Callable[[int], Mpi]
) -> tuple[Neighbour, ...]:
    """Choose the views to show a target by, and their weights.

    Args:
        cameras: Where the views were taken.
        target: The camera to render for.
        options: How.
        mpi_of: The MPI of a view, by its number; is asked for one at most.

    Raises:
        ValueError: There is no view.
    """
    if options.weights == "paper":
        return nearest_by_distance(cameras, target, count=options.neighbours)
    closest = nearest_by_distance(cameras, target, count=1)[0]
    scene_depth_m = float(np.median(mpi_of(closest.index).plane_depths_m))
    return nearest_by_overlap(cameras, target, scene_depth_m, count=options.neighbours)


class LocalLightField:
    """The captured views, each an MPI in metres at the pose where it was photographed."""

    def __init__(
        self,
        options: Options = DEFAULT,
        *,
        stopwatch: Stopwatch | None = None,
        generator: Generator | None = None,
        estimator: DepthEstimator | None = None,
    ) -> None:
        """Begin without a view.

        Args:
            options: How.
            stopwatch: Takes the time of every stage.
            generator: Of MPIs; else the one that the options name.
            estimator: Of the depth of frames without; else the one that the options name.

        Raises:
            BackendUnavailable: The generator needs PyTorch, or CUDA, which is not there.
            CheckpointError: Its weights are missing or cannot be used.
        """
        self.options = options
        self.stopwatch = stopwatch or Stopwatch(time.perf_counter)
        self.views: list[Mpi] = []
        self.guessed: set[int] = set()
        """Numbers of the views whose scale is a guess, until a neighbour aligns them."""
        self._captured: list[Captured] = []
        self._estimator = estimator
        if estimator is None and options.depth_model is not None:
            self._estimator = estimator_named(
                options.depth_model, device=options.device, runtime=options.depth_runtime
            )
        self._generate = generator or generator_named(
            options.generator, num_planes=options.num_planes, learned=options.learned
        )
        self._buffers: tuple[Float32[np.ndarray, "k h w 4"], Float32[np.ndarray, "k h w"]] | None
        self._buffers = None

    def prepare(self, frame: Frame) -> Frame:
        """Return the frame at the size that MPIs and views have here."""
        return frame.resized(
            *working_size_px(*frame.camera.pinhole.size_px, pixels=self.options.pixels)
        )

    def takes(self, frame: Frame) -> bool:
        """Return whether a frame can become a view: it has depth, or depth can be estimated."""
        return frame.depth_m is not None or self._estimator is not None

    def add_view(self, frame: Frame) -> Mpi:
        """Make a captured frame part of the reconstruction.

        With a depth model, frames without depth are welcome; one that nothing is known about is
        `guessed` until a later view aligns it.

        Raises:
            PeakingError: The frame has no metric depth, and there is no depth model.
        """
        if self._estimator is None:
            self.views.append(self.mpi_of(frame))
            return self.views[-1]
        captured = self.captured(frame, self._captured)
        self.views.append(captured.mpi)
        self._captured.append(captured)
        if not captured.metric:
            self.guessed.add(len(self.views) - 1)
        for number in sorted(self.guessed - {len(self.views) - 1}):
            self._align_again(number)
        return self.views[-1]

    def captured(self, frame: Frame, others: Sequence[Captured] = ()) -> Captured:
        """Return a frame with its MPI, without keeping it.

        Where depth is missing or sparse, and there is an estimator, it is estimated.

        Raises:
            PeakingError: The frame has no metric depth, and there is no depth model.
        """
        samples = 0 if frame.depth_m is None else int((frame.depth_m > 0).sum())
        if samples >= LEAST_SAMPLES or self._estimator is None:
            return Captured(self.prepare(frame), self.mpi_of(frame), metric=True)
        with self.stopwatch.stage("prepare"):
            small = self.prepare(frame)
        with self.stopwatch.stage("estimate"):
            estimated = estimate_depth(small, self._estimator, others)
        with self.stopwatch.stage("generate"):
            mpi = self._generate(small.rgb, estimated.depth_m, small.camera)
        return Captured(small, mpi, metric=estimated.fit is not None)

    def mpi_of(self, frame: Frame) -> Mpi:
        """Return the MPI of a frame with depth, in metres, without keeping it.

        Raises:
            PeakingError: The frame has no metric depth.
        """
        if frame.depth_m is None:
            raise PeakingError(
                f"{frame.name}: no metric depth; record with depth (ARCore, LiDAR, RGB-D camera), "
                "or have it estimated: --depth-model"
            )
        with self.stopwatch.stage("prepare"):
            small = self.prepare(frame)
        with self.stopwatch.stage("complete"):
            depth_m = complete(frame.depth_m, small.rgb)
        with self.stopwatch.stage("generate"):
            mpi = self._generate(small.rgb, depth_m, small.camera)
        if self.options.align == "off":
            return mpi
        with self.stopwatch.stage("align"):
            try:
                scale = align(mpi, frame.depth_m, method=self.options.align).scale
            except NothingToAlign as error:
                raise NothingToAlign(f"{frame.name}: {error}") from error
            return mpi.scaled(scale)

    def see(self, live: UInt8[np.ndarray, "h w 3"], camera: Camera) -> Seen:
        """Render the scene for a live picture of the working size, and compare.

        Raises:
            ValueError: No view was captured yet, or the sizes differ.
        """
        view, neighbours = self.view_from(camera)
        return Seen(view, self.errors_of(view, live), neighbours)

    def errors_of(self, view: Rendering, live: UInt8[np.ndarray, "h w 3"]) -> ErrorMap:
        """Compare a view with a live picture.

        Raises:
            ValueError: The sizes differ.
        """
        comparison = Comparison(
            threshold=self.options.error_threshold,
            shift_px=self.options.shift_px,
            compensate_exposure=self.options.compensate_exposure,
        )
        with self.stopwatch.stage("compare"):
            return compare(view, live, comparison)

    def view_from(self, camera: Camera) -> tuple[Rendering, tuple[Neighbour, ...]]:
        """Render the scene from anywhere.

        Raises:
            ValueError: No view was captured yet.
        """
        with self.stopwatch.stage("nearest"):
            neighbours = self._nearest(camera)
        return self.shown_by(neighbours, camera), neighbours

    def shown_by(self, neighbours: Sequence[Neighbour], camera: Camera) -> Rendering:
        """Render the scene from anywhere, as given views show it."""
        with self.stopwatch.stage("render"):
            rgba, depth_m = self._buffers_for(len(neighbours), camera)
            for k, neighbour in enumerate(neighbours):
                render(self.views[neighbour.index], camera, out=(rgba[k], depth_m[k]))
        with self.stopwatch.stage("blend"):
            weights = [neighbour.weight for neighbour in neighbours]
            return blend(rgba, depth_m, weights, opacity=self.options.opacity)

    def _align_again(self, number: int) -> None:
        """Give a guessed view its place in metres, if other views now say where."""
        others = [other for i, other in enumerate(self._captured) if i != number]
        captured = self.captured(self._captured[number].frame, others)
        if captured.metric:
            self._captured[number] = captured
            self.views[number] = captured.mpi
            self.guessed.discard(number)

    def _nearest(self, camera: Camera) -> tuple[Neighbour, ...]:
        """Choose views; guessed ones only while there is no other."""
        usable = [i for i in range(len(self.views)) if i not in self.guessed]
        usable = usable or list(range(len(self.views)))
        return tuple(
            replace(neighbour, index=usable[neighbour.index])
            for neighbour in self._nearest_of([self.views[i] for i in usable], camera)
        )

    def _nearest_of(self, views: Sequence[Mpi], camera: Camera) -> tuple[Neighbour, ...]:
        return neighbours_of(
            [view.camera for view in views], camera, self.options, mpi_of=views.__getitem__
        )

    def _buffers_for(
        self, count: int, camera: Camera
    ) -> tuple[Float32[np.ndarray, "k h w 4"], Float32[np.ndarray, "k h w"]]:
        """Return scratch for `count` renderings; made once, so that frames allocate little."""
        width, height = camera.pinhole.size_px
        if self._buffers is None or self._buffers[1].shape[1:] != (height, width):
            most = self.options.neighbours
            self._buffers = (
                np.empty((most, height, width, 4), np.float32),
                np.empty((most, height, width), np.float32),
            )
        return self._buffers[0][:count], self._buffers[1][:count]
