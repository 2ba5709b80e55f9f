"""Pictures and depth maps as they lie in files: size from the header, pixels only if complete.

Decoders are lenient: a file that was cut off by a full card comes back as a picture with a grey
end. Here it is an error. A turn noted in EXIF is ignored, as nerfstudio and COLMAP do.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import simplejpeg
from jaxtyping import Bool, Float32, Integer, UInt8
from numpy.lib.format import open_memmap

from peaking.datasets.foreign_files import read_bytes, real_path
from peaking.errors import RecordingError
from peaking.limits import MAX_PICTURE_BYTES
from peaking.pictures import jpeg, png, webp
from peaking.pictures.decoding import decode_jpeg, decode_stored
from peaking.pictures.metadata import is_removable, without_metadata
from peaking.pictures.too_costly import TooCostly, check_pixels

T = TypeVar("T")
V = TypeVar("V")

_HEADER_BYTES = 1 << 16
_BAND_ROWS = 256
"""Converted at once: the intermediate floats of a whole large picture would fill the memory."""

_CUT_OFF = "copy it again from the camera, or leave this frame out"
_DEPTH_FORMAT = "store depth as a 16-bit PNG with one channel, or as an .npy array (height, width)"


def picture_size_px(path: Path, *, within: Path | None = None) -> tuple[int, int]:
    """Return width and height from the first bytes of a JPEG, PNG or WebP.

    Other formats are decoded to find out.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, is no picture, or is larger than what is read.
    """
    head = _head(path, within)
    if head.startswith(png.START):
        width, height, _, _ = _explained(path, png.png_header, head)
        return width, height
    if head.startswith(jpeg.START):
        try:
            height, width, _, _ = simplejpeg.decode_jpeg_header(head)
        except ValueError:  # a thumbnail or colour profile may come first
            return _explained(path, jpeg.check_jpeg, _picture_bytes(path, within))
        _explained(path, lambda size_px: check_pixels(*size_px), (int(width), int(height)))
        return int(width), int(height)
    if webp.is_webp(head):
        return _explained(path, webp.check_webp, head)
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
    data = _picture_bytes(path, within)
    if data.startswith(jpeg.START):
        return _explained(path, decode_jpeg, data)
    stored = _explained(path, decode_stored, data)
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


def depth_size_px(path: Path, *, within: Path | None = None) -> tuple[int, int]:
    """Return width and height of a depth map from its header.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read or is no depth map (16-bit grey PNG or .npy).
    """
    if path.suffix.lower() == ".npy":
        height, width = _npy(path, within).shape
        return width, height
    head = _head(path, within)
    width, height, bits, color = _explained(path, png.png_header, head, remedy=_DEPTH_FORMAT)
    if (bits, color) != (16, 0):
        channels = {0: "grey", 2: "RGB", 3: "palette", 4: "grey and alpha", 6: "RGBA"}
        raise RecordingError(path, f"is {bits}-bit {channels[color]}", remedy=_DEPTH_FORMAT)
    return width, height


def is_floating(path: Path, *, within: Path | None = None) -> bool:
    """Return whether a depth map, whose header is sound, holds floating-point numbers.

    Raises:
        RecordingError: The file cannot be read.
    """
    return path.suffix.lower() == ".npy" and _npy(path, within).dtype.kind == "f"


def read_depth(
    path: Path, unit_m: float, *, within: Path | None = None
) -> Float32[np.ndarray, "h w"] | None:
    """Decode a depth map to metres, 0 = unknown; None where nothing is known.

    Unknown is what is not finite or not > 0, and the largest number of integers and of 16-bit
    floats: what a sensor writes where it measures nothing, or a program where something is too far.

    Args:
        path: The file.
        unit_m: Of its values, in metres.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    if path.suffix.lower() == ".npy":
        stored = _npy(path, within)
    else:
        stored = _explained(path, decode_stored, _picture_bytes(path, within))
    if stored.ndim != 2:
        raise RecordingError(path, f"has shape {stored.shape}", remedy=_DEPTH_FORMAT)
    with np.errstate(over="ignore"):  # what float32 has no room for is unknown
        depth_m = stored.astype(np.float32) * np.float32(unit_m)
    known = np.isfinite(depth_m) & (depth_m > 0)
    most = _largest(stored.dtype)
    if most is not None:
        known &= stored != most
    return np.where(known, depth_m, np.float32(0)) if known.any() else None


def read_mask(path: Path, *, within: Path | None = None) -> Bool[np.ndarray, "h w"]:
    """Decode a mask, grey or of several channels: what is 0 in the first one does not count.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    stored = _explained(path, decode_stored, _picture_bytes(path, within))
    return (stored if stored.ndim == 2 else stored[..., 0]) > 0


def read_grey(path: Path, *, within: Path | None = None) -> Integer[np.ndarray, "h w"]:
    """Decode a grey picture of 8 or 16 bits as it is stored.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
    """
    return _explained(path, decode_stored, _picture_bytes(path, within))


def _largest(kind: np.dtype) -> float | None:
    """Return the largest number of a type where it is no measurement: of all but large floats."""
    if kind.kind in "ui":
        return float(np.iinfo(kind).max)
    return float(np.finfo(kind).max) if kind.itemsize == 2 else None


def _head(path: Path, within: Path | None) -> bytes:
    return _not_empty(path, read_bytes(path, _HEADER_BYTES, within=within))


def _picture_bytes(path: Path, within: Path | None) -> bytes:
    return _not_empty(path, read_bytes(path, within=within, at_most=MAX_PICTURE_BYTES))


def _not_empty(path: Path, data: bytes) -> bytes:
    if not data:
        raise RecordingError(path, "is empty", remedy=_CUT_OFF)
    return data


def _explained(path: Path, look: Callable[[V], T], at: V, *, remedy: str = _CUT_OFF) -> T:
    """Look at the bytes of a file; what is wrong with them is said with its name."""
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


def _npy(path: Path, within: Path | None) -> np.ndarray:
    """Map an .npy file into memory; its length is checked against its header."""
    with real_path(path, within=within) as opened:
        try:
            array = open_memmap(opened, mode="r")  # np.load opens archives and pickles too
        except Exception as error:  # damaged bytes raise anything
            raise RecordingError(path, f"is not a sound .npy ({error})", remedy=_CUT_OFF) from error
    if array.ndim != 2 or array.dtype.kind not in "uif" or array.size == 0:
        raise RecordingError(
            path, f"holds {array.dtype} of shape {array.shape}", remedy=_DEPTH_FORMAT
        )
    _explained(path, lambda shape: check_pixels(shape[1], shape[0]), array.shape)
    return array
