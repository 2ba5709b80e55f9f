"""Pictures and masks as they lie in files: size from the header, pixels only if complete.

Decoders are lenient: a file that was cut off by a full card comes back as a picture with a grey
end. Here it is an error. A turn noted in EXIF is ignored, as nerfstudio and COLMAP do; that of a
HEIC is a part of how it is decoded.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import simplejpeg
from jaxtyping import Bool, Integer, UInt8

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.limits import MAX_PICTURE_BYTES
from peaking.pictures import heif, jpeg, png, webp
from peaking.pictures.decoding import decode_jpeg, decode_stored, heif_head
from peaking.pictures.metadata import is_removable, without_metadata
from peaking.pictures.too_costly import TooCostly, check_pixels

T = TypeVar("T")
V = TypeVar("V")

HEADER_BYTES = 1 << 16
_BAND_ROWS = 256
"""Converted at once: the intermediate floats of a whole large picture would fill the memory."""

CUT_OFF = "copy it again from the camera, or leave this frame out"


def picture_size_px(path: Path, *, within: Path | None = None) -> tuple[int, int]:
    """Return width and height from the first bytes of a JPEG, PNG or WebP.

    Other formats are decoded to find out.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, is no picture, or is larger than what is read.
    """
    head = head_of(path, within)
    if head.startswith(png.START):
        width, height, _, _ = explained(path, png.png_header, head)
        return width, height
    if head.startswith(jpeg.START):
        try:
            height, width, _, _ = simplejpeg.decode_jpeg_header(head)
        except ValueError:  # a thumbnail or colour profile may come first
            return explained(path, jpeg.check_jpeg, picture_bytes(path, within))
        explained(path, lambda size_px: check_pixels(*size_px), (int(width), int(height)))
        return int(width), int(height)
    if webp.is_webp(head):
        return explained(path, webp.check_webp, head)
    if heif.is_heif(head):
        return explained(path, heif_head, picture_bytes(path, within))[:2]
    height, width = read_picture(path, within=within).shape[:2]
    return width, height


def read_picture(path: Path, *, within: Path | None = None) -> UInt8[np.ndarray, "h w 3"]:
    """Decode a picture to RGB; transparent parts become white, as NeRF's synthetic scenes want.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, is no picture, is not complete, or would take too
            much memory or time (`peaking.limits`).
    """
    data = picture_bytes(path, within)
    if data.startswith(jpeg.START):
        return explained(path, decode_jpeg, data)
    stored = explained(path, decode_stored, data)
    if stored.dtype.str not in ("|u1", "<u2"):
        raise RecordingError(
            path, f"has pixels of type {stored.dtype}", remedy="store it as JPEG or 8-bit PNG"
        )
    rgb = np.empty((*stored.shape[:2], 3), np.uint8)
    for top in range(0, len(stored), _BAND_ROWS):
        band = slice(top, top + _BAND_ROWS)
        rgb[band] = _rgb_of(stored[band])
    return rgb


def as_handed_on(data: bytes, *, keep_exif: bool = False) -> bytes | None:
    """Return the bytes of a picture as others get them; None where it has to be encoded again.

    That is what is neither JPEG nor PNG, and what has metadata that cannot be taken out.

    Args:
        data: Of the stored file.
        keep_exif: Leave metadata in.
    """
    if not data.startswith((jpeg.START, png.START)):
        return None
    if keep_exif:
        return data
    try:
        return without_metadata(data) if is_removable(data) else None
    except ValueError:
        return None


def read_mask(path: Path, *, within: Path | None = None) -> Bool[np.ndarray, "h w"]:
    """Decode a mask, grey or of several channels: what is 0 in the first one does not count.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    stored = explained(path, decode_stored, picture_bytes(path, within))
    return (stored if stored.ndim == 2 else stored[..., 0]) > 0


def read_grey(path: Path, *, within: Path | None = None) -> Integer[np.ndarray, "h w"]:
    """Decode a grey picture of 8 or 16 bits as it is stored.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    return explained(path, decode_stored, picture_bytes(path, within))


def head_of(path: Path, within: Path | None) -> bytes:
    """Return the first bytes of a file.

    Raises:
        RecordingError: It cannot be read, or is empty.
    """
    return _not_empty(path, read_bytes(path, HEADER_BYTES, within=within))


def picture_bytes(path: Path, within: Path | None) -> bytes:
    """Return all bytes of a picture or a depth map.

    Raises:
        RecordingError: It cannot be read, is empty, or has more than is read.
    """
    return _not_empty(path, read_bytes(path, within=within, at_most=MAX_PICTURE_BYTES))


def _not_empty(path: Path, data: bytes) -> bytes:
    if not data:
        raise RecordingError(path, "is empty", remedy=CUT_OFF)
    return data


def explained(path: Path, look: Callable[[V], T], at: V, *, remedy: str = CUT_OFF) -> T:
    """Look at the bytes of a file; what is wrong with them is said with its name.

    Raises:
        RecordingError: Something is.
    """
    try:
        return look(at)
    except TooCostly as error:
        raise RecordingError(path, str(error), remedy=error.remedy) from error
    except ValueError as error:
        raise RecordingError(path, str(error), remedy=remedy) from error
    except MemoryError as error:
        problem = "needs more memory than there is"
        raise RecordingError(path, problem, remedy="make the picture smaller") from error


def _rgb_of(stored: np.ndarray) -> np.ndarray:
    if stored.dtype == np.uint16:
        stored = np.round(stored / 257.0).astype(np.uint8)
    if stored.ndim == 2:
        return cv2.cvtColor(stored, cv2.COLOR_GRAY2RGB)
    if stored.shape[2] == 4:
        alpha = stored[..., 3:].astype(np.float32) / 255
        over_white = stored[..., :3] * alpha + 255 * (1 - alpha)
        stored = np.round(over_white).astype(np.uint8)
    return cv2.cvtColor(stored, cv2.COLOR_BGR2RGB)
