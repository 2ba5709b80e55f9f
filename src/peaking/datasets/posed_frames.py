"""Recordings of all formats but nerfstudio's, once they are read: posed frames and their sources.

The reader of a format looks at everything but pixels, and makes a `PosedRecording`. Where pixels
come from, a file, a member of an archive or a video, is a source's own affair.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from peaking.datasets.depth_files import depth_size_px, read_depth
from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens
from peaking.datasets.nerfstudio_writer import WrittenFrame, write_frames
from peaking.datasets.recording import Recording
from peaking.datasets.stored_images import (
    as_handed_on,
    picture_size_px,
    read_grey,
    read_mask,
    read_picture,
)
from peaking.errors import RecordingError
from peaking.frame import Frame, mask_resized
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.pictures import jpeg, png

_KIND_BYTES = 16


@runtime_checkable
class PictureSource(Protocol):
    """Where a picture comes from."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, known before it is decoded."""
        ...

    @property
    def token(self) -> str:
        """A text that changes with the picture, as far as one can tell without decoding it."""
        ...

    def read(self) -> UInt8[np.ndarray, "h w 3"]:
        """Decode it, as it was stored.

        Raises:
            RecordingError: It cannot be read.
        """
        ...

    def stored(self) -> bytes | None:
        """Return the bytes of the JPEG or PNG that holds it; None where there are none."""
        ...


@runtime_checkable
class DepthSource(Protocol):
    """Where a depth map comes from."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, known before it is decoded."""
        ...

    @property
    def token(self) -> str:
        """A text that changes with the map, as far as one can tell without decoding it."""
        ...

    @property
    def pinhole(self) -> Pinhole | None:
        """Its own intrinsics, at its size; None where it covers what the picture covers."""
        ...

    @property
    def picture_from_depth(self) -> Rigid[Cam, Cam] | None:
        """Where its camera is, seen from the picture's; None where they are at the same place."""
        ...

    def read(self) -> Float32[np.ndarray, "h w"] | None:
        """Decode it to metres, 0 = unknown; None where nothing is known.

        Raises:
            RecordingError: It cannot be read.
        """
        ...


@dataclass(frozen=True)
class StoredPicture:
    """A picture in a file of its own."""

    path: Path
    size_px: tuple[int, int]
    within: Path | None = None

    @classmethod
    def at(cls, path: Path, *, within: Path | None = None) -> StoredPicture:
        """Read its size from its header.

        Raises:
            RecordingError: It cannot be read, or is no picture.
        """
        return cls(path, picture_size_px(path, within=within), within)

    @property
    def token(self) -> str:
        """Name and length of the file."""
        return f"{self.path.name}:{_length(self.path)}"

    def read(self) -> UInt8[np.ndarray, "h w 3"]:
        """Decode it."""
        return read_picture(self.path, within=self.within)

    def stored(self) -> bytes | None:
        """Return the bytes of the file, where it is a JPEG or a PNG."""
        data = read_bytes(self.path, within=self.within)
        return data if data.startswith((jpeg.START, png.START)) else None


@dataclass(frozen=True)
class StoredDepth:
    """A depth map in a file of its own.

    Attributes:
        path: The file.
        unit_m: Of its values, in metres.
        size_px: Width and height.
        pinhole: Its own intrinsics; None where it covers what the picture covers.
        picture_from_depth: Where its camera is, seen from the picture's; None: at the same place.
        confidence: A map of the same size that says how sure each value is, where there is one.
        least_confidence: Values that are less sure are unknown.
        within: A folder; links that lead out of it are refused.
    """

    path: Path
    unit_m: float
    size_px: tuple[int, int]
    pinhole: Pinhole | None = None
    picture_from_depth: Rigid[Cam, Cam] | None = None
    confidence: Path | None = None
    least_confidence: int = 1
    within: Path | None = None

    @classmethod
    def at(
        cls,
        path: Path,
        unit_m: float,
        *,
        pinhole: Pinhole | None = None,
        picture_from_depth: Rigid[Cam, Cam] | None = None,
        confidence: Path | None = None,
        least_confidence: int = 1,
        within: Path | None = None,
    ) -> StoredDepth:
        """Read its size from its header.

        Raises:
            RecordingError: It cannot be read, or is no depth map.
        """
        size_px = depth_size_px(path, within=within)
        return cls(
            path,
            unit_m,
            size_px,
            pinhole,
            picture_from_depth,
            confidence,
            least_confidence,
            within,
        )

    @property
    def token(self) -> str:
        """Name and length of the file."""
        return f"{self.path.name}:{_length(self.path)}"

    def read(self) -> Float32[np.ndarray, "h w"] | None:
        """Decode it; what is not sure enough is unknown."""
        depth_m = read_depth(self.path, self.unit_m, within=self.within)
        if depth_m is None or self.confidence is None:
            return depth_m
        sure = read_confidence(self.confidence, within=self.within)
        return surely(depth_m, sure, self.least_confidence)


