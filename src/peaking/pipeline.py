"""The whole method on one screen.

    frame ── view_builder ──► CapturedView ──► views                             add_view()
                                                │ light_field: nearest K
    live picture + camera ──► render each, blend ──► compare ──► peaks           compare()
              ▲ tracking: where it was really taken ──┘

>>> scene = Reconstruction()
>>> scene.add_view(frame)                          # the shutter
>>> seen = scene.compare(live.rgb, live.camera)    # every frame of the video
>>> seen.errors.peaked_share
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.depth.estimator import DepthEstimator
from peaking.frame import Frame
from peaking.generators import Generator
from peaking.geometry import Camera
from peaking.light_field import Comparison, LightField, Scratch
from peaking.memory import Memory
from peaking.metric_depth import CapturedView
from peaking.mpi import Mpi
from peaking.options import DEFAULT, Options
from peaking.rendering import Rendering
from peaking.timing import Stopwatch
from peaking.tracking import refine
from peaking.view_builder import ViewBuilder


class Reconstruction:
    """The views captured so far, and what they show."""

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
            options: How views are built, shown and compared.
            stopwatch: Takes the time of every stage.
            generator: Of MPIs; else the one that the options name.
            estimator: Of the depth of frames without; else the one that the options name.

        Raises:
            BackendUnavailable: The generator needs PyTorch, or CUDA, which is not there.
            CheckpointError: Its checkpoint is missing or cannot be used.
        """
        self.options = options
        self.views: list[CapturedView] = []
        self._stopwatch = stopwatch or Stopwatch()
        self.builder = ViewBuilder(
            options, stopwatch=self._stopwatch, generator=generator, estimator=estimator
        )
        self._memory = Memory()
        self._scratch = Scratch()
        self._small_scratch = Scratch()

    @property
    def light_field(self) -> LightField:
        """The views as they are now."""
        mpis = tuple(view.mpi for view in self.views)
        guessed = frozenset(i for i, view in enumerate(self.views) if not view.metric)
        self._memory.follow(mpi for i, mpi in enumerate(mpis) if i not in guessed)
        return LightField(mpis, self.options, guessed, self._memory)

    def prepare(self, frame: Frame) -> Frame:
        """Return the frame at the size that MPIs and renderings have here."""
        return self.builder.prepare(frame)

    def accepts(self, frame: Frame) -> bool:
        """Return whether a frame can become a view: it has depth, or depth can be estimated."""
        return self.builder.accepts(frame)

    def add_view(self, frame: Frame) -> Mpi:
        """Make a captured frame part of the reconstruction.

        With a depth model, frames without depth are welcome; the scale of one that nothing is known
        about is a guess until a later view tells it.

        Raises:
            PeakingError: The frame has no metric depth, and there is no depth model.
        """
        self.views.append(self.builder.build(frame, self.views))
        for number, view in enumerate(self.views[:-1]):
            if not view.metric:
                others = [other for i, other in enumerate(self.views) if i != number]
                rebuilt = self.builder.rebuild_guessed(view.frame, others)
                self.views[number] = rebuilt or view
        return self.views[-1].mpi

    def remove_view(self, number: int) -> None:
        """Take a view out again; those after it move up by one.

        Raises:
            IndexError: There is no such view.
        """
        del self.views[number]

    def render(self, camera: Camera) -> Rendering:
        """Render the scene from anywhere.

        Raises:
            ValueError: No view was captured yet.
        """
        return self.light_field.render(camera, scratch=self._scratch, stopwatch=self._stopwatch)

    def compare(
        self,
        live: UInt8[np.ndarray, "h w 3"],
        camera: Camera,
        *,
        depth_m: Float32[np.ndarray, "dh dw"] | None = None,
    ) -> Comparison:
        """Render the scene for a live picture of the working size, and compare the two.

        With `align_poses`, from where the picture shows that it was taken.

        Args:
            live: The picture.
            camera: Where the device says that it was taken.
            depth_m: Depth that was measured with it, of the same field of view; 0 = unknown.

        Raises:
            ValueError: No view was captured yet, or the sizes differ.
        """
        field, alignment = self.light_field, None
        if self.options.align_poses:
            blended = replace(field, options=replace(self.options, filling_views=0))
            with self._stopwatch.stage("track"):
                alignment = refine(
                    lambda near: blended.render(near, scratch=self._small_scratch), camera, live
                )
        seen = field.compare(
            live,
            camera if alignment is None else alignment.camera,
            depth_m=depth_m,
            scratch=self._scratch,
            stopwatch=self._stopwatch,
        )
        return replace(seen, alignment=alignment)
