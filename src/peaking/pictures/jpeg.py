"""What a JPEG says of itself, found as decoders find it, without decoding (ITU-T T.81, annex B)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from peaking.limits import MAX_SCAN_PIXELS, MAX_SCANS, MAX_SEGMENTS
from peaking.pictures.too_costly import TooCostly, check_pixels

START = b"\xff\xd8"
APP0, APP2, APP14 = 0xE0, 0xE2, 0xEE
SOF0, SOF1, SOF2, DHT, JPG, DAC, SOS, EOI = 0xC0, 0xC1, 0xC2, 0xC4, 0xC8, 0xCC, 0xDA, 0xD9
DQT, DNL, DRI = 0xDB, 0xDC, 0xDD
FRAMES = frozenset(range(0xC0, 0xD0)) - {DHT, JPG, DAC}
"""Markers that begin a frame."""

_ALONE = frozenset([0x01, *range(0xD0, 0xD9)])
"""Markers without a length: TEM, RST0…7, SOI."""
# Before a marker there may be junk, and any number of 0xFF: the last one belongs to the marker.
_MARKER = re.compile(rb"\xff[^\x00\xff]")
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")
_PIECE_BYTES = 1 << 20
"""Searched at once: meanwhile no other thread runs."""

_AGAIN = "store it again as an ordinary JPEG"


class BrokenOff(ValueError):
    """The file ends within a segment."""


@dataclass(frozen=True)
class Segment:
    """A marker with what belongs to it: of a scan, its data too.

    Attributes:
        marker: The second byte of the marker.
        start: Of the marker in the file.
        body: Where its parameters begin.
        end: Where the next may begin.
    """

    marker: int
    start: int
    body: int
    end: int


def segments(data: bytes | memoryview) -> Iterator[Segment]:
    """Yield the segments up to the end of the picture; where the file is cut off, up to there.

    Junk between them is passed over, as decoders do. What follows the picture is not looked at.

    Raises:
        ValueError: It does not begin as a JPEG.
        BrokenOff: It ends within a segment.
        TooCostly: There are too many.
    """
    if data[: len(START)] != START:
        raise ValueError("does not begin as a JPEG")
    at = len(START)
    for _ in range(MAX_SEGMENTS):
        found = _search(_MARKER, data, at)
        if found is None:
            return
        marker, start, body = data[found.end() - 1], found.start(), found.end()
        if marker == EOI or marker in _ALONE:
            at = body
        else:
            length = int.from_bytes(data[body : body + 2], "big")
            at, body = body + length, body + 2
            if length < 2 or at > len(data):
                raise BrokenOff("ends within a segment")
        if marker == SOS:
            after = _search(_AFTER_SCAN, data, at)
            at = len(data) if after is None else after.start()
        yield Segment(marker, start, body, at)
        if marker == EOI:
            return
    raise TooCostly(f"has more than {MAX_SEGMENTS:,} segments", remedy=_AGAIN)


def tidied(data: bytes, *, zeros: bool, spare: int = 0) -> bytes:
    """Return the JPEG without what decoders pass over, and strict ones complain of.

    That is junk between segments, and limits of a scan that mean nothing in a baseline picture.

    Args:
        data: The JPEG.
        zeros: Take out zeros at the end of scans too; they may be pixels.
        spare: Take out so many bytes at the end of the last scan.

    Raises:
        ValueError: As `segments`.
        TooCostly: The same.
    """
    parts, baseline = [START], True
    walked = list(segments(data))
    last = max((i for i, one in enumerate(walked) if one.marker == SOS), default=-1)
    for number, segment in enumerate(walked):
        part = data[segment.start : segment.end]
        if segment.marker in FRAMES:
            baseline = segment.marker in (SOF0, SOF1)
        if segment.marker == SOS:
            scan = segment.body - 2 + int.from_bytes(data[segment.body - 2 : segment.body], "big")
            head, pixels = data[segment.start : scan], data[scan : segment.end]
            if baseline:
                head = head[:-3] + b"\0\x3f\0"
            if spare and number == last:
                pixels = pixels[: max(0, len(pixels) - spare)]
            if zeros:
                pixels = pixels.rstrip(b"\0")
                pixels += b"\0" * pixels.endswith(b"\xff")
            part = head + pixels
        if segment.marker not in _ALONE:
            parts.append(part)
    return b"".join(parts)


def check_jpeg(data: bytes | memoryview, parts: Iterable[Segment] | None = None) -> tuple[int, int]:
    """Return width and height of a JPEG that can be decoded with bounded memory and time.

    Args:
        data: The JPEG.
        parts: Its `segments`, where they are known.

    Raises:
        ValueError: It has no picture, or one of a kind that is not read.
        TooCostly: It is too large, or has too many scans for its size.
    """
    size_px: tuple[int, int] | None = None
    scans = 0
    for segment in segments(data) if parts is None else parts:
        if segment.marker in FRAMES:
            if segment.marker not in (SOF0, SOF1, SOF2):
                raise ValueError("is lossless, hierarchical or in arithmetic coding")
            if size_px is not None or segment.end - segment.body < 6:
                raise ValueError("has no sound frame header")
            bits, *numbers = data[segment.body : segment.body + 5]
            size_px = 256 * numbers[2] + numbers[3], 256 * numbers[0] + numbers[1]
            if bits != 8:
                raise ValueError(f"has {bits} bits per channel")
            check_pixels(*size_px)
        scans += segment.marker == SOS
    if size_px is None or 0 in size_px:
        raise ValueError("holds no picture")
    if scans > MAX_SCANS or scans * size_px[0] * size_px[1] > MAX_SCAN_PIXELS:
        raise TooCostly(f"has {scans} scans, too many for its size", remedy=_AGAIN)
    return size_px


def _search(marker: re.Pattern[bytes], data: bytes | memoryview, at: int) -> re.Match[bytes] | None:
    """Return the first marker, of two bytes, from `at` on."""
    for start in range(at, len(data), _PIECE_BYTES):
        found = marker.search(data, start, start + _PIECE_BYTES + 1)
        if found is not None:
            return found
    return None
