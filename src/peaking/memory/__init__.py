"""What the views have seen of the world's surface.

    MPI ── seen_depth_m ──┬► cells of a grid in the world ──┐
                          └► its depth map ─────────────────┴► Memory ── look(camera) ──► Sight

Two things are remembered. The *cells* of a grid in the world that a view saw a surface in: each
once, however many views have seen it. They answer for any camera, alone. And each view's *depth
map*: where a device measures depth now, it says of exactly that surface whether a view saw it, or
saw through where it is. What stands where views looked through has moved since, or is a mirror or
glass (`Memory.moved`).
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float32, Int32, Int64

from peaking.geometry import Camera, Rigid, World
from peaking.memory.cells import cells_at, centres_m, sizes_m
from peaking.memory.depth_maps import AskedViews, DepthMaps
from peaking.mpi import Mpi
from peaking.rendering import Backend, source_disparity

Kind = TypeVar("Kind", bound=np.generic)

COARSER = 2
"""Depth maps and looks have so many times fewer pixels than the picture, per axis."""

OPAQUE = 0.9
"""Opacity from which a view has seen a surface."""

REACH = 1.0
"""A cell is drawn as a square of so many times its size to each side of its centre …"""

BORDER = 0.75
"""… and so much of that is taken away again along the border of all that was seen."""

NEARER = 0.03
"""A surface this part of its depth behind what a view saw there was hidden from it."""

CLEARLY_NEARER, FAR_NEARER = 0.05, 0.12
"""The same where the cells say that it was seen: of more than a speck, and of a speck."""

MOVED_AREA_PX, MOVED_SHARE = 9, 0.45
"""A square of so many pixels to a side (at half of the picture's size), and the part of it that has
to stand where views looked through for the wrong pixels in its middle to have moved. In a smaller
one the edges of things, whose depth is rarely exact, count as moved; in a larger one small things
do not."""

STEP = 1.10
"""Neighbouring samples of live depth that differ by more than this factor tell nothing."""


class Grid:
    """The frame of the cells: that of the first view's camera."""


@dataclass(frozen=True)
class Sight:
    """What is remembered of what a camera looks at, at half of its size.

    Attributes:
        depth_m: Depth of the nearest surface that a view has seen; 0 where none has.
        cell: Number of its cell in the memory, or -1.
        unseen: No view has seen what is here.
    """

    depth_m: Float32[np.ndarray, "h w"]
    cell: Int32[np.ndarray, "h w"]
    unseen: Bool[np.ndarray, "h w"]

    def unseen_at(self, width_px: int, height_px: int) -> Bool[np.ndarray, "height width"]:
        """Return `unseen` at the size of the picture."""
        return _nearest(self.unseen, width_px, height_px)


class Memory:
    """The surface that some views have seen."""

    def __init__(self, mpis: Iterable[Mpi] = (), *, backend: Backend = "numba") -> None:
        """Remember what these views have seen.

        Args:
            mpis: The views, in metres.
            backend: Which implementation looks.
        """
        self._backend: Backend = backend
        self._world_from_grid: Rigid[World, Grid] = Rigid.identity()
        self._mpis: list[Mpi] = []
        self._own: list[Int64[np.ndarray, "own"]] = []
        self._maps = DepthMaps()
        self._cells: Int64[np.ndarray, "cells"] = np.empty(0, np.int64)
        self._views: Int32[np.ndarray, "cells"] = np.empty(0, np.int32)
        self._centres_m: Float32[np.ndarray, "cells 3"] = np.empty((0, 3), np.float32)
        self._sizes_m: Float32[np.ndarray, "cells"] = np.empty(0, np.float32)
        self.follow(mpis)

    def __len__(self) -> int:
        return len(self._cells)

    @property
    def views(self) -> Int32[np.ndarray, "cells"]:
        """How many views have seen each cell."""
        return self._views

    def surface_m(self, size_m: float) -> Float32[np.ndarray, "places 3"]:
        """Return places in the world where views saw a surface, one in each cube that has any.

        Args:
            size_m: Side of the cubes, > 0.
        """
        points_m = self._world_from_grid.apply(self._centres_m.astype(np.float64))
        cubes = np.floor(points_m / size_m).astype(np.int64)
        _, first = np.unique(cubes, axis=0, return_index=True)
        return points_m[first].astype(np.float32)

    def follow(self, mpis: Iterable[Mpi]) -> None:
        """Remember these views and no others: new ones are added, missing ones forgotten."""
        wanted = list(mpis)
        known = {id(mpi) for mpi in self._mpis}
        kept = {id(mpi) for mpi in wanted}
        for number in reversed(range(len(self._mpis))):
            if id(self._mpis[number]) not in kept:
                self._forget(number)
        for mpi in wanted:
            if id(mpi) not in known:
                known.add(id(mpi))
                self._remember(mpi)

    def look(
        self, camera: Camera, live_depth_m: Float32[np.ndarray, "dh dw"] | None = None
    ) -> Sight:
        """Return what is remembered of what a camera looks at.

        Args:
            camera: Where from.
            live_depth_m: What the device measures there now, of the same field of view, at any
                size; 0 = unknown. Without it, what was never seen and stands before something that
                was is not told.
        """
        width, height = _smaller(camera)
        small = camera.resized(width, height)
        module = self._module
        cam_from_grid = small.world_from_cam.inverse() @ self._world_from_grid
        depth_m, cell = module.look(
            self._centres_m,
            np.float32(REACH) * self._sizes_m,
            cam_from_grid.rotation,
            cam_from_grid.translation_m,
            small.pinhole,
        )
        unseen = self._unseen_by_cells(depth_m, cell, small)
        if live_depth_m is not None and (live_depth_m > 0).any():
            live_m = _nearest(_smooth(_at_most(live_depth_m, width, height)), width, height)
            asked = self._asked_by(small, live_depth_m)
            behind = module.behind(live_m, small.pinhole, asked)
            clearly = _without_specks(behind > CLEARLY_NEARER) | (behind > FAR_NEARER)
            by_depth = np.where(unseen, behind > NEARER, clearly)
            unseen = np.where(live_m > 0, by_depth, unseen)
        return Sight(depth_m, cell, unseen)

    def moved(
        self,
        camera: Camera,
        wrong: Bool[np.ndarray, "height width"],
        live_depth_m: Float32[np.ndarray, "dh dw"] | None,
    ) -> Bool[np.ndarray, "height width"]:
        """Return which wrong pixels show what was elsewhere when the views were taken.

        There something stands where at least two views looked through: it has moved since, or is
        a mirror or glass. A view from here will not help.

        Args:
            camera: Where from.
            wrong: What a view might mend, of the camera's size.
            live_depth_m: What the device measures, as in `look`; without it, nothing is told.
        """
        if live_depth_m is None or not (live_depth_m > 0).any() or not wrong.any():
            return np.zeros_like(wrong)
        width, height = _smaller(camera)
        small = camera.resized(width, height)
        live_m = _nearest(_at_most(live_depth_m, width, height), width, height)
        where = _nearest(wrong, width, height) & (live_m > 0)
        through = self._module.looked_through(
            np.where(where, live_m, np.float32(0)),
            small.pinhole,
            self._asked_by(small, live_depth_m),
        )
        side = (MOVED_AREA_PX, MOVED_AREA_PX)
        share = cv2.blur(through.astype(np.float32), side, borderType=cv2.BORDER_CONSTANT)
        return wrong & _nearest(share > MOVED_SHARE, *camera.pinhole.size_px)

    @property
    def _module(self) -> ModuleType:
        if self._backend == "numpy":
            from peaking.memory import _numpy as module
        else:
            from peaking.memory import _numba as module
        return module

    def _asked_by(self, small: Camera, live_depth_m: Float32[np.ndarray, "dh dw"]) -> AskedViews:
        scene_depth_m = float(np.median(live_depth_m[live_depth_m > 0]))
        return self._maps.asked_by(small, scene_depth_m)

    def _unseen_by_cells(
        self, depth_m: Float32[np.ndarray, "h w"], cell: Int32[np.ndarray, "h w"], small: Camera
    ) -> Bool[np.ndarray, "h w"]:
        """Return where no cell is, nor would be if cells were not drawn too large."""
        seen = cell >= 0
        if not seen.any():
            return ~seen
        from_border_px = cv2.distanceTransform(seen.astype(np.uint8), cv2.DIST_L2, 3)
        beyond_m = np.where(seen, BORDER * self._sizes_m[np.maximum(cell, 0)], 0.0)
        beyond_px = beyond_m * small.pinhole.fx_px / np.where(seen, depth_m, 1.0)
        return ~seen | (from_border_px <= beyond_px)

    def _remember(self, mpi: Mpi) -> None:
        if not self._mpis:
            here = mpi.camera.world_from_cam
            self._world_from_grid = Rigid(here.rotation, here.translation_m)
        width, height = _smaller(mpi.camera)
        camera = mpi.camera.resized(width, height)
        disparity, alpha = source_disparity(mpi, (width, height))
        seen = (alpha > OPAQUE) & (disparity > 0)
        depth_m = np.where(seen, 1.0 / np.where(seen, disparity, 1.0), 0.0).astype(np.float32)
        measured_m = depth_m[seen].astype(np.float64)
        grid_from_cam = self._world_from_grid.inverse() @ camera.world_from_cam
        points_m = grid_from_cam.apply(camera.pinhole.rays()[seen] * measured_m[:, None])
        own = np.unique(cells_at(points_m, measured_m))
        self._mpis.append(mpi)
        self._maps.add(camera, depth_m)
        self._own.append(own)
        self._count(own, 1)

    def _forget(self, number: int) -> None:
        del self._mpis[number]
        self._maps.remove(number)
        self._count(self._own.pop(number), -1)

    def _count(self, own: Int64[np.ndarray, "own"], by: int) -> None:
        """Count one view more, or one less, for its cells."""
        cells = np.union1d(self._cells, own) if by > 0 else self._cells
        views = np.zeros(len(cells), np.int32)
        views[np.searchsorted(cells, self._cells)] = self._views
        views[np.searchsorted(cells, own)] += by
        kept = views > 0
        self._cells, self._views = cells[kept], views[kept]
        self._centres_m, self._sizes_m = centres_m(self._cells), sizes_m(self._cells)


def _smaller(camera: Camera) -> tuple[int, int]:
    width, height = (max(1, side // COARSER) for side in camera.pinhole.size_px)
    return width, height


def _without_specks(mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return opened.astype(np.bool_)


def _smooth(depth_m: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    """Return depth where its neighbours are about as deep, else 0: edges are rarely exact."""
    around = np.ones((3, 3), np.uint8)
    nearest = cv2.erode(np.where(depth_m > 0, depth_m, np.float32(1e6)), around)
    farthest = cv2.dilate(depth_m, around)
    return np.where((depth_m > 0) & (farthest < STEP * nearest), depth_m, np.float32(0.0))


def _at_most(
    depth_m: Float32[np.ndarray, "h w"], width_px: int, height_px: int
) -> Float32[np.ndarray, "oh ow"]:
    height, width = depth_m.shape
    return _nearest(depth_m, min(width, width_px), min(height, height_px))


def _nearest(picture: npt.NDArray[Kind], width_px: int, height_px: int) -> npt.NDArray[Kind]:
    """Return a picture of another size, each pixel that of its centre."""
    height, width = picture.shape
    rows = ((np.arange(height_px) + 0.5) * height / height_px).astype(np.intp)
    cols = ((np.arange(width_px) + 0.5) * width / width_px).astype(np.intp)
    return picture[rows[:, None], cols]
