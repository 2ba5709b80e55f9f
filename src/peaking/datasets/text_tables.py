"""Numbers in text files, line by line: what most formats keep poses and intrinsics in."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.geometry import Cam, Rigid, World
from peaking.limits import MAX_TEXT_BYTES

_SEPARATORS = re.compile(r"[\s,;]+")
_AGAIN = "export or copy it again"
QUATERNION_TOLERANCE = 0.05
"""How far the length of a quaternion may be from 1."""


@dataclass(frozen=True)
class Row:
    """The words of a line of a file."""

    path: Path
    line: int
    words: tuple[str, ...]

    def wrong(self, problem: str, *, remedy: str = _AGAIN) -> RecordingError:
        """Return the complaint about the line."""
        return RecordingError(self.path, problem, field=f"line {self.line}", remedy=remedy)

    def numbers(self, start: int, count: int) -> Float64[np.ndarray, "count"]:
        """Return some of the words as numbers, which may be infinite or NaN.

        Raises:
            RecordingError: There are too few, or one is no number.
        """
        words = self.words[start : start + count]
        if len(words) < count:
            raise self.wrong(f"need {start + count} values, got {len(self.words)}")
        try:
            return np.array([float(word) for word in words])
        except ValueError as error:
            raise self.wrong(f"need numbers, got {' '.join(words)[:60]!r}") from error


def rows_of(path: Path, *, within: Path | None = None, comment: str = "#") -> Iterator[Row]:
    """Yield the lines of a file that are neither empty nor comments, split at spaces and commas.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.
        comment: What comments begin with.

    Raises:
        RecordingError: It cannot be read, is too long, or is no text.
    """
    data = read_bytes(path, within=within, at_most=MAX_TEXT_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(path, f"is no text ({error})", remedy=_AGAIN) from error
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if stripped and not stripped.startswith(comment):
            words = tuple(word for word in _SEPARATORS.split(stripped) if word)
            if words:
                yield Row(path, number, words)


def matrix_of(
    path: Path, rows: int, columns: int, *, within: Path | None = None
) -> Float64[np.ndarray, "rows columns"]:
    """Return a matrix that is all a file holds; entries may be infinite or NaN.

    Raises:
        RecordingError: It cannot be read, or holds something else.
    """
    found = list(rows_of(path, within=within))
    if sum(len(row.words) for row in found) != rows * columns:
        problem = f"need {rows}x{columns} numbers, got {sum(len(row.words) for row in found)}"
        raise RecordingError(path, problem, remedy=_AGAIN)
    numbers = [row.numbers(0, len(row.words)) for row in found]
    return np.concatenate(numbers).reshape(rows, columns)


def pose_of_matrix(
    path: Path, matrix: Float64[np.ndarray, "4 4"], *, field: str | None = None
) -> Rigid[World, Cam] | None:
    """Return a pose; None where it is not finite, which says that it was not tracked.

    Raises:
        RecordingError: It is not rigid, or mirrored.
    """
    if not np.isfinite(matrix).all():
        return None
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers end as "not rigid"
            return Rigid[World, Cam].from_matrix(matrix)
    except ValueError as error:
        remedy = "correct the pose or remove the frame"
        raise RecordingError(path, str(error), field=field, remedy=remedy) from error


def pose_of_quaternion(
    row: Row,
    position_m: Float64[np.ndarray, "3"],
    x_y_z_w: Float64[np.ndarray, "4"],
) -> Rigid[World, Cam] | None:
    """Return a pose; None where it is not finite, which says that it was not tracked.

    Raises:
        RecordingError: The quaternion is not of length 1.
    """
    if not (np.isfinite(position_m).all() and np.isfinite(x_y_z_w).all()):
        return None
    length = float(np.linalg.norm(x_y_z_w))
    if abs(length - 1) > QUATERNION_TOLERANCE:
        raise row.wrong(f"need a quaternion of length 1, got {length:.3g}")
    return Rigid(rotation_of_quaternion(x_y_z_w), position_m)


def rotation_of_quaternion(x_y_z_w: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation of a quaternion of any length but 0, real part last."""
    x, y, z, w = x_y_z_w / np.linalg.norm(x_y_z_w)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def nearest(times_s: Sequence[float], at_s: float, within_s: float) -> int | None:
    """Return which of some times, in ascending order, is nearest; None where none is near."""
    after = bisect_left(times_s, at_s)
    near = [i for i in (after - 1, after) if 0 <= i < len(times_s)]
    if not near:
        return None
    best = min(near, key=lambda i: abs(times_s[i] - at_s))
    return best if abs(times_s[best] - at_s) <= within_s else None


def counted(skipped: int, what: str) -> list[str]:
    """Return a note that frames were left out, in a list that is empty where none were."""
    return [f"{skipped} {'frame' if skipped == 1 else 'frames'} {what} left out"] if skipped else []


def backwards(times_s: Sequence[float | None]) -> list[str]:
    """Return a note that time runs backwards, in a list that is empty where it does not."""
    known = [time_s for time_s in times_s if time_s is not None]
    count = sum(after < before for before, after in pairwise(known))
    if count == 0:
        return []
    places = "place" if count == 1 else "places"
    return [f"time runs backwards at {count} {places}: frames stay in the order of the file"]


def in_number_order(paths: Sequence[Path]) -> list[Path]:
    """Return paths sorted by the numbers in their names: 2 comes before 10."""

    def key(path: Path) -> tuple[tuple[int, int | str], ...]:
        return tuple(
            (0, int(part)) if part.isdigit() else (1, part)
            for part in re.split(r"([0-9]+)", path.name)
            if part
        )

    return sorted(paths, key=key)
