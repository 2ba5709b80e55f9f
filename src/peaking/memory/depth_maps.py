"""The depth maps of views in one piece of memory, so that a kernel can go through them."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64

from peaking.geometry import Camera, seen_by
from peaking.view_weights import overlap_points_m

MAX_ASKED = 64
"""So many views are asked whether they have seen a surface, at most: those that see most of it."""

DEPTHS = (0.5, 1.0, 2.0)
"""Whether they do is asked at these parts of the scene's depth."""


@dataclass(frozen=True)
class AskedViews:
    """Views that may have seen a surface, the most likely first.

    Attributes:
        depth_m: All depth maps, one after the other; 0 where a view has seen nothing.
        first: Where each view's map begins.
        size_px: Width and height of each map.
        inner: fx, fy, cx, cy of each map, in its pixels.
        rotation: From the asking camera's frame to each view's.
        translation_m: The same.
    """

    depth_m: Float32[np.ndarray, "all"]
    first: Int64[np.ndarray, "views"]
    size_px: Int64[np.ndarray, "views 2"]
    inner: Float32[np.ndarray, "views 4"]
    rotation: Float32[np.ndarray, "views 3 3"]
    translation_m: Float32[np.ndarray, "views 3"]


class DepthMaps:
    """What views have seen as depth; adding one is quick, taking one out copies."""

    def __init__(self) -> None:
        """Hold none."""
        self._cameras: list[Camera] = []
        self._first: list[int] = []
        self._all = np.empty(0, np.float32)
        self._used = 0

    def __len__(self) -> int:
        return len(self._cameras)

    def add(self, camera: Camera, depth_m: Float32[np.ndarray, "h w"]) -> None:
        """Add a map; it has the camera's size."""
        if self._used + depth_m.size > len(self._all):
            room = np.empty(max(2 * len(self._all), 4 * depth_m.size), np.float32)
            room[: self._used] = self._all[: self._used]
            self._all = room
        self._all[self._used : self._used + depth_m.size] = depth_m.ravel()
        self._cameras.append(camera)
        self._first.append(self._used)
        self._used += depth_m.size

    def remove(self, number: int) -> None:
        """Take the map of this number out; those after it move up by one."""
        begin = self._first[number]
        size = int(np.prod(self._cameras[number].pinhole.size_px))
        self._all = np.delete(self._all[: self._used], slice(begin, begin + size))
        self._used -= size
        del self._cameras[number]
        del self._first[number]
        self._first[number:] = [first - size for first in self._first[number:]]

    def asked_by(self, target: Camera, scene_depth_m: float) -> AskedViews:
        """Return the views that see most of what the target does, if it is about that deep."""
        chosen = np.empty(0, np.intp)
        if self._cameras:
            points_m = [overlap_points_m(target, scene_depth_m * factor) for factor in DEPTHS]
            overlap = seen_by(self._cameras, np.concatenate(points_m)).mean(axis=1)
            chosen = np.argsort(-overlap, kind="stable")[:MAX_ASKED]
        cameras = [self._cameras[k] for k in chosen]
        relative = [camera.world_from_cam.inverse() @ target.world_from_cam for camera in cameras]
        pinholes = [camera.pinhole for camera in cameras]
        inner = [(p.fx_px, p.fy_px, p.cx_px, p.cy_px) for p in pinholes]
        return AskedViews(
            self._all,
            np.array([self._first[k] for k in chosen], np.int64),
            np.array([p.size_px for p in pinholes], np.int64).reshape(-1, 2),
            np.array(inner, np.float32).reshape(-1, 4),
            _stack([r.rotation for r in relative], (3, 3)),
            _stack([r.translation_m for r in relative], (3,)),
        )


def _stack(arrays: list[Float64[np.ndarray, "*n"]], shape: tuple[int, ...]) -> np.ndarray:
    return np.array(arrays, np.float32).reshape(-1, *shape)
