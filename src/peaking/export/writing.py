"""What all writers of data sets share: small files, numbers as text, what was written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64

from peaking.export.checking import Meant
from peaking.geometry import Camera
from peaking.output import encode_png


@dataclass(frozen=True, eq=False)
class Written:
    """What was written, and what a reader found there.

    Attributes:
        meant: Of each frame.
        read: Picture and camera of each frame, as they were read back.
        notes: Sentences about what the format has no room for.
    """

    meant: list[Meant]
    read: list[tuple[str, Camera]]
    notes: tuple[str, ...] = ()


def write(folder: Path, name: str, data: bytes) -> None:
    """Write a file below a folder."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def encode_mask(mask: Bool[np.ndarray, "h w"]) -> bytes:
    """Return a PNG: 255 counts, 0 does not."""
    return encode_png(mask.astype(np.uint8) * np.uint8(255))


def words(numbers: object) -> str:
    """Return numbers as text that gives the same numbers again, with spaces between them."""
    return " ".join(repr(float(number)) for number in np.ravel(np.asarray(numbers)))


def quaternion_wxyz(rotation: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "4"]:
    """Return w, x, y, z of length 1 with w >= 0 (Shepperd 1978: from the largest component)."""
    r = rotation
    trace = float(np.trace(r))
    # Four times the square of a component is 1 + trace for w, 1 + 2 r_ii - trace for the others.
    largest = int(np.argmax([trace, *(2 * np.diag(r) - trace)]))
    off = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    q = np.empty(4)
    if largest == 0:
        q[0], q[1:] = trace + 1, off
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = off[i]
        q[1 + i] = 1 + r[i, i] - r[j, j] - r[k, k]
        q[1 + j] = r[i, j] + r[j, i]
        q[1 + k] = r[i, k] + r[k, i]
    q /= np.linalg.norm(q)
    return q if q[0] >= 0 else -q


def rotation_of_wxyz(q: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation of a quaternion w, x, y, z, of any length but 0."""
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return (np.eye(3) * (w * w - v @ v) + 2 * np.outer(v, v) + 2 * w * cross) / (q @ q)
