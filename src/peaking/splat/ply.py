"""The .ply file of 3D Gaussian splatting, with the property names and order of Kerbl et al.

Binary, little endian, float32: x y z, normals (0), f_dc_0…2, f_rest_0…44 (all coefficients of red,
then of green, then of blue; those above our degree are 0, since some viewers read files of degree 3
only), opacity (logit), scale_0…2 (logarithms), rot_0…3 (w x y z, of length 1). Where x y z are not
counted from the world's origin, a line `comment origin_m X Y Z` says from where.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Float64

from peaking.errors import SplatFileError
from peaking.limits import MAX_GAUSSIANS, MAX_SPLAT_BYTES
from peaking.output import write_atomically
from peaking.splat.gaussians import NUM_COEFFICIENTS, Gaussians

NUM_REST = 15
"""Coefficients per channel of the degrees 1 to 3."""

_ORIGIN = "comment origin_m"
_HEAD_BYTES = 1 << 16
_BLOCK_BYTES = 1 << 20


def write_ply(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians, or replace the file, in one step.

    Raises:
        OutputError: The place is taken by a folder, full or not writable.
    """
    write_atomically(path, encode_ply(gaussians))


def encode_ply(gaussians: Gaussians) -> bytes:
    """Return the bytes of the file."""
    n, coefficients = gaussians.sh.shape[:2]
    rest = np.zeros((n, 3, NUM_REST), np.float32)
    rest[:, :, : coefficients - 1] = gaussians.sh[:, 1:].transpose(0, 2, 1)
    length = np.linalg.norm(gaussians.quaternions, axis=1, keepdims=True)
    names = _names(NUM_REST)
    values = np.concatenate(
        [
            gaussians.means_m,
            np.zeros((n, 3), np.float32),
            gaussians.sh[:, 0],
            rest.reshape(n, 3 * NUM_REST),
            gaussians.opacity_logits[:, None],
            gaussians.log_scales,
            gaussians.quaternions / np.maximum(length, np.float32(1e-12)),
        ],
        axis=1,
    )
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {n}"]
    if gaussians.origin_m.any():
        header.insert(2, " ".join([_ORIGIN, *map(repr, gaussians.origin_m.tolist())]))
    header += [f"property float {name}" for name in names]
    header += ["end_header", ""]
    return "\n".join(header).encode("ascii") + values.astype("<f4").tobytes()


