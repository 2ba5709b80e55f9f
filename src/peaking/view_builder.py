"""From a frame to a view of the light field.

    frame ── resize ──► complete or estimate depth ── generate ──► align scale ──► CapturedView

Replay, evaluation and the live server all make their views here. It has no state: what is known of
other views is handed in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float32

from peaking.depth import complete
from peaking.depth.estimator import DepthEstimator
from peaking.depth.registry import create_estimator
from peaking.errors import NothingToAlign, PeakingError
from peaking.frame import Frame, working_size_px
from peaking.generators import Generator
from peaking.generators.registry import create_generator
from peaking.metric_depth import CapturedView, estimate_depth
from peaking.mpi import Mpi
from peaking.options import DEFAULT, Options
from peaking.scale_alignment import align_scale
from peaking.timing import Stopwatch

MIN_SAMPLES = 1000
"""Of a sensor. Fewer are not completed where depth can be estimated, but tell its scale."""


class ViewBuilder:
    """Builds views as the options say."""

    def __init__(
        self,
        options: Options = DEFAULT,
        *,
        stopwatch: Stopwatch | None = None,
        generator: Generator | None = None,
        estimator: DepthEstimator | None = None,
    ) -> None:
        """Load what the options name.

        Args:
            options: How views are built.
            stopwatch: Takes the time of every stage.
            generator: Of MPIs; else the one that the options name.
            estimator: Of the depth of frames without; else the one that the options name.

        Raises:
            BackendUnavailable: The generator needs PyTorch, or CUDA, which is not there.
            CheckpointError: Its checkpoint is missing or cannot be used.
        """
        self.options = options
        self._stopwatch = stopwatch or Stopwatch()
        self._estimator = estimator
        if estimator is None and options.depth_model is not None:
            self._estimator = create_estimator(
                options.depth_model, device=options.device, runtime=options.depth_runtime
            )
        self._generate = generator or create_generator(options)

    @property
    def estimates_depth(self) -> bool:
        """Whether frames without depth are welcome."""
        return self._estimator is not None

    def with_pixels(self, pixels: int) -> ViewBuilder:
        """Return a builder of views with about so many pixels, by the same networks."""
        return ViewBuilder(
            replace(self.options, pixels=pixels, depth_model=None),
            stopwatch=self._stopwatch,
            generator=self._generate,
            estimator=self._estimator,
        )

    def prepare(self, frame: Frame) -> Frame:
        """Return the frame at the size that MPIs and renderings have."""
        return frame.resized(
            *working_size_px(*frame.camera.pinhole.size_px, pixels=self.options.pixels)
        )

    def accepts(self, frame: Frame) -> bool:
        """Return whether a frame can become a view: it has depth, or depth can be estimated."""
        return frame.depth_m is not None or self.estimates_depth

    def build(self, frame: Frame, others: Sequence[CapturedView] = ()) -> CapturedView:
        """Build the view of a frame.

        Where depth is missing or sparse, and there is an estimator, it is estimated.

        Args:
            frame: At any size.
            others: Views around it, which may tell the scale of estimated depth.

        Raises:
            PeakingError: The frame has no metric depth, and there is no depth model.
        """
        samples = 0 if frame.depth_m is None else int((frame.depth_m > 0).sum())
        if samples >= MIN_SAMPLES or self._estimator is None:
            return CapturedView(self.prepare(frame), self.generate(frame), metric=True)
        with self._stopwatch.stage("prepare"):
            small = self.prepare(frame)
        with self._stopwatch.stage("estimate"):
            estimated = estimate_depth(small, self._estimator, others)
        with self._stopwatch.stage("generate"):
            mpi = self._made(small, estimated.depth_m)
        return CapturedView(small, mpi, metric=estimated.fit is not None)

    def rebuild_guessed(self, frame: Frame, others: Sequence[CapturedView]) -> CapturedView | None:
        """Build a view whose scale was a guess anew; None if the others do not tell its scale.

        Raises:
            PeakingError: The frame has no metric depth, and there is no depth model.
        """
        view = self.build(frame, others)
        return view if view.metric else None

    def _made(self, small: Frame, depth_m: Float32[np.ndarray, "h w"]) -> Mpi:
        mpi = self._generate(small.rgb, depth_m, small.camera)
        return mpi if small.mask is None else mpi.masked(small.mask)

    def generate(self, frame: Frame) -> Mpi:
        """Return the MPI of a frame with depth, in metres.

        Raises:
            PeakingError: The frame has no metric depth.
        """
        if frame.depth_m is None:
            raise PeakingError(
                f"{frame.name}: no metric depth; record with depth (ARCore, LiDAR, RGB-D camera), "
                "or have it estimated: --depth-model"
            )
        with self._stopwatch.stage("prepare"):
            small = self.prepare(frame)
        with self._stopwatch.stage("complete"):
            depth_m = complete(frame.depth_m, small.rgb)
        with self._stopwatch.stage("generate"):
            mpi = self._made(small, depth_m)
        if self.options.align == "off":
            return mpi
        with self._stopwatch.stage("align"):
            try:
                scale = align_scale(mpi, frame.depth_m, method=self.options.align).scale
            except NothingToAlign as error:
                raise NothingToAlign(f"{frame.name}: {error}") from error
            return mpi.scaled(scale)


def generate(frame: Frame, options: Options = DEFAULT) -> Mpi:
    """Return the MPI of one frame, in metres if its depth is, or if it can be estimated so.

    Args:
        frame: A picture with its camera and metric depth; without depth, the options name a depth
            model, and without anything else that is known the scale is a guess.
        options: How it is generated.

    Raises:
        PeakingError: The frame has no metric depth, and there is no depth model.
        BackendUnavailable: What the options name needs PyTorch, or CUDA, which is not there.
        CheckpointError: Its checkpoint is missing or cannot be used.
    """
    return ViewBuilder(options).build(frame).mpi
