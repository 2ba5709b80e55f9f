"""Point clouds as .ply files: nerfstudio's `ply_file_path`."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.limits import MAX_POINTS_BYTES

MAX_POINTS = 200_000
"""Of a larger cloud, every second, third … point is read."""

_HEAD_BYTES = 1 << 16
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
_AGAIN = "export the points again as .ply (x, y, z), or remove ply_file_path"


@dataclass(frozen=True)
class _Layout:
    """What the header of a .ply says of its vertices, which come first."""

    start: int
    order: str
    count: int
    properties: tuple[tuple[str, str], ...]


def check_points(path: Path, *, within: Path | None = None) -> None:
    """Read the header of a .ply.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, is no .ply, or its vertices have no x, y, z.
    """
    _layout(path, read_bytes(path, _HEAD_BYTES, within=within))


def read_points(path: Path, *, within: Path | None = None) -> Float64[np.ndarray, "n 3"]:
    """Read the points of a .ply, ascii or binary; those that are not finite are left out.

    At most `MAX_POINTS`, evenly spaced in the file.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: As `check_points`, or the file is cut off, or too large.
    """
    data = read_bytes(path, within=within, at_most=MAX_POINTS_BYTES)
    layout = _layout(path, data)
    names = [name for name, _ in layout.properties]
    if layout.order:
        kind = np.dtype([(name, layout.order + code) for name, code in layout.properties])
        if len(data) - layout.start < layout.count * kind.itemsize:
            raise _cut_off(path, layout)
        vertices = np.frombuffer(data, kind, layout.count, layout.start)
        columns = [vertices[name].astype(np.float64) for name in ("x", "y", "z")]
    else:
        table = _numbers(path, data[layout.start :], layout).reshape(layout.count, len(names))
        columns = [table[:, names.index(name)] for name in ("x", "y", "z")]
    points = np.stack(columns, axis=1)
    points = points[np.isfinite(points).all(axis=1)]
    return points[:: max(1, -(-len(points) // MAX_POINTS))]


def encode_points(points_m: Float[np.ndarray, "n 3"]) -> bytes:
    """Return a .ply of points: binary, little endian, float32."""
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points_m)}"]
    head += [f"property float {name}" for name in "xyz"]
    return "\n".join([*head, "end_header", ""]).encode() + points_m.astype("<f4").tobytes()


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


def _numbers(path: Path, text: bytes, layout: _Layout) -> Float64[np.ndarray, "numbers"]:
    """Return the numbers of an ascii file; a word takes up 2 bytes at least."""
    wanted = layout.count * len(layout.properties)
    if 2 * wanted > len(text) + 1:
        raise _cut_off(path, layout)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of words that are no numbers
            numbers = np.fromstring(text.decode("ascii"), np.float64, count=wanted, sep=" ")
    except (ValueError, DeprecationWarning) as error:
        raise RecordingError(path, "holds words that are no numbers", remedy=_AGAIN) from error
    if len(numbers) < wanted:
        raise _cut_off(path, layout)
    return numbers


def _cut_off(path: Path, layout: _Layout) -> RecordingError:
    return RecordingError(path, f"is cut off: need {layout.count} points", remedy=_AGAIN)
