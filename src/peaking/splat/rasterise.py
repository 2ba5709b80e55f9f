"""Render Gaussians from a camera. `_numpy.py` is the definition; the others must agree with it."""

from __future__ import annotations

from typing import Literal

import numpy as np

from peaking.geometry import Camera
from peaking.splat.gaussians import Gaussians
from peaking.splat.rendering import CutOffs, Rendering

__all__ = ["Backend", "CutOffs", "Rendering", "render"]

Backend = Literal["numba", "numpy", "gsplat"]


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    cut_offs: CutOffs | None = None,
    backend: Backend = "numba",
) -> Rendering:
    """Return colour, opacity and depth as the camera would see them.

    Raises:
        ValueError: Their spherical harmonics are of degree 2 or 3.
        BackendUnavailable: gsplat, torch or CUDA is missing.
    """
    if gaussians.degree > 1:
        raise ValueError(f"need Gaussians of degree 0 or 1, got {gaussians.degree}: see of_degree")
    cut_offs = cut_offs or CutOffs()
    camera = camera.relative_to(gaussians.origin_m)
    if backend == "numpy":
        from peaking.splat import _numpy

        return _numpy.render(gaussians.parameters().astype(np.float64), camera, cut_offs)
    if backend == "gsplat":
        from peaking.splat import _gsplat

        return _gsplat.render(gaussians, camera, cut_offs)
    from peaking.splat.tape import Tape

    return Tape(gaussians.parameters(), camera, cut_offs).rendering()
