"""How well views show frames: errors of small blends, many at once, each made once."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, UInt8

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.mpi import Mpi
from peaking.options import Opacity
from peaking.rendering import render

ALL_WRONG = 0.3
"""Mean squared error of a frame that no view shows."""

MAX_RENDERINGS = 1500
"""Renderings that are kept; at the paper's size they take 0.28 GB."""

MAX_KNOWN = 200_000
"""Errors that are remembered."""


@dataclass(frozen=True)
class Blend:
    """A frame as some views show it.

    Attributes:
        target: Number of the frame.
        views: Numbers of the views, best first; without any, the frame is all wrong.
        weights: Their shares, which sum to 1.
    """

    target: int
    views: tuple[int, ...]
    weights: Float[np.ndarray, "k"]

    @property
    def key(self) -> tuple[object, ...]:
        """What its error is remembered by."""
        return (self.target, *self.views, *np.round(self.weights, 2).tolist())


class ShownErrors:
    """Small photos, small MPIs, and the errors of blends of these against those.

    Photos and MPIs are called by numbers that are given once and never again to others.
    """

    def __init__(self, opacity: Opacity, *, max_photos: int, max_views: int) -> None:
        """Begin without photos.

        Args:
            opacity: How opaque blends are.
            max_photos: Photos that are there at once, at most.
            max_views: Views in one blend, at most.
        """
        self._opacity: Opacity = opacity
        self._max_views = max_views
        self._cameras: dict[int, Camera] = {}
        self._mpis: dict[int, Mpi] = {}
        self._place: dict[int, int] = {}
        self._free = list(range(max_photos - 1, -1, -1))
        self._pixels = np.zeros(max_photos, dtype=np.int64)
        self._photos: UInt8[np.ndarray, "photos pixels 4"] = np.zeros(
            (max_photos, 0, 4), dtype=np.uint8
        )
        self._rgba: Float32[np.ndarray, "renderings pixels 4"] = np.zeros(
            (MAX_RENDERINGS, 0, 4), dtype=np.float32
        )
        self._rendered: OrderedDict[tuple[int, int], int] = OrderedDict()
        self._known: dict[tuple[object, ...], tuple[float, float]] = {}

    def add_photo(self, number: int, frame: Frame) -> None:
        """Keep a small photo; what its mask leaves out does not count."""
        height, width = frame.rgb.shape[:2]
        self._make_room(height * width)
        place = self._free.pop()
        self._place[number] = place
        self._cameras[number] = frame.camera
        self._pixels[place] = height * width
        photo = self._photos[place, : height * width]
        photo[:, :3] = frame.rgb.reshape(-1, 3)
        photo[:, 3] = 255 if frame.mask is None else frame.mask.reshape(-1)

    def remove_photo(self, number: int) -> None:
        """Forget a photo."""
        del self._cameras[number]
        self._free.append(self._place.pop(number))

    def add_mpi(self, number: int, mpi: Mpi) -> None:
        """Keep the MPI of a view."""
        self._mpis[number] = mpi

    def remove_mpi(self, number: int) -> None:
        """Forget the MPI of a view."""
        del self._mpis[number]

    def errors(self, blends: Sequence[Blend]) -> Float64[np.ndarray, "blends 2"]:
        """Return the mean squared errors of blends, and the parts of it where nothing is shown."""
        found = np.full((len(blends), 2), ALL_WRONG)
        keys = [blend.key for blend in blends]
        new = {
            key: blend
            for key, blend in zip(keys, blends, strict=True)
            if blend.views and key not in self._known
        }
        if len(self._known) > MAX_KNOWN:
            kept = [key for key in dict.fromkeys(keys) if key in self._known]
            self._known = {key: self._known[key] for key in kept}
        unknown = list(new.items())
        batch = max(1, MAX_RENDERINGS // self._max_views)
        for start in range(0, len(unknown), batch):
            some = unknown[start : start + batch]
            computed = self._compute([blend for _, blend in some])
            for (key, _), error in zip(some, computed.tolist(), strict=True):
                self._known[key] = (error[0], error[1])
        for k, (key, blend) in enumerate(zip(keys, blends, strict=True)):
            if blend.views:
                found[k] = self._known[key]
        return found

    def forget_renderings(self) -> None:
        """Give the room of the renderings back; they take the most."""
        self._rendered.clear()
        self._rgba = self._rgba[:, :0].copy()

    def _compute(self, blends: Sequence[Blend]) -> Float64[np.ndarray, "blends 2"]:
        from peaking.selection import _numba

        sources = np.full((len(blends), self._max_views), -1, dtype=np.int64)
        weights = np.zeros((len(blends), self._max_views), dtype=np.float32)
        for k, blend in enumerate(blends):
            count = len(blend.views)
            sources[k, :count] = [self._render(view, blend.target) for view in blend.views]
            weights[k, :count] = blend.weights
        errors = np.empty((len(blends), 2))
        _numba.blended_errors(
            self._rgba,
            self._photos,
            self._pixels,
            np.array([self._place[blend.target] for blend in blends]),
            sources,
            weights,
            self._opacity == "seen",
            errors,
        )
        return errors

    def _render(self, view: int, target: int) -> int:
        """Return the place of a rendering; the one that was not asked for longest gives way."""
        pair = (view, target)
        if pair in self._rendered:
            self._rendered.move_to_end(pair)
            return self._rendered[pair]
        camera = self._cameras[target]
        width, height = camera.pinhole.size_px
        self._make_room(width * height)
        if len(self._rendered) < MAX_RENDERINGS:
            place = len(self._rendered)
        else:
            _, place = self._rendered.popitem(last=False)
        rgba = self._rgba[place, : width * height].reshape(height, width, 4)
        depth_m = np.empty((height, width), dtype=np.float32)
        render(self._mpis[view], camera, out=(rgba, depth_m))
        self._rendered[pair] = place
        return place

    def _make_room(self, pixels: int) -> None:
        """Let photos and renderings have so many pixels."""
        self._photos = _with_room(self._photos, pixels)
        self._rgba = _with_room(self._rgba, pixels)


def _with_room(pictures: np.ndarray, pixels: int) -> np.ndarray:
    """Return pictures in a row each, with room for at least so many pixels."""
    if pictures.shape[1] >= pixels:
        return pictures
    room = np.zeros((len(pictures), pixels, 4), dtype=pictures.dtype)
    room[:, : pictures.shape[1]] = pictures
    return room
