"""Takes out of a picture where, when and with what it was taken; its pixels stay, byte for byte.

Kept are the chunks and segments that decide how pixels look (ICC profiles too) and how they are
coded. Taken out are EXIF with GPS, thumbnails and makers' notes, XMP, comments, whatever lies
between the parts of a file, and what follows the picture (a video, or more pictures). A turn that
EXIF notes goes too: all that `peaking` reads and writes is about the pixels as they are stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from peaking.pictures import jpeg, png, webp

_JPEG_CODING = jpeg.FRAMES | {jpeg.DHT, jpeg.DAC, jpeg.DQT, jpeg.DNL, jpeg.DRI, jpeg.SOS, jpeg.EOI}
_ICC, _JFIF, _ADOBE = b"ICC_PROFILE\0", b"JFIF\0", b"Adobe"
_JFIF_BYTES, _ADOBE_BYTES = 12, 12
"""Without the size of a thumbnail; the whole segment."""
_KIND_BYTES = 12
"""Of a segment's beginning: they tell its kind."""
_PNG_KINDS = png.PIXELS | {b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"sBIT", b"cICP", b"pHYs"}


def without_metadata(data: bytes) -> bytes:
    """Return a JPEG, PNG or WebP with the same pixels and without metadata.

    What was cut off stays so: decoders complain of it.

    Raises:
        ValueError: It is no sound picture of these kinds.
    """
    if data.startswith(jpeg.START):
        return jpeg_without_metadata(data, jpeg.segments(data))
    if data.startswith(png.START):
        return png.png_of(data, _PNG_KINDS)
    if webp.is_webp(data):
        return webp.without_metadata(data)
    raise ValueError("is of a kind whose metadata cannot be removed")


def jpeg_without_metadata(data: bytes | memoryview, segments: Iterable[jpeg.Segment]) -> bytes:
    """Return a JPEG, whose segments are known, with the same pixels and without metadata."""
    return b"".join(part for _, part in _jpeg_parts(memoryview(data), segments))


def is_removable(head: bytes) -> bool:
    """Return whether a file, by its first bytes, is of a kind whose metadata can be removed."""
    return head.startswith((jpeg.START, png.START)) or webp.is_webp(head)


def has_metadata(data: bytes) -> bool:
    """Return whether `without_metadata` changes anything; a JPEG is not copied for that.

    Raises:
        ValueError: As `without_metadata`.
    """
    if not data.startswith(jpeg.START):
        return without_metadata(data) != data
    end = 0
    for start, part in _jpeg_parts(memoryview(data), jpeg.segments(data)):
        if start != end or (isinstance(part, bytes) and not data.startswith(part, start)):
            return True
        end += len(part)
    return end != len(data)


def _jpeg_parts(
    view: memoryview, segments: Iterable[jpeg.Segment]
) -> Iterator[tuple[int, bytes | memoryview]]:
    """Yield what is kept, and where it was."""
    yield 0, jpeg.START
    for segment in segments:
        start = segment.start
        body = bytes(view[segment.body : min(segment.end, segment.body + _KIND_BYTES)])
        if segment.marker in _JPEG_CODING:
            yield start, view[start : segment.end]
        elif segment.marker == jpeg.APP0 and body.startswith(_JFIF) and len(body) >= _JFIF_BYTES:
            yield start, _jpeg_segment(jpeg.APP0, body[:_JFIF_BYTES] + b"\0\0")
        elif segment.marker == jpeg.APP14 and body.startswith(_ADOBE) and len(body) >= _ADOBE_BYTES:
            yield start, _jpeg_segment(jpeg.APP14, body[:_ADOBE_BYTES])
        elif segment.marker == jpeg.APP2 and body.startswith(_ICC):
            yield start, view[start : segment.end]


def _jpeg_segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + (len(body) + 2).to_bytes(2, "big") + body
