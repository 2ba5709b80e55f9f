"""What a JPEG says of itself, looked at before it is decoded."""

from __future__ import annotations

import re

from peaking.errors import MpiFileError

_SOF0, _DHT, _JPG, _DAC, _SOS, _EOI = 0xC0, 0xC4, 0xC8, 0xCC, 0xDA, 0xD9
_FRAMES = frozenset(range(0xC0, 0xD0)) - {_DHT, _JPG, _DAC}
"""Markers that begin a frame; all but SOF0 are progressive, arithmetic or the like."""
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7]")
"""What ends the data of a scan: any marker but a restart."""
_SAMPLINGS = {False: (b"\x22\x11\x11", "YCbCr 4:2:0"), True: (b"\x11", "grey")}
"""By whether it is grey: sampling factors of its components, and how that is called."""


def baseline_size_px(jpeg: bytes, *, grey: bool) -> tuple[int, int]:
    """Return width and height of a JPEG, when it is baseline, grey or 4:2:0, in one scan.

    Progressive pictures and pictures of many scans are refused: every scan, of a few bytes, can
    cost a decoder a walk over the whole picture.
    """
    sampling, kind = _SAMPLINGS[grey]
    size_px: tuple[int, int] | None = None
    if jpeg[:2] != b"\xff\xd8":
        raise MpiFileError("need a JPEG as payload")
    at = 2
    while True:
        marker, length = jpeg[at : at + 2], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        body = jpeg[at + 4 : at + 2 + length]
        if len(marker) < 2 or marker[0] != 0xFF or length < 2 or len(body) != length - 2:
            raise MpiFileError("unsound JPEG: a segment is broken off")
        at += 2 + length
        if marker[1] in _FRAMES:
            if marker[1] != _SOF0 or size_px is not None:
                raise MpiFileError("need a baseline JPEG")
            # precision, height, width, then id, sampling and table of each component
            if len(body) != 6 + 3 * len(sampling) or body[0] != 8 or body[7::3] != sampling:
                raise MpiFileError(f"need a JPEG of 8-bit {kind}")
            size_px = int.from_bytes(body[3:5], "big"), int.from_bytes(body[1:3], "big")
        if marker[1] == _SOS:
            break
    after = _AFTER_SCAN.search(jpeg, at)
    if size_px is None or body[:1] != bytes([len(sampling)]) or after is None:
        raise MpiFileError("need a JPEG in one scan")
    if jpeg[after.start() :] != bytes([0xFF, _EOI]):
        raise MpiFileError("need a JPEG in one scan, with nothing behind it")
    return size_px
