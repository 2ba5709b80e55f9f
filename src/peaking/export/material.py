"""What is written of a recording: which frames, how large, and how the world lies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from peaking.datasets import Recording
from peaking.frame import Frame, working_size_px
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.output import encode_jpeg
from peaking.pictures import jpeg

Progress = Callable[[Sequence[int]], Iterable[int]]
"""Wraps the places of the frames that are written."""


@runtime_checkable
class KeepsPictures(Protocol):
    """A recording whose pictures can be handed on without encoding them again."""

    def picture_bytes(self, index: int, *, keep_exif: bool = False) -> bytes | None:
        """Return a straight picture as it is stored, None where it has to be encoded."""
        ...


@dataclass(frozen=True, eq=False)
class Material:
    """Frames of a recording, ready to be written; one at a time is in memory.

    Attributes:
        recording: Where they come from.
        indices: Of its frames, in the order in which they are written; none twice.
        pixels: Larger pictures are shrunk to about so many, with intrinsics and depth.
        out_from_world: How the world is turned and moved before it is written.
        keep_exif: Keep metadata of the pictures.
        progress: Wraps the places of the frames, whenever all are gone through.
    """

    recording: Recording
    indices: Sequence[int]
    pixels: int | None = None
    out_from_world: Rigid[World, World] = field(default_factory=Rigid[World, World].identity)
    keep_exif: bool = False
    progress: Progress = iter

    def __post_init__(self) -> None:
        indices = list(self.indices)
        if not indices or len(set(indices)) != len(indices):
            raise ValueError(f"need at least one frame and none twice, got {indices}")
        if min(indices) < 0 or max(indices) >= len(self.recording):
            raise ValueError(f"need frames of 0..{len(self.recording) - 1}, got {indices}")

    def __len__(self) -> int:
        return len(self.indices)

    @property
    def places(self) -> Iterable[int]:
        """All places, with progress."""
        return self.progress(range(len(self)))

    @cached_property
    def names(self) -> Sequence[str]:
        """Unique names, good as file names."""
        return [self.recording.names[index] for index in self.indices]

    @cached_property
    def cameras(self) -> Sequence[Camera]:
        """As they are written."""
        return [self._camera(self.recording.cameras[index]) for index in self.indices]

    def read(self, place: int) -> Frame:
        """Return a frame, moved and shrunk; depth is never larger than the picture.

        Raises:
            RecordingError: It cannot be read.
        """
        frame = self.recording.read(self.indices[place])
        camera = self._camera(frame.camera)
        points_m = frame.points_m
        if points_m is not None:
            points_m = self.out_from_world.apply(points_m)
        frame = frame.resized(*camera.pinhole.size_px)
        depth_m = frame.depth_m
        if depth_m is not None:
            height, width = depth_m.shape
            if width > camera.pinhole.width_px or height > camera.pinhole.height_px:
                depth_m = depth_resized(depth_m, *camera.pinhole.size_px)
        return replace(frame, camera=camera, depth_m=depth_m, points_m=points_m)

    def picture(self, place: int, frame: Frame) -> tuple[bytes, str]:
        """Return the picture of a frame that was read as a file, and its ending.

        It is the stored file, without metadata, where nothing about its pixels changes.

        Raises:
            RecordingError: It cannot be read.
        """
        stored = None
        index = self.indices[place]
        recorded_px = self.recording.cameras[index].pinhole.size_px
        if (
            isinstance(self.recording, KeepsPictures)
            and frame.camera.pinhole.size_px == recorded_px
        ):
            stored = self.recording.picture_bytes(index, keep_exif=self.keep_exif)
        data = stored or encode_jpeg(frame.rgb)
        return data, "jpg" if data.startswith(jpeg.START) else "png"

    def seen_m(self, frame: Frame) -> Float64[np.ndarray, "n 3"]:
        """Return where (x, y) in the picture things are seen, and how far away along +z (m).

        From depth, a point for each known pixel of the map; else from the points that it sees.
        """
        pinhole = frame.camera.pinhole
        if frame.depth_m is not None:
            rows, columns = np.nonzero(frame.depth_m)
            height, width = frame.depth_m.shape
            x_px = (columns + 0.5) * pinhole.width_px / width
            y_px = (rows + 0.5) * pinhole.height_px / height
            return np.stack([x_px, y_px, frame.depth_m[rows, columns].astype(np.float64)], axis=1)
        if frame.points_m is None:
            return np.zeros((0, 3))
        xy_px, depth_m = frame.camera.project(frame.points_m)
        inside = frame.camera.sees(frame.points_m)
        return np.column_stack([xy_px, depth_m])[inside]

    def _camera(self, camera: Camera) -> Camera:
        here = self.out_from_world @ camera.world_from_cam
        moved = Camera(camera.pinhole, Rigid[World, Cam](here.rotation, here.translation_m))
        width, height = camera.pinhole.size_px
        if self.pixels is None or width * height <= self.pixels:
            return moved
        return moved.resized(*working_size_px(width, height, pixels=self.pixels))


def depth_resized(
    depth_m: Float32[np.ndarray, "h w"], width_px: int, height_px: int
) -> Float32[np.ndarray, "height width"]:
    """Return a depth map of another size: nearest values, none made up between two surfaces."""
    size_px = width_px, height_px
    return np.asarray(cv2.resize(depth_m, size_px, interpolation=cv2.INTER_NEAREST_EXACT))


def points_seen_m(camera: Camera, seen: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """Return the points of the world of (x, y, depth) in a picture."""
    pinhole = camera.pinhole
    x = (seen[:, 0] - pinhole.cx_px) / pinhole.fx_px
    y = (seen[:, 1] - pinhole.cy_px) / pinhole.fy_px
    return camera.world_from_cam.apply(np.column_stack([x, y, np.ones(len(seen))]) * seen[:, 2:])
