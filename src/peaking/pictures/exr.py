"""What the header of an OpenEXR picture says (openexr.com, "File Layout"), and its depth."""

from __future__ import annotations

import struct
from dataclasses import dataclass

START = b"\x76\x2f\x31\x01"
NEEDED = "OpenEXR pictures are decoded by an extra: run pip install 'peaking[exr]'"
_DEEP, _MULTIPART = 0x800, 0x1000
_MOST_ATTRIBUTES, _MOST_CHANNELS = 1024, 1024
_DEPTH_NAMES = ("z", "depth", "y", "r", "v")
"""Of a channel, after the name of its layer; the first that there is."""
_FLOATS = (1, 2)
"""Types of channels: 16 and 32 bits."""


@dataclass(frozen=True)
class ExrHeader:
    """What the header says.

    Attributes:
        width_px: Of the pixels that are stored.
        height_px: The same.
        channels: Names, and the types of their numbers.
    """

    width_px: int
    height_px: int
    channels: dict[str, int]

    def depth_channel(self) -> str:
        """Return the name of the channel that holds depth: the only one, or the one so named.

        Raises:
            ValueError: There is none, or its numbers are whole.
        """
        last = {name.rpartition(".")[2].lower(): name for name in reversed(self.channels)}
        only = next(iter(self.channels)) if len(self.channels) == 1 else None
        name = only or next((last[word] for word in _DEPTH_NAMES if word in last), None)
        if name is None:
            raise ValueError(f"has channels {', '.join(self.channels)[:80]}, and none is called Z")
        if self.channels[name] not in _FLOATS:
            raise ValueError(f"has whole numbers in its channel {name}")
        return name


def exr_header(data: bytes) -> ExrHeader:
    """Read the header.

    Args:
        data: The file, or its beginning.

    Raises:
        ValueError: It is no OpenEXR picture, is cut off, or is of a kind that is not read.
    """
    try:
        return _read(data)
    except (struct.error, IndexError) as error:
        raise ValueError("has no sound header") from error


def _read(data: bytes) -> ExrHeader:
    if not data.startswith(START):
        raise ValueError("is no OpenEXR picture")
    (flags,) = struct.unpack_from("<I", data, 4)
    if flags & (_DEEP | _MULTIPART):
        raise ValueError("is an OpenEXR picture of several parts, or deep")
    at, channels, windows = 8, dict[str, int](), dict[bytes, tuple[int, int, int, int]]()
    for _ in range(_MOST_ATTRIBUTES):
        if data[at] == 0:
            break
        name, at = _text(data, at)
        kind, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        at += 4
        if kind == b"chlist":
            channels = _channels(data[at : at + size])
        elif kind == b"box2i":
            windows[name] = struct.unpack_from("<4i", data, at)
        at += size
    data_window, shown = windows.get(b"dataWindow"), windows.get(b"displayWindow")
    if not channels or data_window is None:
        raise ValueError("has no sound header")
    if shown is not None and shown != data_window:
        raise ValueError("holds a part of its picture only (its data window is another)")
    left, top, right, bottom = data_window
    if right < left or bottom < top:
        raise ValueError("has no sound header")
    return ExrHeader(right - left + 1, bottom - top + 1, channels)


def _channels(table: bytes) -> dict[str, int]:
    found: dict[str, int] = {}
    at = 0
    while table[at] != 0 and len(found) < _MOST_CHANNELS:
        name, at = _text(table, at)
        kind, _, columns, rows = struct.unpack_from("<iIii", table, at)
        if (columns, rows) != (1, 1):
            raise ValueError("has channels of fewer pixels")
        found[name.decode(errors="replace")] = kind
        at += 16
    return found


def _text(data: bytes, at: int) -> tuple[bytes, int]:
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("has no sound header")
    return data[at:end], end + 1
