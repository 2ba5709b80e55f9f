"""What is made of the chosen views, behind one interface: MPIs or 3D Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera
from peaking.rendering import Rendering
from peaking.selection.recorded_frames import RecordedFrames
from peaking.timing import Stopwatch

ModelKind = Literal["mpi", "3dgs"]

Renderer = Callable[[Camera], Rendering]
"""Renders what a camera sees."""


@dataclass(frozen=True)
class SplatTraining:
    """How 3D Gaussians are trained."""

    backend: Literal["numba", "gsplat"] = "numba"
    """On the CPU, or with CUDA."""
    iterations: int = 2000
    """Steps of training; each looks at one picture."""
    pixels: int = 57280
    """Pixels of the pictures that are trained on and tested (179×320)."""


def with_mpis(recorded: RecordedFrames, views: Sequence[int]) -> Renderer:
    """Return what the chosen views show."""

    def render(camera: Camera) -> Rendering:
        return recorded.render(views, camera)

    return render


def with_gaussians(
    frames: Sequence[Frame], plan: SplatTraining, *, seed: int, stopwatch: Stopwatch
) -> Renderer:
    """Train 3D Gaussians on the chosen views and return what they show."""
    from peaking.splat.rasterise import render as rasterise
    from peaking.splat.training import SplatOptions, train

    options = SplatOptions(iterations=plan.iterations, seed=seed)
    with stopwatch.stage("training"):
        gaussians = train(frames, options, backend=plan.backend)

    def render(camera: Camera) -> Rendering:
        with stopwatch.stage("rendering"):
            splats = rasterise(gaussians, camera, backend=plan.backend)
        rgba = np.dstack([splats.rgb, splats.alpha]).astype(np.float32)
        return Rendering(rgba, splats.depth_m.astype(np.float32))

    return render


def shrunk(frame: Frame, pixels: int) -> Frame:
    """Return the frame with about so many pixels, if it has more."""
    width, height = frame.camera.pinhole.size_px
    if width * height <= pixels:
        return frame
    return frame.resized(*working_size_px(width, height, pixels=pixels))
