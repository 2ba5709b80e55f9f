"""What is made of the chosen views, behind one interface: MPIs or 3D Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32

from peaking.frame import Frame, working_size_px
from peaking.geometry import Camera
from peaking.selection.recorded_frames import RecordedFrames
from peaking.timing import Stopwatch

Method = Literal["mpi", "3dgs"]

Picture = tuple[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]
"""Colour over black, 0…1, and alpha."""

Renderer = Callable[[Camera], Picture]
"""Draws what a camera sees."""


@dataclass(frozen=True)
class SplatPlan:
    """How 3D Gaussians are trained."""

    backend: Literal["numba", "gsplat"] = "numba"
    """On the CPU, or with CUDA."""
    iterations: int = 2000
    """Steps of training; each looks at one picture."""
    pixels: int = 57280
    """Pixels of the pictures that are trained on and tested (179×320)."""


def with_mpis(recorded: RecordedFrames, views: Sequence[int]) -> Renderer:
    """Return what the K nearest of the chosen views show, as the photographer sees it."""

    def render(camera: Camera) -> Picture:
        rgba = recorded.render(recorded.neighbours(views, camera), camera).rgba
        return rgba[..., :3], rgba[..., 3]

    return render


def with_gaussians(
    frames: Sequence[Frame], plan: SplatPlan, *, seed: int, stopwatch: Stopwatch
) -> Renderer:
    """Train 3D Gaussians on the chosen views and return what they show."""
    from peaking.splat.rasterise import render as rasterise
    from peaking.splat.train import SplatOptions, train

    options = SplatOptions(iterations=plan.iterations, seed=seed)
    with stopwatch.stage("training"):
        gaussians = train(frames, options, backend=plan.backend)

    def render(camera: Camera) -> Picture:
        with stopwatch.stage("rendering"):
            view = rasterise(gaussians, camera, backend=plan.backend)
        return view.rgb.astype(np.float32), view.alpha.astype(np.float32)

    return render


def shrunk(frame: Frame, pixels: int) -> Frame:
    """Return the frame with about so many pixels, if it has more."""
    width, height = frame.camera.pinhole.size_px
    if width * height <= pixels:
        return frame
    return frame.resized(*working_size_px(width, height, pixels=pixels))