def read_ply(path: Path, *, max_degree: int = 1) -> Gaussians:
    """Read a file of this form, of any degree.

    Reading takes the memory of the Gaussians, twice at most, whatever else the file holds.

    Args:
        path: The file.
        max_degree: Coefficients above it are left out, and those of degrees that are all 0.

    Raises:
        SplatFileError: It is not such a file, lacks a property, is cut off, holds NaN, or more than
            is read (`peaking.limits`).
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size > MAX_SPLAT_BYTES:
                raise SplatFileError(f"{path}: has more than {MAX_SPLAT_BYTES:,} bytes")
            head = file.read(_HEAD_BYTES)
            start, n, names = _layout(path, head)
            if size - start != 4 * n * len(names):
                needs = f"needs {4 * n * len(names)} bytes of data, has {size - start}"
                raise SplatFileError(f"{path}: {needs}")
            file.seek(start)
            gaussians = _gaussians(path, file, n, names, max_degree)
            return replace(gaussians, origin_m=_origin_m(path, head[:start]))
    except OSError as error:
        raise SplatFileError(f"{path}: cannot be read ({error.strerror})") from error


def _layout(path: Path, data: bytes) -> tuple[int, int, list[str]]:
    """Return where the numbers begin, how many Gaussians there are, and what they have."""
    head, mark, _ = data.partition(b"end_header\n")
    lines = head.decode("ascii", errors="replace").split("\n")
    if not mark or lines[0].strip() != "ply" or "binary_little_endian" not in " ".join(lines[1:2]):
        raise SplatFileError(f"{path}: is not a binary little-endian .ply file")
    names: list[str] = []
    n = -1
    for line in lines[2:]:
        match line.split():
            case ["element", "vertex", count] if count.isdecimal() and len(count) < 12 and n < 0:
                n = int(count)
            case ["property", "float", name]:
                names.append(name)
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                said = line.strip()[:60]
                raise SplatFileError(f"{path}: does not hold Gaussians: {said!r}")
    rest = sum(name.startswith("f_rest_") for name in names)
    needed = _names(-(-rest // 3))
    missing = [name for name in needed if name not in names and name not in ("nx", "ny", "nz")]
    if n < 0 or missing:
        raise SplatFileError(f"{path}: lacks {', '.join(missing) or 'vertices'}; not a splat file")
    if len(set(names)) < len(names):
        raise SplatFileError(f"{path}: has a property twice; not a splat file")
    if n > MAX_GAUSSIANS:
        raise SplatFileError(f"{path}: has {n:,} Gaussians, and at most {MAX_GAUSSIANS:,} are read")
    return len(head) + len(mark), n, names


def _origin_m(path: Path, head: bytes) -> Float64[np.ndarray, "3"]:
    """Return where the positions are counted from, as a comment says."""
    for line in head.decode("ascii", errors="replace").split("\n"):
        if line.startswith(_ORIGIN):
            try:
                origin_m = np.array([float(word) for word in line[len(_ORIGIN) :].split()])
            except ValueError:
                origin_m = np.zeros(0)
            if origin_m.shape != (3,) or not np.isfinite(origin_m).all():
                raise SplatFileError(f"{path}: need three numbers: {line.strip()[:60]!r}")
            return origin_m
    return np.zeros(3)


def _gaussians(path: Path, file: BinaryIO, n: int, names: list[str], max_degree: int) -> Gaussians:
    per_channel = sum(name.startswith("f_rest_") for name in names) // 3
    there = [count for count in NUM_COEFFICIENTS[: max_degree + 1] if count <= 1 + per_channel]
    sh = [[f"f_dc_{c}" for c in range(3)]]
    sh += [[f"f_rest_{c * per_channel + k}" for c in range(3)] for k in range(there[-1] - 1)]
    parts = {
        "means_m": ["x", "y", "z"],
        "log_scales": ["scale_0", "scale_1", "scale_2"],
        "quaternions": ["rot_0", "rot_1", "rot_2", "rot_3"],
        "opacity_logits": ["opacity"],
        "sh": [name for coefficient in sh for name in coefficient],
    }
    columns = {part: [names.index(name) for name in wanted] for part, wanted in parts.items()}
    values = {part: np.empty((n, len(wanted)), np.float32) for part, wanted in parts.items()}
    at_once = max(1, _BLOCK_BYTES // (4 * len(names)))
    for first in range(0, n, at_once):
        rows = min(at_once, n - first)
        data = file.read(4 * rows * len(names))
        if len(data) < 4 * rows * len(names):
            raise SplatFileError(f"{path}: was cut off while it was read")
        block = np.frombuffer(data, "<f4").reshape(rows, len(names))
        for part, own in columns.items():
            values[part][first : first + rows] = block[:, own]
    coefficients = values["sh"].reshape(n, len(sh), 3)
    while len(there) > 1 and not coefficients[:, there[-2] : there[-1]].any():
        there.pop()
    coefficients = coefficients[:, : there[-1]]
    try:
        return Gaussians(
            means_m=values["means_m"],
            log_scales=values["log_scales"],
            quaternions=values["quaternions"],
            opacity_logits=values["opacity_logits"][:, 0],
            sh=coefficients.copy(),
        )
    except ValueError as error:
        raise SplatFileError(f"{path}: {error}") from error


def _names(num_rest: int) -> list[str]:
    """Return all properties for so many coefficients per channel above degree 0."""
    rest = [f"f_rest_{k}" for k in range(3 * num_rest)]
    scale = [f"scale_{k}" for k in range(3)]
    rotation = [f"rot_{k}" for k in range(4)]
    dc = [f"f_dc_{k}" for k in range(3)]
    return ["x", "y", "z", "nx", "ny", "nz", *dc, *rest, "opacity", *scale, *rotation]
