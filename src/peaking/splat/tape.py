"""One rendering by the compiled kernels, and its gradient by all parameters."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numba
import numpy as np
from jaxtyping import Float, Float32, Float64, Int32, Int64

from peaking.geometry import Camera
from peaking.splat import _project_numba, _raster_numba
from peaking.splat.columns import DEPTH, NUM_ENTRY_COLUMNS, NUM_SPLAT_COLUMNS, RADIUS_U
from peaking.splat.rendering import CutOffs, Rendering


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
        self._cam_from_world = np.ascontiguousarray(cam_from_world, dtype=kind)
        intrinsics = (pinhole.fx_px, pinhole.fy_px, pinhole.cx_px, pinhole.cy_px, width, height)
        self._intrinsics = np.array(intrinsics, kind)
        limits = (cut_offs.alpha_min, cut_offs.alpha_max, cut_offs.min_transmittance)
        self._limits = np.array(limits, kind)
        self._background = np.zeros(3, kind)
        self.splats = np.empty((len(parameters), NUM_SPLAT_COLUMNS), kind)
        _project_numba.project(
            parameters,
            self._cam_from_world,
            self._intrinsics,
            kind.type(cut_offs.near_m),
            self._limits[0],
            self.splats,
        )
        columns = -(-width // _raster_numba.TILE_WIDTH_PX)
        rows = -(-height // _raster_numba.TILE_HEIGHT_PX)
        seen = np.flatnonzero(self.splats[:, RADIUS_U] > 0)
        order = seen[np.argsort(self.splats[seen, DEPTH], kind="stable")]
        self._tile_starts, self._entries, self._slots, self._starts = _raster_numba.bin_tiles(
            order, self.splats, columns, rows
        )
        self._tile_order = _spread(rows * columns, numba.get_num_threads())
        self._image = np.empty((height, width, 4), kind)
        self._transmittance = np.empty((height, width), kind)
        self._ends = np.empty((height, width), np.int32)
        _raster_numba.composite(
            self._tile_order,
            self._tile_starts,
            self._entries,
            self.splats,
            self._background,
            self._limits,
            self._image,
            self._transmittance,
            self._ends,
        )

    @property
    def rgb(self) -> Float[np.ndarray, "h w 3"]:
        """Colour over black."""
        return self._image[..., :3]

    def rendering(self) -> Rendering:
        """Return colour, opacity and depth."""
        alpha = 1 - self._transmittance
        depth_m = np.divide(
            self._image[..., 3], alpha, out=np.zeros_like(alpha), where=alpha > 1e-6
        )
        return Rendering(np.ascontiguousarray(self.rgb), alpha, depth_m)

    def gradients(
        self,
        by_rgb: Float[np.ndarray, "h w 3"],
        grad2d: Float32[np.ndarray, "n"] | Float64[np.ndarray, "n"],
        count: Float32[np.ndarray, "n"] | Float64[np.ndarray, "n"],
    ) -> Float[np.ndarray, "n columns"]:
        """Return the loss's gradient by the parameters, from its gradient by the colours.

        For each Gaussian in the picture, the length of the gradient by its projected centre (in
        half pictures) is added to `grad2d`, and 1 to `count`.
        """
        kind = self._parameters.dtype
        by_entry = np.empty((len(self._entries), NUM_ENTRY_COLUMNS), kind)
        _raster_numba.composite_backward(
            self._tile_order,
            self._tile_starts,
            self._entries,
            self._slots,
            self.splats,
            self._background,
            self._limits,
            self._transmittance,
            self._ends,
            np.ascontiguousarray(by_rgb, dtype=kind),
            by_entry,
        )
        gradients = np.empty_like(self._parameters)
        _project_numba.project_backward(
            self._parameters,
            self._cam_from_world,
            self._intrinsics,
            self.splats,
            self._starts,
            by_entry,
            gradients,
            grad2d,
            count,
        )
        return gradients


def _spread(
    num_tiles: int, num_threads: int
) -> Int64[np.ndarray, "tiles"] | Int32[np.ndarray, "tiles"]:
    """Return the tiles in an order that spreads each thread's share over the whole picture."""
    tiles = np.arange(num_tiles)
    return np.concatenate([tiles[k::num_threads] for k in range(num_threads)])
