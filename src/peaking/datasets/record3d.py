"""Record3D's .r3d: a zip with `metadata` (JSON) and rgbd/N.jpg, N.depth, N.conf.

Poses are camera-to-world, OpenGL axes, as qx qy qz qw x y z; K is stored by columns; newer files
have the intrinsics of every frame (marek-simonik/record3d, issues 7, 33, 36). Depth is float32
metres, confidence 0, 1, 2, both packed with LZFSE (extra `record3d`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from jaxtyping import Float32, Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.datasets.lens import Lens, same_aspect
from peaking.datasets.lzfse_blocks import unpacked
from peaking.datasets.posed_frames import PosedFrame, PosedRecording, StoredPicture, surely
from peaking.datasets.text_tables import backwards, counted, in_number_order, rotation_of_quaternion
from peaking.errors import RecordingError
from peaking.foreign_json import decode_json
from peaking.geometry import OPENCV_FROM_OPENGL, Cam, Pinhole, Rigid, World

METADATA = "metadata"
_MAX_METADATA_BYTES = 1 << 28
_MAX_PACKED_BYTES = 1 << 26
_SIDES_PX = (1, 4096)
_AGAIN = "export the .r3d again from Record3D"


class _Metadata(msgspec.Struct):
    """What is read of `metadata`."""

    w: int
    h: int
    poses: list[list[float]]
    dw: int | None = None
    dh: int | None = None
    fps: float | None = None
    K: list[float] | None = None
    perFrameIntrinsicCoeffs: list[list[float]] | None = None  # noqa: N815
    frameTimestamps: list[float] | None = None  # noqa: N815


@dataclass(frozen=True)
class LzfseDepth:
    """A packed depth map and its confidence (`posed_frames.DepthSource`)."""

    path: Path
    size_px: tuple[int, int]
    pinhole: Pinhole | None
    confidence: Path | None
    within: Path | None
    picture_from_depth: Rigid[Cam, Cam] | None = None

    @property
    def token(self) -> str:
        """Name and length of the file."""
        return f"{self.path.name}:{self.path.stat().st_size}"

    def read(self) -> Float32[np.ndarray, "h w"] | None:
        """Unpack it; what is not sure is unknown.

        Raises:
            RecordingError: It is damaged, or of another size than stated.
            ToolMissing: The extra `record3d` is not installed.
        """
        width, height = self.size_px
        data = _unpacked(self.path, 4 * width * height, self.within)
        depth_m = np.frombuffer(data, "<f4").reshape(height, width).astype(np.float32)
        with np.errstate(invalid="ignore"):
            depth_m = np.where(np.isfinite(depth_m) & (depth_m > 0), depth_m, np.float32(0))
        if self.confidence is not None:
            sure = _unpacked(self.confidence, width * height, self.within)
            return surely(depth_m, np.frombuffer(sure, np.uint8).reshape(height, width), 1)
        return depth_m if depth_m.any() else None


def recognises(path: Path) -> bool:
    """Return whether a folder is an unpacked .r3d."""
    return (path / METADATA).is_file() and (path / "rgbd").is_dir()


def open_recording(root: Path, *, confined: bool = False) -> PosedRecording:
    """Open an unpacked .r3d.

    Args:
        root: The folder that holds `metadata` and rgbd/.
        confined: Read no file through a link that leaves the folder, now and later.

    Raises:
        RecordingError: The first thing that is wrong, with its file, field and remedy.
    """
    within = root if confined else None
    path = root / METADATA
    try:
        data = read_bytes(path, within=within, at_most=_MAX_METADATA_BYTES)
        metadata = decode_json(data, _Metadata)
    except ValueError as error:
        raise RecordingError(path, str(error), remedy=_AGAIN) from error
    pictures = in_number_order(list((root / "rgbd").glob("*.jpg")))
    reader = _Reader(root, path, metadata, within)
    frames: list[PosedFrame] = []
    for picture_path in pictures:
        number = int(picture_path.stem) if picture_path.stem.isdecimal() else len(metadata.poses)
        if number < len(metadata.poses):
            frame = reader.frame(number, picture_path)
            frames += [] if frame is None else [frame]
    if not frames:
        raise RecordingError(path, "has no finite pose of any picture", remedy=_AGAIN)
    notes = counted(len(pictures) - len(frames), "without a finite pose")
    notes += backwards([frame.timestamp_s for frame in frames])
    return PosedRecording(
        root.resolve().name, root, "record3d", tuple(frames), tuple(notes), within
    )


@dataclass(frozen=True)
class _Reader:
    root: Path
    path: Path
    metadata: _Metadata
    within: Path | None

    def frame(self, number: int, picture_path: Path) -> PosedFrame | None:
        """Return a frame; None where it was not tracked."""
        pose = self._pose(number)
        if pose is None:
            return None
        picture = StoredPicture.at(picture_path, within=self.within)
        pinhole = self._pinhole(number)
        lens = Lens(pinhole.resized(*picture.size_px), (0.0, 0.0, 0.0, 0.0, 0.0))
        times_s, fps = self.metadata.frameTimestamps, self.metadata.fps
        time_s = None
        if times_s is not None and number < len(times_s):
            time_s = float(times_s[number])
        elif fps:
            time_s = number / fps
        return PosedFrame(
            picture_path.name,
            picture,
            lens,
            pose,
            depth=self._depth(picture_path, pinhole),
            timestamp_s=time_s,
        )

    def _pose(self, number: int) -> Rigid[World, Cam] | None:
        values = np.array(self.metadata.poses[number], dtype=np.float64)
        place = f"poses[{number}]"
        if values.shape != (7,):
            raise self._wrong(place, f"need 7 numbers, got {len(values)}")
        if not np.isfinite(values).all():
            return None
        if abs(np.linalg.norm(values[:4]) - 1) > 0.05:
            raise self._wrong(place, "need a quaternion of length 1")
        rotation = rotation_of_quaternion(values[:4]) @ OPENCV_FROM_OPENGL[:3, :3]
        return Rigid(rotation, values[4:])

    def _pinhole(self, number: int) -> Pinhole:
        """Return the intrinsics of a frame, at the size that metadata states."""
        field, k = "K", self._shared
        own = self.metadata.perFrameIntrinsicCoeffs
        if own is not None and number < len(own) and len(own[number]) >= 4:
            field, k = f"perFrameIntrinsicCoeffs[{number}]", np.array(own[number][:4])
        if k is None:
            raise self._wrong(field, "need 9 numbers, or intrinsics of every frame")
        try:
            return Pinhole(self.metadata.w, self.metadata.h, *(float(value) for value in k))
        except ValueError as error:
            raise self._wrong(field, str(error)) from error

    @cached_property
    def _shared(self) -> Float64[np.ndarray, "4"] | None:
        k = self.metadata.K
        return None if k is None or len(k) != 9 else np.array([k[0], k[4], k[6], k[7]])

    def _depth(self, picture_path: Path, picture: Pinhole) -> LzfseDepth | None:
        path = picture_path.with_suffix(".depth")
        if not path.is_file():
            return None
        width, height = self.metadata.dw or 192, self.metadata.dh or 256
        low, high = _SIDES_PX
        if not (low <= width <= high and low <= height <= high):
            raise self._wrong("dw, dh", f"need a size of 1 to {high}, got {width}x{height}")
        sure = path.with_suffix(".conf")
        return LzfseDepth(
            path,
            (width, height),
            _own_pinhole(picture, width, height),
            sure if sure.is_file() else None,
            self.within,
        )

    def _wrong(self, field: str, problem: str) -> RecordingError:
        return RecordingError(self.path, problem, field=field, remedy=_AGAIN)


def _own_pinhole(picture: Pinhole, width_px: int, height_px: int) -> Pinhole | None:
    """Return the depth's intrinsics where its aspect is another than the picture's, else None.

    The sensor is then seen whole, and the picture is cut from its middle: 16:9 out of 4:3.
    """
    if same_aspect((width_px, height_px), picture.size_px):
        return None
    scale = min(width_px / picture.width_px, height_px / picture.height_px)
    return Pinhole(
        width_px,
        height_px,
        picture.fx_px * scale,
        picture.fy_px * scale,
        (picture.cx_px - picture.width_px / 2) * scale + width_px / 2,
        (picture.cy_px - picture.height_px / 2) * scale + height_px / 2,
    )


def _unpacked(path: Path, num_bytes: int, within: Path | None) -> bytes:
    packed = read_bytes(path, within=within, at_most=_MAX_PACKED_BYTES)
    try:
        return unpacked(packed, num_bytes)
    except ValueError as error:
        raise RecordingError(path, str(error), remedy=_AGAIN) from error
