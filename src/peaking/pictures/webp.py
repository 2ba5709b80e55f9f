"""What a WebP says of itself, without decoding (RFC 9649, 2.3 to 2.7)."""

from __future__ import annotations

from collections.abc import Iterator

from peaking.limits import MAX_CHUNKS
from peaking.pictures.too_costly import TooCostly, check_pixels

PIXELS = frozenset([b"VP8 ", b"VP8L", b"ALPH", b"ICCP"])
"""Chunks that decide how it looks, beside the header."""

_HEADER = b"VP8X"
_HEADER_BYTES = 10
_EXIF, _XMP, _MOVES = 0x08, 0x04, 0x02
_LOSSLESS_MARK, _LOSSY_MARK = b"\x2f", b"\x9d\x01\x2a"
_SIDE_BITS = 14


def is_webp(data: bytes) -> bool:
    """Return whether a file begins as a WebP."""
    return data[:4] == b"RIFF" and data[8:12] == b"WEBP"


def check_webp(data: bytes) -> tuple[int, int]:
    """Return width and height; the first bytes of the file are enough, as a rule.

    Raises:
        ValueError: No picture is found, or it moves.
        TooCostly: It is too large.
    """
    size_px: tuple[int, int] | None = None
    for kind, body in _chunks(data):
        found = _size_px(kind, body)
        if found is not None:
            check_pixels(*found)
            size_px = size_px or found
    if size_px is None:
        raise ValueError("holds no picture")
    return size_px


def without_metadata(data: bytes) -> bytes:
    """Return the WebP without EXIF, XMP, unknown chunks and what follows the picture.

    Raises:
        ValueError: It moves.
    """
    parts: list[bytes] = []
    for kind, body in _chunks(data):
        if kind == _HEADER:
            body = bytes([body[0] & ~(_EXIF | _XMP)]) + body[1:]
        if kind == _HEADER or kind in PIXELS:
            parts += [kind, len(body).to_bytes(4, "little"), body, b"\0" * (len(body) % 2)]
    content = b"WEBP" + b"".join(parts)
    return b"RIFF" + len(content).to_bytes(4, "little") + content


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of the chunks that are there."""
    at, end = 12, min(len(data), 8 + int.from_bytes(data[4:8], "little"))
    for _ in range(MAX_CHUNKS):
        if at + 8 > end:
            return
        kind, length = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        body = data[at + 8 : at + 8 + length]
        if kind == _HEADER and (len(body) != _HEADER_BYTES or body[0] & _MOVES):
            raise ValueError("is a moving picture, or its header is damaged")
        yield kind, body
        at += 8 + length + length % 2
    raise TooCostly(f"has more than {MAX_CHUNKS:,} chunks", remedy="store it again as a WebP")


def _size_px(kind: bytes, body: bytes) -> tuple[int, int] | None:
    if kind == _HEADER:
        return _number(body[4:7]) + 1, _number(body[7:10]) + 1
    mask = (1 << _SIDE_BITS) - 1
    if kind == b"VP8L" and body[:1] == _LOSSLESS_MARK and len(body) >= 5:
        sides = _number(body[1:5])
        return (sides & mask) + 1, (sides >> _SIDE_BITS & mask) + 1
    if kind == b"VP8 " and body[3:6] == _LOSSY_MARK and len(body) >= 10:
        return _number(body[6:8]) & mask, _number(body[8:10]) & mask
    return None


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")
