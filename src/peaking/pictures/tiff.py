"""What the header of a TIFF says of its first picture (Adobe's TIFF 6.0)."""

from __future__ import annotations

import struct
from dataclasses import dataclass

STARTS = (b"II*\0", b"MM\0*")
_WIDTH, _HEIGHT, _BITS, _CHANNELS, _KIND = 256, 257, 258, 277, 339
_MOST_TAGS = 4096
_SIZES = {1: "B", 3: "H", 4: "I"}


@dataclass(frozen=True)
class TiffHeader:
    """What the header says.

    Attributes:
        width_px: Width.
        height_px: Height.
        bits: Of a number.
        channels: Numbers of a pixel.
        is_floating: Whether numbers are floating-point.
        is_signed: Whether they are whole and may be negative.
    """

    width_px: int
    height_px: int
    bits: int
    channels: int
    is_floating: bool
    is_signed: bool


def is_tiff(data: bytes) -> bool:
    """Return whether a file begins as a TIFF does."""
    return data.startswith(STARTS)


def tiff_header(data: bytes) -> TiffHeader:
    """Read the header.

    Args:
        data: The whole file: it may lie at the end.

    Raises:
        ValueError: It is no TIFF, or is cut off.
    """
    if not is_tiff(data):
        raise ValueError("is no TIFF")
    order = "<" if data.startswith(b"II") else ">"
    try:
        (start,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, start)
        found = dict(_tag(data, order, start + 2 + 12 * i) for i in range(min(count, _MOST_TAGS)))
    except struct.error as error:
        raise ValueError("has no sound header") from error
    width_px, height_px = found.get(_WIDTH) or 0, found.get(_HEIGHT) or 0
    if width_px == 0 or height_px == 0:
        raise ValueError("has no sound header")
    kind = found.get(_KIND) or 1
    return TiffHeader(
        width_px, height_px, found.get(_BITS) or 1, found.get(_CHANNELS) or 1, kind == 3, kind == 2
    )


def _tag(data: bytes, order: str, at: int) -> tuple[int, int | None]:
    """Return a tag and its first number; None where it is of another type."""
    tag, kind, count = struct.unpack_from(f"{order}HHI", data, at)
    if kind not in _SIZES or count == 0:
        return tag, None
    size = _SIZES[kind]
    place = at + 8
    if count * struct.calcsize(size) > 4:
        (place,) = struct.unpack_from(f"{order}I", data, place)
    return tag, struct.unpack_from(f"{order}{size}", data, place)[0]
