"""The multi-plane image: planes of premultiplied RGBA in front of one camera, stored sparsely.

From metric depth about a tenth of a 32-plane MPI holds anything, so the planes are cut into tiles
and only tiles with something in them are kept. Order of planes, tiles and their aprons, alpha:
CONVENTIONS.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int32, UInt8

from peaking.geometry import Camera

CELL_PX = 15
"""Texels of a plane that a tile is responsible for, per axis."""

TILE_PX = 16
"""Texels that a tile stores, per axis: its cell and the apron."""


def tile_grid(width_px: int, height_px: int) -> tuple[int, int]:
    """Return rows and columns of tiles that cover a picture and the transparent rim before it."""
    return -(-(height_px + 1) // CELL_PX), -(-(width_px + 1) // CELL_PX)


@dataclass(frozen=True)
class Mpi:
    """A sparse multi-plane image.

    Attributes:
        camera: The camera that photographed it; its size is the size of every plane.
        plane_depths_m: Depths of the planes in metres, farthest first.
        tile_places: Plane, row and column of every tile, sorted.
        texels: The tiles, premultiplied RGBA.
        generator: Who made it, for logs and reports.
    """

    camera: Camera
    plane_depths_m: Float64[np.ndarray, "planes"]
    tile_places: Int32[np.ndarray, "tiles 3"]
    texels: UInt8[np.ndarray, "tiles 16 16 4"]
    generator: str = "unknown"

    def __post_init__(self) -> None:
        depths_m = self.plane_depths_m
        if len(depths_m) == 0 or not np.isfinite(depths_m).all() or depths_m.min() <= 0:
            raise ValueError(f"need finite plane depths > 0, got {depths_m.tolist()}")
        if (np.diff(depths_m) >= 0).any():
            raise ValueError("need plane depths sorted from the farthest to the nearest")
        if len(self.tile_places) != len(self.texels):
            raise ValueError(
                f"need one place per tile, got {len(self.tile_places)} places "
                f"for {len(self.texels)} tiles"
            )

    @property
    def num_planes(self) -> int:
        """Number of planes, D."""
        return len(self.plane_depths_m)

    @cached_property
    def tile_index(self) -> Int32[np.ndarray, "planes rows cols"]:
        """For every place the number of its tile, or -1 where there is none."""
        rows, cols = tile_grid(*self.camera.pinhole.size_px)
        index = np.full((self.num_planes, rows, cols), -1, dtype=np.int32)
        plane, row, col = self.tile_places.T
        index[plane, row, col] = np.arange(len(self.tile_places), dtype=np.int32)
        return index

    def scaled(self, scale: float) -> Mpi:
        """Return the MPI with all plane depths multiplied (paper, equation 1).

        Raises:
            ValueError: The scale is not a positive number.
        """
        if not (np.isfinite(scale) and scale > 0):
            raise ValueError(f"need a scale > 0, got {scale}")
        return replace(self, plane_depths_m=self.plane_depths_m * scale)

    def masked(self, mask: Bool[np.ndarray, "h w"]) -> Mpi:
        """Return the MPI without what a mask of its picture leaves out, on all planes.

        Raises:
            ValueError: The mask has another size.
        """
        width, height = self.camera.pinhole.size_px
        if mask.shape != (height, width):
            raise ValueError(
                f"need a mask of {width}x{height}, got {mask.shape[1]}x{mask.shape[0]}"
            )
        rows, cols = tile_grid(width, height)
        padded = np.zeros((rows * CELL_PX + 1, cols * CELL_PX + 1), dtype=np.bool_)
        padded[1 : height + 1, 1 : width + 1] = mask
        windows = np.lib.stride_tricks.sliding_window_view(padded, (TILE_PX, TILE_PX))
        counts = windows[::CELL_PX, ::CELL_PX][self.tile_places[:, 1], self.tile_places[:, 2]]
        texels = np.where(counts[..., None], self.texels, np.uint8(0))
        held = texels[..., 3].any(axis=(1, 2))
        return replace(self, tile_places=self.tile_places[held], texels=texels[held])

    def dense(self) -> UInt8[np.ndarray, "planes h w 4"]:
        """Return all planes in full, for tests and export."""
        width, height = self.camera.pinhole.size_px
        rows, cols = tile_grid(width, height)
        padded = np.zeros(
            (self.num_planes, rows * CELL_PX + 1, cols * CELL_PX + 1, 4), dtype=np.uint8
        )
        for (plane, row, col), tile in zip(self.tile_places, self.texels, strict=True):
            top, left = row * CELL_PX, col * CELL_PX
            padded[plane, top : top + TILE_PX, left : left + TILE_PX] = np.maximum(
                padded[plane, top : top + TILE_PX, left : left + TILE_PX], tile
            )
        return padded[:, 1 : height + 1, 1 : width + 1]

    @staticmethod
    def from_dense(
        planes: UInt8[np.ndarray, "planes h w 4"],
        plane_depths_m: Float64[np.ndarray, "planes"],
        camera: Camera,
        *,
        generator: str = "unknown",
    ) -> Mpi:
        """Cut dense planes (premultiplied, farthest first) into tiles and keep those with alpha."""
        num_planes, height, width = planes.shape[:3]
        rows, cols = tile_grid(width, height)
        padded = np.zeros((num_planes, rows * CELL_PX + 1, cols * CELL_PX + 1, 4), dtype=np.uint8)
        padded[:, 1 : height + 1, 1 : width + 1] = planes
        windows = np.lib.stride_tricks.sliding_window_view(padded, (TILE_PX, TILE_PX), axis=(1, 2))
        tiles = windows[:, ::CELL_PX, ::CELL_PX].transpose(0, 1, 2, 4, 5, 3)
        held = tiles[..., 3].any(axis=(3, 4))
        return Mpi(
            camera=camera,
            plane_depths_m=np.asarray(plane_depths_m, dtype=np.float64),
            tile_places=np.argwhere(held).astype(np.int32),
            texels=np.ascontiguousarray(tiles[held]),
            generator=generator,
        )
