"""Point clouds as .ply files: nerfstudio's `ply_file_path`."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float, Float64

from peaking.datasets.foreign_files import opened
from peaking.errors import RecordingError
from peaking.limits import MAX_ASCII_POINTS_BYTES, MAX_POINTS_BYTES

MAX_POINTS = 200_000
"""Of a larger cloud, every second, third … point is read."""

_HEAD_BYTES = 1 << 16
_BLOCK_BYTES = 1 << 20
"""Read at once: the whole of a cloud may be far larger than the points that are kept."""
_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_SPACES = (b" ", b"\n", b"\r", b"\t", b"\v", b"\f")
_AGAIN = "export the points again as .ply (x, y, z), or remove ply_file_path"


@dataclass(frozen=True)
class _Layout:
    """What the header of a .ply says of its vertices, which come first."""

    start: int
    order: str
    count: int
    properties: tuple[tuple[str, str], ...]

    @property
    def names(self) -> list[str]:
        return [name for name, _ in self.properties]

    @property
    def row(self) -> np.dtype[np.void]:
        """One vertex, where the file is binary."""
        return np.dtype([(name, self.order + code) for name, code in self.properties])

    @property
    def least_bytes(self) -> int:
        """Of all vertices; in text a number takes up 2 bytes, but for the last."""
        if self.order:
            return self.count * self.row.itemsize
        return 2 * self.count * len(self.properties) - 1


def check_points(path: Path, *, within: Path | None = None) -> None:
    """Read the header of a .ply, and compare its length.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, is no .ply, is cut off or too large, or its
            vertices have no x, y, z.
    """
    with opened(path, within=within, at_most=MAX_POINTS_BYTES) as file:
        _checked_layout(path, file)


def read_points(path: Path, *, within: Path | None = None) -> Float64[np.ndarray, "n 3"]:
    """Read the points of a .ply, ascii or binary; those that are not finite are left out.

    At most `MAX_POINTS`, evenly spaced in the file. However large the file, reading it takes less
    than `peaking.limits.POINTS_MEMORY_BYTES`.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: As `check_points`, or it holds words that are no numbers.
    """
    with opened(path, within=within, at_most=MAX_POINTS_BYTES) as file:
        layout = _checked_layout(path, file)
        file.seek(layout.start)
        step = max(1, -(-layout.count // MAX_POINTS))
        rows = _binary_rows if layout.order else _ascii_rows
        points = np.concatenate([np.zeros((0, 3)), *rows(path, file, layout, step)])
    return points[np.isfinite(points).all(axis=1)]


def encode_points(points_m: Float[np.ndarray, "n 3"]) -> bytes:
    """Return a .ply of points: binary, little endian, float32."""
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points_m)}"]
    head += [f"property float {name}" for name in "xyz"]
    return "\n".join([*head, "end_header", ""]).encode() + points_m.astype("<f4").tobytes()


def _checked_layout(path: Path, file: BinaryIO) -> _Layout:
    """Read the header from the beginning of a file, whose length has to fit it."""
    layout = _layout(path, file.read(_HEAD_BYTES))
    left = os.fstat(file.fileno()).st_size - layout.start
    if left < layout.least_bytes:
        raise _cut_off(path, layout)
    if not layout.order and left > MAX_ASCII_POINTS_BYTES:
        problem = f"has {left:,} bytes of text, and at most {MAX_ASCII_POINTS_BYTES:,} are read"
        raise RecordingError(path, problem, remedy="export the points as a binary .ply")
    return layout


def _layout(path: Path, data: bytes) -> _Layout:
    head, mark, _ = data.partition(b"end_header")
    end = data.find(b"\n", len(head))
    lines = [line.split() for line in head.decode("ascii", errors="replace").splitlines()]
    if not mark or end < 0 or lines[:1] != [["ply"]]:
        raise RecordingError(path, "is no .ply file", remedy=_AGAIN)
    order: str | None = None
    elements: list[tuple[str, str]] = []
    properties: list[tuple[str, str]] = []
    for words in lines[1:]:
        match words:
            case ["format", kind, "1.0"] if kind in _FORMATS:
                order = _FORMATS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 12:
                elements.append((name, count))
            case ["property", kind, name] if kind in _TYPES and len(elements) == 1:
                properties.append((name, _TYPES[kind]))
            case ["property", *_] if len(elements) > 1:
                pass  # of what comes after the vertices
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                said = " ".join(words)[:60]
                raise RecordingError(path, f"has a header line {said!r}", remedy=_AGAIN)
    names = [name for name, _ in properties]
    if order is None or not elements or elements[0][0] != "vertex" or len(set(names)) != len(names):
        raise RecordingError(path, "does not begin with vertices", remedy=_AGAIN)
    if not {"x", "y", "z"} <= set(names):
        raise RecordingError(path, "has vertices without x, y and z", remedy=_AGAIN)
    return _Layout(end + 1, order, int(elements[0][1]), tuple(properties))


def _binary_rows(
    path: Path, file: BinaryIO, layout: _Layout, step: int
) -> Iterator[Float64[np.ndarray, "n 3"]]:
    """Yield every `step`-th point, block by block."""
    row = layout.row
    at_once = max(1, _BLOCK_BYTES // row.itemsize)
    for first in range(0, layout.count, at_once):
        wanted = min(at_once, layout.count - first)
        data = file.read(wanted * row.itemsize)
        if len(data) < wanted * row.itemsize:
            raise _cut_off(path, layout)
        vertices = np.frombuffer(data, row)[-first % step :: step]
        yield np.stack([vertices[name].astype(np.float64) for name in "xyz"], axis=1)


def _ascii_rows(
    path: Path, file: BinaryIO, layout: _Layout, step: int
) -> Iterator[Float64[np.ndarray, "n 3"]]:
    """Yield every `step`-th point, block by block."""
    width = len(layout.names)
    columns = [layout.names.index(name) for name in "xyz"]
    text, numbers, first = b"", np.zeros(0), 0
    while first < layout.count:
        block = file.read(_BLOCK_BYTES)
        text += block
        end = max(map(text.rfind, _SPACES)) + 1 if block else len(text)
        if len(text) - end > _BLOCK_BYTES:
            raise _no_numbers(path)
        wanted = (layout.count - first) * width - len(numbers)
        numbers = np.concatenate([numbers, _numbers(path, text[:end], wanted)])
        text = text[end:]
        rows = len(numbers) // width
        yield numbers[: rows * width].reshape(rows, width)[-first % step :: step, columns]
        numbers, first = numbers[rows * width :], first + rows
        if not block and first < layout.count:
            raise _cut_off(path, layout)


def _numbers(path: Path, text: bytes, wanted: int) -> Float64[np.ndarray, "numbers"]:
    """Return the numbers of a text, so many at most; what follows them may be anything."""
    count = min(wanted, len(text.split()))  # of more, NumPy returns memory that nobody wrote to
    if count == 0:
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of words that are no numbers
            return np.fromstring(text.decode("ascii"), np.float64, count=count, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        raise _no_numbers(path) from error


def _no_numbers(path: Path) -> RecordingError:
    return RecordingError(path, "holds words that are no numbers", remedy=_AGAIN)


def _cut_off(path: Path, layout: _Layout) -> RecordingError:
    return RecordingError(path, f"is cut off: need {layout.count} points", remedy=_AGAIN)
