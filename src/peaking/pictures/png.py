"""What a PNG says of itself, without decoding (PNG specification, 3rd edition)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator

from peaking.limits import MAX_CHUNKS
from peaking.pictures.too_costly import TooCostly, check_pixels

START = b"\x89PNG\r\n\x1a\n"
PIXELS = frozenset([b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"])
"""Chunks that decide the stored values; a decoder gets no others."""

_HEADER_BYTES = 26
_BITS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
"""By type of colour (11.2.1)."""


def png_header(head: bytes) -> tuple[int, int, int, int]:
    """Return width, height, bits per channel and colour type, from the first bytes (11.2.1).

    Raises:
        ValueError: It does not begin as a PNG, or is cut off in the header.
        TooCostly: The picture is too large.
    """
    if not head.startswith(START):
        raise ValueError("is not a PNG")
    if len(head) < _HEADER_BYTES or head[8:16] != b"\0\0\0\rIHDR":
        raise ValueError("is cut off in the PNG header")
    width_px, height_px, bits, color = struct.unpack(">IIBB", head[16:_HEADER_BYTES])
    if bits not in _BITS.get(color, ()) or 0 in (width_px, height_px):
        raise ValueError("has no sound PNG header")
    check_pixels(width_px, height_px)
    return width_px, height_px, bits, color


def chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of the chunks up to IEND; their checksums are compared (5.3).

    Raises:
        ValueError: It is cut off, or a checksum differs.
        TooCostly: There are too many.
    """
    view, start = memoryview(data), len(START)
    for _ in range(MAX_CHUNKS):
        if start + 12 > len(data):
            raise ValueError("is cut off: the PNG has no end")
        (length,) = struct.unpack_from(">I", data, start)
        end = start + 8 + length
        if end + 4 > len(data):
            raise ValueError("is cut off: the PNG has no end")
        (checksum,) = struct.unpack_from(">I", data, end)
        if zlib.crc32(view[start + 4 : end]) != checksum:
            raise ValueError("is damaged: a PNG checksum differs")
        kind = data[start + 4 : start + 8]
        yield kind, start, end + 4
        if kind == b"IEND":
            return
        start = end + 4
    raise TooCostly(f"has more than {MAX_CHUNKS:,} chunks", remedy="store it again as a PNG")


def png_of(data: bytes, kinds: Collection[bytes]) -> bytes:
    """Return the PNG with the chunks of these kinds alone; what follows it is left out.

    Raises:
        ValueError: As `png_header` and `chunks`.
        TooCostly: The same.
    """
    png_header(data)
    view = memoryview(data)
    kept = [view[start:end] for kind, start, end in chunks(data) if kind in kinds]
    return b"".join([START, *kept])
