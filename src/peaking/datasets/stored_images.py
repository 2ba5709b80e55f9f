"""Pictures and depth maps as they lie in files: size from the header, pixels only if complete.

Decoders are lenient: a file that was cut off by a full card comes back as a picture with a grey
end. Here it is an error. A turn noted in EXIF is ignored, as nerfstudio and COLMAP do.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import simplejpeg
from jaxtyping import Float32, Integer, UInt8

from peaking.errors import RecordingError

_JPEG_START = b"\xff\xd8"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_HEADER_BYTES = 1 << 16

_CUT_OFF = "copy it again from the camera, or leave this frame out"
_DEPTH_FORMAT = "store depth as a 16-bit PNG with one channel, or as an .npy array (height, width)"


def picture_size_px(path: Path) -> tuple[int, int]:
    """Return width and height from the first bytes of a JPEG or PNG.

    Other formats are decoded to find out.

    Raises:
        RecordingError: The file cannot be read or is no picture.
    """
    head = _bytes(path, _HEADER_BYTES)
    if head.startswith(_PNG_START):
        width, height, _, _ = _png_header(path, head)
        return width, height
    if head.startswith(_JPEG_START):
        try:
            height, width, _, _ = simplejpeg.decode_jpeg_header(head)
        except ValueError:  # a thumbnail or colour profile may come first
            try:
                height, width, _, _ = simplejpeg.decode_jpeg_header(_bytes(path))
            except ValueError as error:
                raise RecordingError(
                    path, f"not a sound JPEG ({error})", remedy=_CUT_OFF
                ) from error
        return int(width), int(height)
    height, width = read_picture(path).shape[:2]
    return width, height


def read_picture(path: Path) -> UInt8[np.ndarray, "h w 3"]:
    """Decode a picture to RGB; transparent parts become white, as NeRF's synthetic scenes want.

    Raises:
        RecordingError: The file cannot be read, is no picture, or is not complete.
    """
    data = _bytes(path)
    if data.startswith(_JPEG_START):
        try:
            return simplejpeg.decode_jpeg(data, "RGB")
        except ValueError as error:
            raise RecordingError(path, f"not a sound JPEG ({error})", remedy=_CUT_OFF) from error
    stored = _decode(path, data)
    if stored.dtype == np.uint16:
        stored = np.round(stored / 257.0).astype(np.uint8)
    if stored.dtype != np.uint8:
        raise RecordingError(
            path, f"has pixels of type {stored.dtype}", remedy="store it as JPEG or 8-bit PNG"
        )
    if stored.ndim == 2:
        return cv2.cvtColor(stored, cv2.COLOR_GRAY2RGB)
    if stored.shape[2] == 4:
        alpha = stored[..., 3:].astype(np.float32) / 255
        over_white = stored[..., :3] * alpha + 255 * (1 - alpha)
        stored = np.round(over_white).astype(np.uint8)
    return cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)


def depth_size_px(path: Path) -> tuple[int, int]:
    """Return width and height of a depth map from its header.

    Raises:
        RecordingError: The file cannot be read or is no depth map (16-bit grey PNG or .npy).
    """
    if path.suffix.lower() == ".npy":
        height, width = _npy(path).shape
        return width, height
    width, height, bits, color = _png_header(path, _bytes(path, _HEADER_BYTES))
    if (bits, color) != (16, 0):
        channels = {0: "grey", 2: "RGB", 3: "palette", 4: "grey and alpha", 6: "RGBA"}
        raise RecordingError(
            path, f"is {bits}-bit {channels.get(color, 'unknown')}", remedy=_DEPTH_FORMAT
        )
    return width, height


def read_depth(path: Path, unit_m: float) -> Float32[np.ndarray, "h w"]:
    """Decode a depth map to metres, 0 = unknown.

    Raises:
        RecordingError: The file cannot be read, is not complete, or holds no known depth at all.
    """
    if path.suffix.lower() == ".npy":
        stored = _npy(path).astype(np.float32)
        stored = np.where(np.isfinite(stored) & (stored > 0), stored, np.float32(0))
    else:
        stored = _decode(path, _bytes(path)).astype(np.float32)
    if not stored.any():
        raise RecordingError(
            path,
            "holds no known depth: every pixel is 0",
            remedy="remove depth_file_path from this frame, or leave the frame out",
        )
    return stored * np.float32(unit_m)


def read_grey(path: Path) -> Integer[np.ndarray, "h w"]:
    """Decode a grey picture of 8 or 16 bits as it is stored.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    return _decode(path, _bytes(path))


def _bytes(path: Path, count: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            data = file.read(count)
    except OSError as error:
        raise RecordingError(
            path, f"cannot be read ({error.strerror})", remedy="check the file and its rights"
        ) from error
    if not data:
        raise RecordingError(path, "is empty", remedy=_CUT_OFF)
    return data


def _decode(path: Path, data: bytes) -> np.ndarray:
    if data.startswith(_PNG_START):
        _check_complete_png(path, data)
    how = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    stored = cv2.imdecode(np.frombuffer(data, np.uint8), how)
    if stored is None:
        raise RecordingError(
            path, "is not a picture that can be decoded", remedy="store it as JPEG or PNG"
        )
    return stored


def _png_header(path: Path, head: bytes) -> tuple[int, int, int, int]:
    """Return width, height, bits per channel and colour type (PNG specification, 11.2.2)."""
    if not head.startswith(_PNG_START):
        raise RecordingError(path, "is not a PNG", remedy=_DEPTH_FORMAT)
    if len(head) < 26 or head[12:16] != b"IHDR":
        raise RecordingError(path, "is cut off in the PNG header", remedy=_CUT_OFF)
    return struct.unpack(">IIBB", head[16:26])


def _check_complete_png(path: Path, data: bytes) -> None:
    """Walk the chunks up to IEND and compare their checksums (PNG specification, 5.3)."""
    view, start, kind = memoryview(data), len(_PNG_START), b""
    while kind != b"IEND":
        if start + 12 > len(data):
            raise RecordingError(path, "is cut off: the PNG has no end", remedy=_CUT_OFF)
        (length,) = struct.unpack_from(">I", data, start)
        end = start + 8 + length
        kind = data[start + 4 : start + 8]
        if end + 4 > len(data):
            raise RecordingError(path, "is cut off: the PNG has no end", remedy=_CUT_OFF)
        (checksum,) = struct.unpack_from(">I", data, end)
        if zlib.crc32(view[start + 4 : end]) != checksum:
            raise RecordingError(path, "is damaged: a PNG checksum differs", remedy=_CUT_OFF)
        start = end + 4


def _npy(path: Path) -> np.ndarray:
    """Map an .npy file into memory; its length is checked against its header."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise RecordingError(path, f"is not a sound .npy ({error})", remedy=_CUT_OFF) from error
    if array.ndim != 2 or array.dtype.kind not in "uif" or array.size == 0:
        raise RecordingError(
            path, f"holds {array.dtype} of shape {array.shape}", remedy=_DEPTH_FORMAT
        )
    return array