def read_confidence(path: Path, *, within: Path | None = None) -> UInt8[np.ndarray, "h w"]:
    """Decode a map of confidence: grey, 8 bits.

    Raises:
        RecordingError: It cannot be read, or is of another kind.
    """
    sure = read_grey(path, within=within)
    if sure.ndim != 2 or sure.dtype != np.uint8:
        problem = f"holds {sure.dtype} of shape {sure.shape}"
        raise RecordingError(path, problem, remedy="store confidence as an 8-bit grey PNG")
    return sure


def surely(
    depth_m: Float32[np.ndarray, "h w"], confidence: UInt8[np.ndarray, "hc wc"], least: int
) -> Float32[np.ndarray, "h w"] | None:
    """Return a depth map without what is not sure enough; None where nothing is left."""
    if confidence.shape != depth_m.shape:
        size_px = depth_m.shape[1], depth_m.shape[0]
        confidence = np.asarray(
            cv2.resize(confidence, size_px, interpolation=cv2.INTER_NEAREST_EXACT)
        )
    kept = np.where(confidence >= least, depth_m, np.float32(0))
    return kept if kept.any() else None


@dataclass(frozen=True)
class PosedFrame:
    """One frame of a recording, before anything of it is decoded.

    Attributes:
        name: Of its file, say; made good as a file name and unique by the recording.
        picture: Where its pixels come from.
        lens: Of the stored picture.
        world_from_cam: Its pose, OpenCV axes, metres.
        depth: Where its depth comes from, None without.
        mask: A file that says what counts (not 0), None without.
        points_m: Returns the points of the world that it sees, None where nothing tells them.
        timestamp_s: When it was taken, in seconds.
    """

    name: str
    picture: PictureSource
    lens: Lens
    world_from_cam: Rigid[World, Cam]
    depth: DepthSource | None = None
    mask: Path | None = None
    points_m: Callable[[], Float64[np.ndarray, "n 3"]] | None = None
    timestamp_s: float | None = None

    @property
    def camera(self) -> Camera:
        """Its camera, without distortion."""
        return Camera(self.lens.pinhole, self.world_from_cam)


