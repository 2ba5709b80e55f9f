"""Traces of phones' cameras, to be played in their place. docs/trace.md describes the file."""

from __future__ import annotations

import math
import zipfile
import zlib
from pathlib import Path

import msgspec
import numpy as np

from peaking import limits
from peaking.errors import RecordingError
from peaking.foreign_json import decode_json
from peaking.geometry import Rigid
from peaking.pictures.jpeg import check_jpeg, segments
from peaking.pictures.too_costly import TooCostly
from peaking.server import wire
from peaking.server.recordings import PlayedRecording

INDEX = "trace.json"

FPS = 30.0
"""For the buttons that step; frames are played at their own times."""

BYTES_OF_DEPTH = {"luminance-alpha": 2, "unsigned-short": 2, "float32": 4}
_UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    OSError,
    RuntimeError,  # it is encrypted, or packed in a way that is not known
    ValueError,
)


class _Version(msgspec.Struct):
    version: int


class PlayedTrace:
    """A trace that was read and checked as a whole."""

    def __init__(self, path: Path) -> None:
        """Read a trace.

        Raises:
            RecordingError: It is cut off, something else, or larger than a trace may be.
        """
        self.name = path.resolve().name
        self._path = path
        self._pictures: dict[int, bytes] = {}
        self._depths: dict[int, bytes] = {}
        self._unpacked_bytes = 0
        try:
            if path.stat().st_size > wire.MAX_TRACE_BYTES:
                raise self._refusal(f"has more than {wire.MAX_TRACE_BYTES:,} bytes")
            with zipfile.ZipFile(path) as file:
                trace = self._index(file)
                for number, frame in enumerate(trace.frames):
                    self._read(file, number, frame)
        except _UNREADABLE as error:
            raise self._refusal(f"is cut off, or is no trace ({error})") from error
        if not self._pictures:
            raise self._refusal("has no picture")
        self.index = wire.RecordingIndex(self.name, FPS, [], trace)

    def photo(self, index: int) -> bytes:
        """Return the picture of a frame, a JPEG.

        Raises:
            IndexError: There is none.
        """
        return _of(self._pictures, index)

    def depth(self, index: int) -> bytes:
        """Return the depth of a frame as the device gave it.

        Raises:
            IndexError: There is none.
        """
        return _of(self._depths, index)

    # Inside

    def _refusal(self, problem: str) -> RecordingError:
        remedy = "record another one with the page /check of this peaking"
        return RecordingError(self._path, problem, remedy=remedy)

    def _index(self, file: zipfile.ZipFile) -> wire.Trace:
        data = self._unpacked(file, INDEX, limits.MAX_TRACE_INDEX_BYTES)
        version = decode_json(data, _Version).version
        if version != wire.TRACE_VERSION:
            raise self._refusal(f"is of version {version}, and {wire.TRACE_VERSION} can be read")
        return decode_json(data, wire.Trace)

    def _read(self, file: zipfile.ZipFile, number: int, frame: wire.TracedFrame) -> None:
        tracked = frame.world_from_view
        if tracked is not None:
            Rigid.from_matrix(np.array(tracked).reshape(4, 4).T)
        if frame.picture is not None:
            if tracked is None or frame.projection is None:
                raise ValueError(f"frame {number} has a picture without a camera")
            data = self._unpacked(
                file, f"pictures/{number:06d}.jpg", limits.MAX_TRACE_PICTURE_BYTES
            )
            _check_picture(data, frame.picture)
            self._pictures[number] = data
        if frame.depth is not None:
            num_bytes = _depth_bytes(frame.depth)
            data = self._unpacked(file, f"depth/{number:06d}.bin", num_bytes)
            if len(data) != num_bytes:
                raise ValueError(f"depth of frame {number} has {len(data)} of {num_bytes} bytes")
            self._depths[number] = data

    def _unpacked(self, file: zipfile.ZipFile, name: str, most_bytes: int) -> bytes:
        try:
            with file.open(name) as packed:
                data = packed.read(most_bytes + 1)
        except KeyError:
            raise ValueError(f"{name} is not in it") from None
        self._unpacked_bytes += len(data)
        if len(data) > most_bytes or self._unpacked_bytes > limits.MAX_TRACE_UNPACKED_BYTES:
            raise ValueError(f"{name} is too large")
        return data


Played = PlayedRecording | PlayedTrace
"""What is played as the camera."""


def _check_picture(data: bytes, told: wire.TracedPicture) -> None:
    try:
        size_px = check_jpeg(memoryview(data), list(segments(memoryview(data))))
    except TooCostly as error:
        raise ValueError(f"a picture {error}") from error
    if size_px != (told.width_px, told.height_px):
        raise ValueError("a picture has another size than it says")


def _depth_bytes(depth: wire.TracedDepth) -> int:
    return math.prod((depth.width_px, depth.height_px, BYTES_OF_DEPTH[depth.format]))


def is_trace(path: Path) -> bool:
    """Return whether a file is a trace, or was named as one where it cannot be opened."""
    if not path.is_file():
        return False
    try:
        with zipfile.ZipFile(path) as file:
            return INDEX in file.namelist()
    except _UNREADABLE:
        return "trace" in path.stem


def _of(files: dict[int, bytes], index: int) -> bytes:
    if index not in files:
        raise IndexError(f"frame {index} has none")
    return files[index]
