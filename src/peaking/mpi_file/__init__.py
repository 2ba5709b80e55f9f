"""The bytes of an `Mpi`, one format for disk and wire (`.mpi`).

Layout, formulas and how to read it from other languages: docs/mpi-format.md. What is read may come
from anywhere, so every length is checked before anything of that length is made.
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Int32

from peaking.errors import MpiFileError
from peaking.geometry import Camera
from peaking.limits import MAX_MPI_BYTES
from peaking.mpi import Mpi, tile_grid
from peaking.mpi_file._header import MAX_HEADER_BYTES, Codec, Header
from peaking.mpi_file._tiles import pack_texels, unpack_texels
from peaking.output import write_atomically

__all__ = ["Codec", "decode", "encode", "is_current", "is_sound", "read_mpi", "write_mpi"]

VERSION = 2
DEFAULT_QUALITY = 90

_MAGIC = b"PKMPI%c\r\n"
_FIXED_BYTES = 16


def encode(mpi: Mpi, *, codec: Codec = "jpeg", quality: int = DEFAULT_QUALITY) -> bytes:
    """Return the bytes of an MPI.

    Args:
        mpi: What to write.
        codec: "jpeg" for display: colour and alpha change a little (docs/mpi-format.md has
            numbers). "lossless" gives every texel back, in five times the bytes.
        quality: JPEG quality of the colours, 1…100; "lossless" has no use for it.

    Raises:
        ValueError: The codec or quality does not exist, tiles are outside the planes or not sorted,
            the camera is not a rotation and a translation, or the format has no room for it.
    """
    if not 1 <= quality <= 100:
        raise ValueError(f"need a quality of 1..100, got {quality}")
    header = Header(
        pinhole=mpi.camera.pinhole,
        world_from_cam=mpi.camera.world_from_cam,
        plane_depths_m=mpi.plane_depths_m,
        generator=mpi.generator,
        codec=codec,
        num_tiles=len(mpi.texels),
    )
    occupancy, stacks = _occupancy(mpi)
    payload = pack_texels(mpi.texels, codec, stacks, quality=quality, meanwhile=header.check)
    json_bytes = header.to_json(len(occupancy), len(payload))
    checksum = zlib.crc32(payload, zlib.crc32(occupancy, zlib.crc32(json_bytes)))
    fixed = (
        _MAGIC % VERSION + len(json_bytes).to_bytes(4, "little") + checksum.to_bytes(4, "little")
    )
    return b"".join([fixed, json_bytes, occupancy, payload])


def decode(data: bytes) -> Mpi:
    """Return the MPI whose bytes these are.

    Raises:
        MpiFileError: They are not a sound `.mpi` file of a version that is known here.
    """
    header_end = _check_frame(data)
    try:
        header, occupancy_bytes, payload_bytes = Header.from_json(data[_FIXED_BYTES:header_end])
        header.check()
    except ValueError as error:
        raise MpiFileError(f"unsound header: {error}") from error
    payload_start = header_end + occupancy_bytes
    if payload_start + payload_bytes != len(data):
        raise MpiFileError(
            f"the header promises {payload_start + payload_bytes} bytes, got {len(data)}"
        )
    places = _places(data[header_end:payload_start], header)
    texels = unpack_texels(data[payload_start:], header.codec, _stacks(places, header))
    return Mpi(
        camera=Camera(header.pinhole, header.world_from_cam),
        plane_depths_m=header.plane_depths_m,
        tile_places=places,
        texels=texels,
        generator=header.generator,
    )


def write_mpi(
    path: Path, mpi: Mpi, *, codec: Codec = "jpeg", quality: int = DEFAULT_QUALITY
) -> None:
    """Write an MPI so that the file is there in full or not at all.

    Raises:
        ValueError: As in `encode`.
        OutputError: The path is a folder, cannot be written to, or the disk is full.
    """
    write_atomically(path, encode(mpi, codec=codec, quality=quality))


def read_mpi(path: Path) -> Mpi:
    """Read what `write_mpi` wrote.

    Raises:
        MpiFileError: The file cannot be read, or as in `decode`; the message names the file.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_MPI_BYTES + 1)
    except OSError as error:
        raise MpiFileError(
            f"{path}: cannot be read ({os.strerror(error.errno or 0)}); give an .mpi file"
        ) from error
    try:
        return decode(data)
    except MpiFileError as error:
        raise MpiFileError(f"{path}: {error}") from error


def is_current(path: Path) -> bool:
    """Return whether a file is there and begins as one of the version that is written now."""
    try:
        with path.open("rb") as file:
            return file.read(len(_MAGIC % VERSION)) == _MAGIC % VERSION
    except OSError:
        return False


