"""One rendering by the compiled kernels, and its gradient by all parameters."""

from __future__ import annotations

import numba
import numpy as np
from jaxtyping import Float, Float32, Float64, Int32, Int64

from peaking.geometry import Camera
from peaking.splat import _project_numba, _raster_numba
from peaking.splat.view import CutOffs, View


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
        columns = -(-width // _raster_numba.TILE_WIDTH_PX)
        rows = -(-height // _raster_numba.TILE_HEIGHT_PX)
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
