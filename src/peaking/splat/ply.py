"""The .ply file of 3D Gaussian splatting, with the property names and order of Kerbl et al.

Binary, little endian, float32: x y z, normals (0), f_dc_0…2, f_rest_0…44 (all coefficients of red,
then of green, then of blue; those above our degree are 0, since some viewers read files of degree 3
only), opacity (logit), scale_0…2 (logarithms), rot_0…3 (w x y z, of length 1).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from peaking.errors import SplatFileError
from peaking.limits import MAX_SPLAT_BYTES
from peaking.output import write_atomically
from peaking.splat.gaussians import Gaussians

NUM_REST = 15
"""Coefficients per channel of the degrees 1 to 3."""


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
    header += [f"property float {name}" for name in names]
    header += ["end_header", ""]
    return "\n".join(header).encode("ascii") + values.astype("<f4").tobytes()


def read_ply(path: Path) -> Gaussians:
    """Read a file of this form, of any degree; coefficients above degree 1 are left out.

    Raises:
        SplatFileError: It is not such a file, lacks a property, is cut off or holds NaN.
    """
    try:
        if path.stat().st_size > MAX_SPLAT_BYTES:
            raise SplatFileError(f"{path}: has more than {MAX_SPLAT_BYTES:,} bytes")
        data = path.read_bytes()
    except OSError as error:
        raise SplatFileError(f"{path}: cannot be read ({error.strerror})") from error
    head, mark, body = data.partition(b"end_header\n")
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
                raise SplatFileError(f"{path}: does not hold Gaussians: {line.strip()!r}")
    missing = [name for name in _names(0) if name not in names and name not in ("nx", "ny", "nz")]
    if n < 0 or missing:
        raise SplatFileError(f"{path}: lacks {', '.join(missing) or 'vertices'}; not a splat file")
    if len(body) != 4 * n * len(names):
        raise SplatFileError(f"{path}: needs {4 * n * len(names)} bytes of data, has {len(body)}")
    values = np.frombuffer(body, "<f4").astype(np.float32).reshape(n, len(names))
    columns = {name: values[:, k] for k, name in enumerate(names)}
    return _gaussians(path, columns)


def _gaussians(path: Path, columns: dict[str, np.ndarray]) -> Gaussians:
    def of(*wanted: str) -> np.ndarray:
        return np.stack([columns[name] for name in wanted], axis=1)

    sh = of("f_dc_0", "f_dc_1", "f_dc_2")[:, None]
    num_rest = sum(name.startswith("f_rest_") for name in columns)
    per_channel = num_rest // 3
    if per_channel >= 3:
        rest = of(*(f"f_rest_{c * per_channel + k}" for c in range(3) for k in range(3)))
        if rest.any():
            sh = np.concatenate([sh, rest.reshape(-1, 3, 3).transpose(0, 2, 1)], axis=1)
    try:
        return Gaussians(
            means_m=of("x", "y", "z"),
            log_scales=of("scale_0", "scale_1", "scale_2"),
            quaternions=of("rot_0", "rot_1", "rot_2", "rot_3"),
            opacity_logits=columns["opacity"].copy(),
            sh=np.ascontiguousarray(sh),
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