def is_sound(parts: Iterable[bytes], size: int) -> bool:
    """Return whether a file of `size` bytes, read in parts, is what its checksum promises.

    Args:
        parts: What it holds; the first of them has 16 bytes or more, if the file has.
        size: How many bytes it has.
    """
    rest = iter(parts)
    first = next(rest, b"")
    try:
        _header_end(first, size)
    except MpiFileError:
        return False
    found, checksum = len(first), zlib.crc32(memoryview(first)[_FIXED_BYTES:])
    for part in rest:
        found, checksum = found + len(part), zlib.crc32(part, checksum)
    return found == size and checksum == _checksum_in(first)


def _check_frame(data: bytes) -> int:
    """Check what surrounds the content; return where the header ends."""
    end = _header_end(data, len(data))
    if zlib.crc32(memoryview(data)[_FIXED_BYTES:]) != _checksum_in(data):
        raise MpiFileError("damaged or broken off (the checksum differs); fetch or write it again")
    return end


def _checksum_in(data: bytes) -> int:
    return int.from_bytes(data[12:16], "little")


def _header_end(data: bytes, size: int) -> int:
    """Return where the header ends of a file of `size` bytes that begins with `data`."""
    start = data[:8]
    if len(start) < 8 or start[:5] != _MAGIC[:5] or start[6:] != b"\r\n":
        raise MpiFileError("not an .mpi file (it does not begin with PKMPI)")
    if start[5] != VERSION:
        raise MpiFileError(
            f"format version {start[5]}, and this program reads version {VERSION}; "
            "use the program that wrote it, or write it again"
        )
    if size > MAX_MPI_BYTES:
        raise MpiFileError(f"need at most {MAX_MPI_BYTES} bytes, got {size}")
    if min(size, len(data)) < _FIXED_BYTES:
        raise MpiFileError(f"broken off after {size} bytes")
    header_bytes = int.from_bytes(data[8:12], "little")
    if header_bytes > MAX_HEADER_BYTES:
        raise MpiFileError(f"need a header of at most {MAX_HEADER_BYTES} bytes, got {header_bytes}")
    if _FIXED_BYTES + header_bytes > size:
        raise MpiFileError(f"broken off inside the header, after {size} bytes")
    return _FIXED_BYTES + header_bytes


def _grid(header: Header) -> tuple[int, int, int]:
    return (len(header.plane_depths_m), *tile_grid(*header.pinhole.size_px))


def _stacks(places: Int32[np.ndarray, "tiles 3"], header: Header) -> Int32[np.ndarray, "tiles"]:
    """Return row and column of every tile as one number."""
    return (places[:, 1] * _grid(header)[2] + places[:, 2]).astype(np.int32)


def _occupancy(mpi: Mpi) -> tuple[bytes, Int32[np.ndarray, "tiles"]]:
    """Return one bit per place, set where there is a tile, and the stack of every tile."""
    from peaking.mpi_file._kernels import mark_places

    grid = (mpi.num_planes, *tile_grid(*mpi.camera.pinhole.size_px))
    held = np.zeros(grid, dtype=np.bool_)
    stacks = np.empty(len(mpi.tile_places), dtype=np.int32)
    wrong = mark_places(mpi.tile_places, held, stacks)
    if wrong == 1:
        raise ValueError(f"need tile_places inside planes, rows, cols = {grid}")
    if wrong == 2:
        raise ValueError("need tile_places sorted by (plane, row, column), each place once")
    return np.packbits(held).tobytes(), stacks


def _places(occupancy: bytes, header: Header) -> Int32[np.ndarray, "tiles 3"]:
    """Return plane, row and column of every set bit."""
    grid = _grid(header)
    num_places = int(np.prod(grid))
    if len(occupancy) != -(-num_places // 8):
        raise MpiFileError(
            f"need {-(-num_places // 8)} bytes of occupancy for {grid} places, got {len(occupancy)}"
        )
    packed = np.frombuffer(occupancy, dtype=np.uint8)
    num_set = int(np.bitwise_count(packed).sum())
    if num_set != header.num_tiles:
        raise MpiFileError(f"the header promises {header.num_tiles} tiles, {num_set} bits are set")
    flat = np.flatnonzero(np.unpackbits(packed))
    if len(flat) and flat[-1] >= num_places:
        raise MpiFileError("bits are set after the last place")
    return np.stack(np.unravel_index(flat, grid), axis=-1).astype(np.int32)
