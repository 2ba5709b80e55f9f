"""An upload as it comes from a phone: checked before anything is made of a size that it claims."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import simplejpeg
from jaxtyping import Float32, UInt16

from peaking.errors import PeakingError
from peaking.foreign_json import decode_json
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.output import SATURATED_MM
from peaking.pictures.jpeg import EOI, BrokenOff, check_jpeg, segments
from peaking.pictures.metadata import jpeg_without_metadata
from peaking.pictures.too_costly import TooCostly
from peaking.server import wire
from peaking.server.responses import ProblemKind

MAX_HEADER_BYTES = 20_000
PRINCIPAL_POINT_RANGE = (-1.0, 2.0)
"""Where the principal point may lie, in sizes of the picture: crops move it, not further."""

MAX_DISTANCE_M = 1e5
"""Coordinates of tracked points lie within this: float32 has 4 mm there."""

BYTES_OF_POINT = 12


class BadUpload(PeakingError):
    """An upload that cannot be used, now or later; the message is a sentence for the phone."""

    def __init__(self, problem: str, *, status: int = 422, kind: ProblemKind = "invalid") -> None:
        """Keep the sentence, the HTTP status and the kind of problem."""
        super().__init__(problem)
        self.status = status
        self.kind: ProblemKind = kind


class CutOff(BadUpload):
    """Not all of it arrived: it is to be sent again."""

    def __init__(self, cause: str) -> None:
        """Keep what is missing."""
        super().__init__(
            f"The upload was cut off ({cause}). Send it again.", status=400, kind="cut-off"
        )


def check_protocol(spoken: int, *, by: str) -> None:
    """Refuse another version of the protocol.

    Raises:
        BadUpload: It is another one.
    """
    if spoken != wire.PROTOCOL:
        raise BadUpload(
            f"This server speaks version {wire.PROTOCOL} of the protocol, the {by} version "
            f"{spoken}. Reload the page, or update the older of the two.",
            status=400,
            kind="protocol",
        )


@dataclass(frozen=True)
class Upload:
    """A capture as it was sent: camera, photo, and what the phone knows about distances.

    Attributes:
        header: What it says of itself.
        photo: A JPEG.
        depth_mm: Along +z, 0 = unknown; None where nothing is known.
        points_m: Tracked points, in the world.
    """

    header: wire.CaptureHeader
    photo: bytes
    depth_mm: UInt16[np.ndarray, "h w"] | None
    points_m: Float32[np.ndarray, "n 3"] | None = None

    def taken_s(self, arrived_s: float) -> float:
        """Return when the photo was taken, by the clock that says when it began to arrive.

        Clients that do not say when they sent it are believed in what their own clock says.
        """
        sent_s, time_s = self.header.sent_s, self.header.time_s
        return time_s if sent_s is None else arrived_s - max(0.0, sent_s - time_s)


def parse_upload(body: bytes | bytearray, *, keep_exif: bool = False) -> Upload:
    """Take an upload apart.

    Args:
        body: As docs/protocol.md has it.
        keep_exif: Keep the photo's metadata: where, when and with what it was taken.

    Raises:
        BadUpload: Anything about it is wrong.
        CutOff: A part is missing at its end, or at the end of its photo.
    """
    header, rest = _header(memoryview(body))
    check_protocol(header.protocol, by="phone")
    camera_of_wire(header.camera)
    if header.corrected_world_from_cam is not None:
        pose_of_wire(header.corrected_world_from_cam, name="corrected_world_from_cam")
    if len(rest) < header.photo_bytes:
        raise CutOff(f"photo_bytes is {header.photo_bytes}, but {len(rest)} bytes arrived")
    photo, rest = rest[: header.photo_bytes], rest[header.photo_bytes :]
    bare = _checked_photo(photo, header.camera.pinhole)
    depth_bytes = 2 * header.depth.width_px * header.depth.height_px if header.depth else 0
    points_bytes = BYTES_OF_POINT * header.points
    if len(rest) != depth_bytes + points_bytes:
        what = (
            f"{len(rest)} bytes of depth and points arrived, but the header says {depth_bytes} and "
            f"{points_bytes}"
        )
        if len(rest) < depth_bytes + points_bytes:
            raise CutOff(what)
        raise BadUpload(f"{what}.", status=400)
    depth_mm, points_m = _depth(rest[:depth_bytes], header), _points(rest[depth_bytes:])
    return Upload(header, bytes(photo) if keep_exif else bare, depth_mm, points_m)


def camera_of_wire(camera: wire.Camera) -> Camera:
    """Return a camera as the stages take it.

    Raises:
        BadUpload: The pose is not rigid, or the principal point is far off the picture.
    """
    k = camera.pinhole
    low, high = PRINCIPAL_POINT_RANGE
    for name, value, size in (("cx_px", k.cx_px, k.width_px), ("cy_px", k.cy_px, k.height_px)):
        if not low * size <= value <= high * size:
            raise BadUpload(f"camera.pinhole.{name} is {value}, far outside the picture.")
    pose = pose_of_wire(camera.world_from_cam, name="camera.world_from_cam")
    pinhole = Pinhole(
        k.width_px, k.height_px, float(k.fx_px), float(k.fy_px), float(k.cx_px), float(k.cy_px)
    )
    return Camera(pinhole, pose)


def pose_of_wire(pose: wire.Pose, *, name: str) -> Rigid[World, Cam]:
    """Return a pose as the stages take it; `name` is what an error calls it.

    Raises:
        BadUpload: It is not rigid.
    """
    matrix = np.eye(4)
    matrix[:3] = np.array(pose).reshape(3, 4)
    try:
        return Rigid[World, Cam].from_matrix(matrix)
    except ValueError as error:
        raise BadUpload(f"{name}: {error}.") from error


def _header(body: memoryview) -> tuple[wire.CaptureHeader, memoryview]:
    if len(body) < 4:
        raise CutOff("it is shorter than its own header")
    (length,) = struct.unpack_from("<I", body)
    if not 2 <= length <= MAX_HEADER_BYTES:
        raise BadUpload(f"A header has 2 to {MAX_HEADER_BYTES:,} bytes, not {length}.", status=400)
    if length > len(body) - 4:
        raise CutOff(f"the header claims {length} bytes, but the upload has only {len(body)}")
    try:
        header = decode_json(body[4 : 4 + length], wire.CaptureHeader)
    except ValueError as error:
        raise BadUpload(f"The header is not valid: {error}.") from error
    return header, body[4 + length :]


def _checked_photo(photo: memoryview, pinhole: wire.Pinhole) -> bytes:
    """Return the JPEG without metadata, after a look at its size and scans; nothing is decoded."""
    try:
        parts = list(segments(photo))
        if not parts or parts[-1].marker != EOI:
            raise CutOff("the photo has no end")
        width, height = check_jpeg(photo, parts)
        bare = jpeg_without_metadata(photo, parts)
        told_height, told_width, _, _ = simplejpeg.decode_jpeg_header(bare)
    except TooCostly as error:
        raise BadUpload(f"The photo {error}; {error.remedy}.") from error
    except BrokenOff as error:
        raise CutOff(f"the photo {error}") from error
    except (ValueError, KeyError) as error:  # KeyError: simplejpeg does not know its colours
        raise BadUpload(f"The photo is not a readable JPEG ({error}).") from error
    if (width, height) != (told_width, told_height):
        raise BadUpload("The photo is not a readable JPEG (its size is not clear).")
    if (width, height) != (pinhole.width_px, pinhole.height_px):
        raise BadUpload(
            f"The photo has {width}x{height} pixels, but its camera says "
            f"{pinhole.width_px}x{pinhole.height_px}."
        )
    return bare


def _depth(data: memoryview, header: wire.CaptureHeader) -> UInt16[np.ndarray, "h w"] | None:
    layout = header.depth
    if layout is None:
        return None
    # One depth pixel more or less changes the aspect; more is another field of view.
    k = header.camera.pinhole
    width, height = layout.width_px, layout.height_px
    if abs(width * k.height_px - height * k.width_px) > max(k.width_px, k.height_px):
        raise BadUpload(
            f"The depth map ({width}x{height}) and the photo ({k.width_px}x{k.height_px}) differ "
            "in aspect ratio. Crop the depth map to the photo's field of view."
        )
    depth_mm = np.frombuffer(data, "<u2").astype(np.uint16).reshape(height, width)
    depth_mm[depth_mm == SATURATED_MM] = 0
    return depth_mm if depth_mm.any() else None


def _points(data: memoryview) -> Float32[np.ndarray, "n 3"] | None:
    if not data:
        return None
    points_m = np.frombuffer(data, "<f4").astype(np.float32).reshape(-1, 3)
    # NaN is not within it either.
    wrong = np.flatnonzero(~(np.abs(points_m) <= MAX_DISTANCE_M).all(axis=1))
    if len(wrong):
        x, y, z = points_m[wrong[0]]
        raise BadUpload(
            f"Point {wrong[0]} is ({x:g}, {y:g}, {z:g}). Points are in metres, in the world, "
            f"within {MAX_DISTANCE_M:g}."
        )
    return points_m
