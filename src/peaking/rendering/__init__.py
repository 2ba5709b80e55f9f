"""Render one MPI from a camera: warp every plane by its homography, composite, near over far.

`_numpy.py` is the method in float64; `_numba.py` is the same, fast, on the CPU. Neither is
used in place of the other without being asked for.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64

from peaking.geometry import Camera, Rigid, Source, Target, source_from_target
from peaking.mpi import Mpi

Backend = Literal["numpy", "numba"]

NEAR_M = 1e-4
"""A plane nearer than this to the rendering camera, or behind it, is not drawn."""


@dataclass(frozen=True)
class Rendering:
    """A rendered view.

    Attributes:
        rgba: Premultiplied colour and alpha, 0…1; zero where nothing was seen.
        depth_m: Depth in the rendering camera, the average over planes by their share of the
            pixel; 0 where nothing was seen.
    """

    rgba: Float32[np.ndarray, "h w 4"]
    depth_m: Float32[np.ndarray, "h w"]

    @property
    def alpha(self) -> Float32[np.ndarray, "h w"]:
        """Opacity, 0…1."""
        return self.rgba[..., 3]

    def rgb(self) -> Float32[np.ndarray, "h w 3"]:
        """Return straight (not premultiplied) colour; black where nothing was seen."""
        alpha = self.rgba[..., 3:]
        return self.rgba[..., :3] / np.where(alpha > 0, alpha, 1)


def plane_homographies(
    mpi: Mpi, target: Camera
) -> tuple[Float64[np.ndarray, "planes 3 3"], Float64[np.ndarray, "planes"]]:
    """Return how target pixels map to the texels of each plane, and how to get depth from it.

    For the ray `r = K_t⁻¹ p` of a target pixel and the plane at depth z of the source camera, with
    `x_s = R x_t + t`, the ray meets the plane at target depth `λ = (z - t_z) / (R r)_z`. So
    `p_s ~ K_s (λ R r + t)`, and times `(R r)_z`, which is positive in front of the source camera:
    `H = K_s ((z - t_z) R + t e₃ᵀ R) K_t⁻¹` with third coordinate `w = z (R r)_z`. Hence the target
    depth is `λ = (z - t_z) z / w`; the second result is `(z - t_z) z`. Planes that are at or behind
    the target camera must not be drawn: their homographies are NaN.
    """
    motion: Rigid[Source, Target] = source_from_target(mpi.camera, target)
    R, t_m = motion.rotation, motion.translation_m
    z_m = mpi.plane_depths_m
    ahead_m = z_m - t_m[2]
    warp = ahead_m[:, None, None] * R + np.outer(t_m, R[2])
    homographies = mpi.camera.pinhole.px_from_cam @ warp @ target.pinhole.cam_from_px
    homographies[ahead_m <= NEAR_M] = np.nan
    return homographies, ahead_m * z_m


def render(
    mpi: Mpi,
    camera: Camera,
    *,
    backend: Backend = "numba",
    out: tuple[Float32[np.ndarray, "h w 4"], Float32[np.ndarray, "h w"]] | None = None,
) -> Rendering:
    """Render `mpi` as `camera` would see it, at that camera's size.

    Args:
        mpi: What to render.
        camera: Where from.
        backend: Which implementation.
        out: Arrays for colour and depth to be written into (`numba` only), else new ones.
    """
    homographies, depth_times_w = plane_homographies(mpi, camera)
    nothing = np.zeros(mpi.num_planes)
    size_px = camera.pinhole.size_px
    if backend == "numpy":
        from peaking.rendering import _numpy

        rgba, depth_m = _numpy.render(mpi, homographies, depth_times_w, nothing, size_px)
    else:
        from peaking.rendering import _numba

        rgba, depth_m = _numba.render(mpi, homographies, depth_times_w, nothing, size_px, out=out)
    return Rendering(rgba, depth_m)


def draw_under(
    rendering: Rendering, mpi: Mpi, camera: Camera, *, backend: Backend = "numba"
) -> Rendering:
    """Return the rendering with `mpi` drawn where it lets something through: `c + (1 - α) c_mpi`.

    Args:
        rendering: What is there; with `numba` its arrays are written into.
        mpi: What to draw under it.
        camera: The camera that the rendering is of.
        backend: Which implementation.
    """
    if backend == "numba":
        from peaking.rendering import _numba

        homographies, depth_times_w = plane_homographies(mpi, camera)
        nothing = np.zeros(mpi.num_planes)
        out = rendering.rgba, rendering.depth_m
        _numba.render(
            mpi, homographies, depth_times_w, nothing, camera.pinhole.size_px, out=out, under=True
        )
        return rendering
    below = render(mpi, camera, backend=backend)
    through = 1.0 - rendering.alpha.astype(np.float64)
    rgba = rendering.rgba + through[..., None] * below.rgba
    weighted_m = rendering.alpha * rendering.depth_m + through * below.alpha * below.depth_m
    depth_m = weighted_m / np.where(rgba[..., 3] > 0, rgba[..., 3], 1.0)
    return Rendering(rgba.astype(np.float32), depth_m.astype(np.float32))


def source_disparity(
    mpi: Mpi, size_px: tuple[int, int] | None = None, *, backend: Backend = "numba"
) -> tuple[Float32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return disparity (1/m) and alpha of an MPI seen from where it was photographed.

    Each plane's disparity takes the place of its colour (D̂ of the paper, equation 2); the sum is
    divided by the alpha, since planes need not be opaque together.

    Args:
        mpi: What to look at.
        size_px: Width and height of the result, else those of the MPI.
        backend: Which implementation.
    """
    camera = mpi.camera.resized(*(size_px or mpi.camera.pinhole.size_px))
    homographies, _ = plane_homographies(mpi, camera)
    nothing = np.zeros(mpi.num_planes)
    if backend == "numpy":
        from peaking.rendering import _numpy as module
    else:
        from peaking.rendering import _numba as module
    rgba, disparity = module.render(
        mpi, homographies, nothing, 1.0 / mpi.plane_depths_m, camera.pinhole.size_px
    )
    return disparity, rgba[..., 3]