@dataclass(frozen=True, eq=False)
class PosedRecording:
    """A recording of any format (`datasets.recording.Recording`).

    Attributes:
        name: What reports call it.
        path: The file or folder that errors about the whole recording name.
        format: What people call its format.
        frames: In the order they were taken; at least one.
        notes: Sentences about what was left out or guessed.
        within: The folder that no link may lead out of, where files are handed on.
        pictures: The folder of pictures, where it lies elsewhere than the recording.
    """

    name: str
    path: Path
    format: str
    frames: tuple[PosedFrame, ...]
    notes: tuple[str, ...] = ()
    within: Path | None = None
    pictures: Path | None = None

    def __post_init__(self) -> None:
        if not self.frames:
            raise ValueError("need at least one frame")

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def names(self) -> Sequence[str]:
        """Unique names that are good as file names: the pictures' own where these are unique."""
        return self._names

    @cached_property
    def _names(self) -> tuple[str, ...]:
        stems = [_file_name(frame.name) for frame in self.frames]
        if max(Counter(stems).values()) == 1:
            return tuple(stems)
        return tuple(f"{i:05d}_{stem}" for i, stem in enumerate(stems))

    @property
    def cameras(self) -> Sequence[Camera]:
        """Full-size cameras, without distortion."""
        return self._cameras

    @cached_property
    def _cameras(self) -> tuple[Camera, ...]:
        return tuple(frame.camera for frame in self.frames)

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """Times in seconds, None where the recording has none."""
        return tuple(frame.timestamp_s for frame in self.frames)

    @property
    def has_depth(self) -> Sequence[bool]:
        """Which frames have a depth map in which anything is known.

        Raises:
            RecordingError: A depth map cannot be read: all are, when this is first asked.
        """
        return self._has_depth

    @cached_property
    def _has_depth(self) -> tuple[bool, ...]:
        return tuple(
            frame.depth is not None and frame.depth.read() is not None for frame in self.frames
        )

    def read(self, index: int) -> Frame:
        """Decode one frame, and take the lens's distortion out of it.

        Depth with intrinsics of its own is placed where the picture shows it; what the mask leaves
        out is unknown.

        Raises:
            IndexError: There is no such frame.
            RecordingError: A file is damaged, or changed since the recording was opened.
        """
        frame = self.frames[index]
        rgb = frame.picture.read()
        if (rgb.shape[1], rgb.shape[0]) != frame.lens.pinhole.size_px:
            problem = f"the picture of frame {frame.name} has another size than was stated"
            raise RecordingError(self.path, problem, remedy="open the recording again")
        mask = self._mask(frame)
        depth_m = None if frame.depth is None else frame.depth.read()
        if depth_m is not None and frame.depth is not None and frame.depth.pinhole is not None:
            own, picture = frame.depth.pinhole, frame.camera.pinhole
            if frame.depth.picture_from_depth is None:
                depth_m = placed(depth_m, own, picture)
            else:
                depth_m = moved(depth_m, own, picture, frame.depth.picture_from_depth)
        elif depth_m is not None:
            depth_m = frame.lens.undistorted_depth(depth_m)
        if depth_m is not None and mask is not None:
            depth_m[~mask_resized(mask, depth_m.shape[1], depth_m.shape[0])] = 0.0
        if depth_m is not None and not depth_m.any():
            depth_m = None
        has_points = depth_m is None and frame.points_m is not None
        return Frame(
            name=self.names[index],
            rgb=frame.lens.undistorted(rgb),
            camera=frame.camera,
            depth_m=depth_m,
            timestamp_s=frame.timestamp_s,
            points_m=frame.points_m() if has_points and frame.points_m is not None else None,
            mask=mask,
        )

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return width and height of a frame's depth map, without decoding it; None without one."""
        frame = self.frames[index]
        if frame.depth is None or frame.depth.pinhole is None:
            return None if frame.depth is None else frame.depth.size_px
        return _placed_pinhole(frame.depth.pinhole, frame.lens.pinhole).size_px

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return None: nothing was drawn."""

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return None: nothing was drawn."""

    def group(self, index: int) -> str | None:
        """Return None: frames have no groups."""

    def fingerprint(self) -> str:
        """Return a short name for format, cameras, and names and lengths of files."""
        digest = hashlib.sha256(self.format.encode())
        for frame in self.frames:
            digest.update(f"{frame.name}:{frame.lens}:{frame.picture.token};".encode())
            digest.update(frame.world_from_cam.matrix().tobytes())
            if frame.depth is not None:
                digest.update(f"{frame.depth.token}:{frame.depth.pinhole};".encode())
                if frame.depth.picture_from_depth is not None:
                    digest.update(frame.depth.picture_from_depth.matrix().tobytes())
            if frame.mask is not None:
                digest.update(f"{frame.mask.name}:{_length(frame.mask)};".encode())
        return digest.hexdigest()[:24]

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse beforehand what `write_subset` would refuse to copy.

        Raises:
            RecordingError: A picture is reached by a link that leaves the recording.
        """
        folder = self.pictures or (self.path if self.path.is_dir() else self.path.parent)
        for index in indices:
            picture = self.frames[index].picture
            if isinstance(picture, StoredPicture) and not follow_links:
                read_bytes(picture.path, _KIND_BYTES, within=picture.within or folder)

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> Recording:
        """Write some frames as a data set in nerfstudio's format, and return it opened.

        Pictures are copied, pixels byte for byte, where they are JPEG or PNG and their lens bends
        nothing; depth is placed, and in millimetres.

        Raises:
            ValueError: No indices, one twice, or one that is no frame.
            RecordingError: A file cannot be read, or is reached by a link that leaves the
                recording.
            OutputError: `out` is taken, full or not writable.
        """
        from peaking.datasets import nerfstudio

        if len(indices) == 0 or len(set(indices)) != len(indices):
            raise ValueError(f"need at least one index and none twice, got {list(indices)}")
        if min(indices) < 0 or max(indices) >= len(self):
            raise ValueError(f"need indices in 0..{len(self) - 1}, got {list(indices)}")
        self.check_subset(indices, follow_links=follow_links, keep_exif=keep_exif)
        write_frames(
            (
                WrittenFrame(self.read(i), self.picture_bytes(i, keep_exif=keep_exif), int(i))
                for i in indices
            ),
            out,
        )
        return nerfstudio.open_recording(out)

    def picture_bytes(self, index: int, *, keep_exif: bool = False) -> bytes | None:
        """Return a straight picture as it is stored (JPEG or PNG), without metadata.

        None where it has to be encoded: the lens bends it, it is of another kind, or its metadata
        cannot be taken out.

        Args:
            index: Of the frame.
            keep_exif: Leave metadata in.

        Raises:
            RecordingError: It cannot be read.
        """
        frame = self.frames[index]
        data = None if frame.lens.has_distortion else frame.picture.stored()
        return None if data is None else as_handed_on(data, keep_exif=keep_exif)

    def _mask(self, frame: PosedFrame) -> Bool[np.ndarray, "h w"] | None:
        if frame.mask is None:
            return None
        mask = mask_resized(read_mask(frame.mask, within=self.within), *frame.lens.pinhole.size_px)
        return frame.lens.undistorted_mask(mask)


def placed(
    depth_m: Float32[np.ndarray, "h w"], own: Pinhole, picture: Pinhole
) -> Float32[np.ndarray, "rows columns"]:
    """Return a depth map over the field of view of a picture, at its own pixels' size.

    Both cameras are at the same place and look the same way: LiDAR 4:3 under video 16:9, say.
    Nearest pixel; 0 where the map does not reach.

    Args:
        depth_m: The map.
        own: Its intrinsics, at its size.
        picture: Of the picture.
    """
    height, width = depth_m.shape
    target = _placed_pinhole(own, picture)
    columns, rows = np.arange(target.width_px) + 0.5, np.arange(target.height_px) + 0.5
    x = np.floor((columns - target.cx_px) / target.fx_px * own.fx_px + own.cx_px).astype(int)
    y = np.floor((rows - target.cy_px) / target.fy_px * own.fy_px + own.cy_px).astype(int)
    inside = ((y >= 0) & (y < height))[:, None] & ((x >= 0) & (x < width))[None]
    found = depth_m[np.clip(y, 0, height - 1)[:, None], np.clip(x, 0, width - 1)[None]]
    return np.where(inside, found, np.float32(0))


def moved(
    depth_m: Float32[np.ndarray, "h w"],
    own: Pinhole,
    picture: Pinhole,
    picture_from_depth: Rigid[Cam, Cam],
) -> Float32[np.ndarray, "rows columns"]:
    """Return a depth map as a picture's camera beside the depth camera sees it.

    Each measured point is drawn where it is seen, the nearer of two in front; 0 between them.

    Args:
        depth_m: The map.
        own: Its intrinsics, at its size.
        picture: Of the picture.
        picture_from_depth: Between both cameras.
    """
    target = _placed_pinhole(own, picture)
    known = depth_m > 0
    points_m = picture_from_depth.apply(own.rays()[known] * depth_m[known, None].astype(np.float64))
    xy_px = target.project(points_m)
    inside = (points_m[:, 2] > 0) & (xy_px >= 0).all(axis=1) & (xy_px < target.size_px).all(axis=1)
    x, y = xy_px[inside].astype(int).T
    z_m = points_m[inside, 2].astype(np.float32)
    drawn = np.full((target.height_px, target.width_px), np.inf, np.float32)
    np.minimum.at(drawn, (y, x), z_m)
    return np.where(np.isfinite(drawn), drawn, np.float32(0))


def _placed_pinhole(own: Pinhole, picture: Pinhole) -> Pinhole:
    """Return the picture's camera with pixels as large as those of a depth map."""
    columns = max(1, round(picture.width_px * own.fx_px / picture.fx_px))
    return picture.resized(columns, max(1, round(columns * picture.height_px / picture.width_px)))


def _length(path: Path) -> int:
    return path.stat().st_size


def _file_name(name: str) -> str:
    """Return the last part of a name without its ending, of characters that any disk takes."""
    stem = Path(name.replace("\\", "/")).name
    stem = stem.rsplit(".", 1)[0] if "." in stem[1:] else stem
    kept = "".join(c if c.isalnum() or c in "-_." else "_" for c in stem)
    return kept or "frame"
