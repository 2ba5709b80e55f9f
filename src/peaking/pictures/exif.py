"""What a picture's EXIF says of how the camera was held, and of its lens (CIPA DC-008, 4.6)."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from peaking.pictures import jpeg, png

HEAD_BYTES = 1 << 18
"""EXIF lies in the first of them; a segment of a JPEG has at most 64 KiB."""
_APP1, _MARK = 0xE1, b"Exif\0\0"
_ORIENTATION, _OTHERS, _FOCAL_ON_FILM = 0x0112, 0x8769, 0xA405
_FOCAL, _PER_UNIT, _UNIT, _COLUMNS = 0x920A, 0xA20E, 0xA210, 0xA002
_UNIT_M = {2: 0.0254, 3: 0.01, 4: 0.001}
_MOST_TAGS = 512
_FILM_DIAGONAL = math.hypot(36.0, 24.0)
_PLAUSIBLE = (0.2, 20.0)
"""Focal length over the longer side."""


@dataclass(frozen=True)
class Exif:
    """What is used of it.

    Attributes:
        orientation: 1…8; 1: as it is stored.
        focal_on_film: Focal length for the same view on film of 36 × 24 mm, in millimetres, None:
            unknown.
        focal_columns: Focal length over the width of the stored picture, None: unknown.
    """

    orientation: int = 1
    focal_on_film: float | None = None
    focal_columns: float | None = None

    def focal_px(self, width_px: int, height_px: int) -> float | None:
        """Return the focal length in pixels, None where nothing plausible tells it.

        Args:
            width_px: Of the picture as it is stored.
            height_px: The same.
        """
        if self.focal_on_film is not None:
            focal = self.focal_on_film / _FILM_DIAGONAL * math.hypot(width_px, height_px)
        elif self.focal_columns is not None:
            focal = self.focal_columns * width_px
        else:
            return None
        low, high = (side * max(width_px, height_px) for side in _PLAUSIBLE)
        return focal if low < focal < high else None


def exif_of(head: bytes) -> Exif:
    """Return what the first bytes of a JPEG or PNG say; nothing where there is no sound EXIF."""
    return exif_of_block(_block(head) or b"")


def exif_of_block(block: bytes) -> Exif:
    """Return what a block of EXIF says, with or without its mark; nothing where it is not sound."""
    block = block.removeprefix(_MARK)
    try:
        return _read(block)
    except (struct.error, ZeroDivisionError):
        return Exif()


def _block(head: bytes) -> bytes | None:
    try:
        if head.startswith(jpeg.START):
            for part in jpeg.segments(head):
                if part.marker == _APP1 and head[part.body :].startswith(_MARK):
                    return head[part.body + len(_MARK) : part.end]
        elif head.startswith(png.START):
            for kind, start, end in png.chunks(head):
                if kind == b"eXIf":
                    return head[start + 8 : end - 4]
    except ValueError:
        pass
    return None


def _read(block: bytes) -> Exif:
    order = {b"II": "<", b"MM": ">"}.get(block[:2])
    if order is None:
        return Exif()
    first = _tags(block, order, struct.unpack_from(f"{order}I", block, 4)[0])
    orientation = int(first.get(_ORIENTATION, 1))
    others = _tags(block, order, int(first[_OTHERS])) if _OTHERS in first else {}
    focal_on_film = others.get(_FOCAL_ON_FILM, 0.0)
    columns = None
    if int(others.get(_UNIT, 0)) in _UNIT_M and {_FOCAL, _PER_UNIT, _COLUMNS} <= set(others):
        width_m = others[_COLUMNS] / others[_PER_UNIT] * _UNIT_M[int(others[_UNIT])]
        columns = others[_FOCAL] / 1000 / width_m
    return Exif(
        orientation if 1 <= orientation <= 8 else 1,
        focal_on_film if focal_on_film > 0 else None,
        columns if columns is not None and columns > 0 else None,
    )


def _tags(block: bytes, order: str, at: int) -> dict[int, float]:
    """Return the numbers of a directory: SHORT, LONG and RATIONAL, the first of each tag."""
    (count,) = struct.unpack_from(f"{order}H", block, at)
    found: dict[int, float] = {}
    for place in range(min(count, _MOST_TAGS)):
        start = at + 2 + 12 * place
        tag, kind, _ = struct.unpack_from(f"{order}HHI", block, start)
        if kind == 3:
            found[tag] = float(struct.unpack_from(f"{order}H", block, start + 8)[0])
        elif kind == 4:
            found[tag] = float(struct.unpack_from(f"{order}I", block, start + 8)[0])
        elif kind == 5:
            (offset,) = struct.unpack_from(f"{order}I", block, start + 8)
            above, below = struct.unpack_from(f"{order}II", block, offset)
            if below:
                found[tag] = above / below
    return found
