"""Takes out of a picture where, when and with what it was taken; its pixels stay, byte for byte.

Kept are the chunks and segments that decide how pixels look (ICC profiles too) and how they are
coded. Taken out are EXIF with GPS, thumbnails and makers' notes, XMP, comments, whatever lies
between the parts of a file, and what follows the picture (a video, or more pictures). A turn that
EXIF notes goes too: all that `peaking` reads and writes is about the pixels as they are stored.
"""

from __future__ import annotations

from peaking.pictures import jpeg, png

_JPEG_CODING = jpeg.FRAMES | {jpeg.DHT, jpeg.DAC, jpeg.DQT, jpeg.DNL, jpeg.DRI, jpeg.SOS, jpeg.EOI}
_ICC, _JFIF, _ADOBE = b"ICC_PROFILE\0", b"JFIF\0", b"Adobe"
_JFIF_BYTES, _ADOBE_BYTES = 12, 12
"""Without the size of a thumbnail; the whole segment."""
_PNG_KINDS = png.PIXELS | {b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"sBIT", b"cICP", b"pHYs"}
_WEBP_KINDS = frozenset([b"VP8 ", b"VP8L", b"ALPH", b"ICCP"])
_WEBP_EXIF, _WEBP_XMP, _WEBP_MOVES = 0x08, 0x04, 0x02
_HEADLESS = (b"BM", b"P1", b"P2", b"P3", b"P4", b"P5", b"P6")
"""How BMP and PNM begin, which have no metadata."""


def without_metadata(data: bytes) -> bytes:
    """Return a JPEG, PNG or WebP with the same pixels and without metadata.

    What was cut off stays so: decoders complain of it.

    Raises:
        ValueError: It is no sound picture of these kinds, nor one that cannot have metadata.
    """
    if data.startswith(jpeg.START):
        return _jpeg(data)
    if data.startswith(png.START):
        return png.png_of(data, _PNG_KINDS)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return _webp(data)
    if data.startswith(_HEADLESS):
        return data
    raise ValueError("is of a kind whose metadata cannot be removed")


def _jpeg(data: bytes) -> bytes:
    parts = [jpeg.START]
    for segment in jpeg.segments(data):
        body = data[segment.body : segment.end]
        if segment.marker in _JPEG_CODING:
            parts.append(data[segment.start : segment.end])
        elif segment.marker == jpeg.APP0 and body.startswith(_JFIF) and len(body) >= _JFIF_BYTES:
            parts.append(_jpeg_segment(jpeg.APP0, body[:_JFIF_BYTES] + b"\0\0"))
        elif segment.marker == jpeg.APP14 and body.startswith(_ADOBE) and len(body) >= _ADOBE_BYTES:
            parts.append(_jpeg_segment(jpeg.APP14, body[:_ADOBE_BYTES]))
        elif segment.marker == jpeg.APP2 and body.startswith(_ICC):
            parts.append(data[segment.start : segment.end])
    return b"".join(parts)


def _jpeg_segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + (len(body) + 2).to_bytes(2, "big") + body


def _webp(data: bytes) -> bytes:
    """Walk the RIFF chunks (RFC 9649, 2.3 to 2.7)."""
    parts: list[bytes] = []
    at, end = 12, min(len(data), 8 + int.from_bytes(data[4:8], "little"))
    while at + 8 <= end:
        kind, length = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        body = data[at + 8 : at + 8 + length]
        if kind == b"VP8X" and length == 10:
            if body[0] & _WEBP_MOVES:
                raise ValueError("is a moving picture")
            flags = body[0] & ~(_WEBP_EXIF | _WEBP_XMP)
            parts.append(data[at : at + 8] + bytes([flags]) + body[1:])
        elif kind in _WEBP_KINDS:
            parts.append(data[at : at + 8] + body + b"\0" * (length % 2))
        at += 8 + length + length % 2
    content = b"WEBP" + b"".join(parts)
    return b"RIFF" + len(content).to_bytes(4, "little") + content
