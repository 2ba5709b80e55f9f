"""Seeing Gaussians from a camera, and the gradient of what is seen by all parameters.

`_numpy.py` is the definition; `Tape` runs the compiled kernels on matrices of parameters
(`Gaussians.packed`) in their own precision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np
from jaxtyping import Float, Float32, Float64, Int32, Int64

from peaking.geometry import Camera
from peaking.splat import _project_numba, _raster_numba
from peaking.splat.gaussians import Gaussians


@dataclass(frozen=True)
class CutOffs:
    """What is left out of the sum.

    Attributes:
        near_m: Gaussians with a centre nearer than this along +z are not drawn.
        alpha_min: A Gaussian adds nothing where its alpha is smaller.
        alpha_max: No alpha is greater, so that something always shines through.
        opaque: Where less than this shines through, nothing behind is added.
    """

    near_m: float = 0.05
    alpha_min: float = 1 / 255
    alpha_max: float = 0.99
    opaque: float = 1e-4

    def __post_init__(self) -> None:
        if not (self.near_m > 0 and 0 < self.alpha_min < self.alpha_max < 1 and self.opaque >= 0):
            raise ValueError(f"need near_m > 0, 0 < alpha_min < alpha_max < 1, got {self}")


@dataclass(frozen=True, eq=False)
class View:
    """What is seen.

    Attributes:
        rgb: Premultiplied colour (over black).
        alpha: Opacity, 0…1.
        depth_m: Mean depth along +z of what is seen; 0 where nothing is.
    """

    rgb: Float[np.ndarray, "h w 3"]
    alpha: Float[np.ndarray, "h w"]
    depth_m: Float[np.ndarray, "h w"]


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    cut_offs: CutOffs | None = None,
    backend: Literal["numba", "numpy"] = "numba",
) -> View:
    """Return the picture, its opacity and its depth from a camera."""
    if backend == "numpy":
        from peaking.splat import _numpy

        parameters = gaussians.packed().astype(np.float64)
        return _numpy.render(parameters, camera, cut_offs or CutOffs())
    return Tape(gaussians.packed(), camera, cut_offs or CutOffs()).view()


class Tape:
    """One rendering that remembers what its gradient needs."""

    def __init__(
        self, parameters: Float[np.ndarray, "n columns"], camera: Camera, cut_offs: CutOffs
    ) -> None:
        """Render; everything is computed in the type of `parameters`."""
        kind = parameters.dtype
        pinhole = camera.pinhole
        width, height = pinhole.size_px
        self._parameters = parameters
        cam_from_world = camera.world_from_cam.inverse().matrix()[:3]
        self._pose = np.ascontiguousarray(cam_from_world, dtype=kind)
        lens = (pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px, width, height)
        self._lens = np.array(lens, kind)
        self._limits = np.array([cut_offs.alpha_min, cut_offs.alpha_max, cut_offs.opaque], kind)
        self._background = np.zeros(3, kind)
        self.splats = np.empty((len(parameters), _project_numba.NUM_SPLAT_COLUMNS), kind)
        _project_numba.project(
            parameters,
            self._pose,
            self._lens,
            kind.type(cut_offs.near_m),
            self._limits[0],
            self.splats,
        )
        columns = -(-width // _raster_numba.TILE_PX)
        rows = -(-height // _raster_numba.TILE_PX)
        seen = np.flatnonzero(self.splats[:, 10] > 0)
        order = seen[np.argsort(self.splats[seen, 9], kind="stable")]
        self._tile_starts, self._entries, self._slots, self._starts = _raster_numba.bin_tiles(
            order, self.splats, columns, rows
        )
        self._tile_order = _spread(rows * columns, numba.get_num_threads())
        self._picture = np.empty((height, width, 4), kind)
        self._left = np.empty((height, width), kind)
        self._last = np.empty((height, width), np.int32)
        _raster_numba.composite(
            self._tile_order,
            self._tile_starts,
            self._entries,
            self.splats,
            self._background,
            self._limits,
            self._picture,
            self._left,
            self._last,
        )

    @property
    def rgb(self) -> Float[np.ndarray, "h w 3"]:
        """Colour over black."""
        return self._picture[..., :3]

    def view(self) -> View:
        """Return what is seen."""
        alpha = 1 - self._left
        depth_m = np.divide(
            self._picture[..., 3], alpha, out=np.zeros_like(alpha), where=alpha > 1e-6
        )
        return View(np.ascontiguousarray(self.rgb), alpha, depth_m)

    def gradients(
        self,
        by_rgb: Float[np.ndarray, "h w 3"],
        screen: Float32[np.ndarray, "n 2"] | Float64[np.ndarray, "n 2"],
    ) -> Float[np.ndarray, "n columns"]:
        """Return the loss's gradient by the parameters, from its gradient by the colours.

        To `screen` is added, for each Gaussian that is in the picture, the length of the gradient
        by its position (in half pictures), and 1.
        """
        kind = self._parameters.dtype
        by_entry = np.empty((len(self._entries), _project_numba.NUM_GRADIENT_COLUMNS), kind)
        _raster_numba.composite_backward(
            self._tile_order,
            self._tile_starts,
            self._entries,
            self._slots,
            self.splats,
            self._background,
            self._limits,
            self._left,
            self._last,
            np.ascontiguousarray(by_rgb, dtype=kind),
            by_entry,
        )
        gradients = np.empty_like(self._parameters)
        _project_numba.project_backward(
            self._parameters,
            self._pose,
            self._lens,
            self.splats,
            self._starts,
            by_entry,
            gradients,
            screen,
        )
        return gradients


def _spread(
    num_tiles: int, num_threads: int
) -> Int64[np.ndarray, "tiles"] | Int32[np.ndarray, "tiles"]:
    """Return the tiles so that each thread's share lies all over the picture."""
    tiles = np.arange(num_tiles)
    return np.concatenate([tiles[k::num_threads] for k in range(num_threads)])
