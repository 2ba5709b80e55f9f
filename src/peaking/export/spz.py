"""Looks at .spz files before they are unpacked: how much they hold (github.com/nianticlabs/spz)."""

from __future__ import annotations

import gzip
import importlib
import struct
import zlib
from pathlib import Path
from typing import Any

from peaking.errors import BackendUnavailable, SplatFileError
from peaking.limits import MAX_GAUSSIANS

GZIP, MAGIC = b"\x1f\x8b", b"NGSP"
BYTES_PER_GAUSSIAN = 92
"""At most: position, opacity, colour, scales, rotation, harmonics of degree 4."""
MORE_BYTES = 1 << 20
"""Header and extensions."""
_BLOCK_BYTES = 1 << 20
_HEADER_BYTES = 32
_ENTRY_BYTES = 16


def check_spz(path: Path, install: str) -> None:
    """Refuse what is no .spz file, and one that unpacks to more than it says it holds.

    Args:
        path: The file.
        install: How to get zstandard, where version 4 needs it.

    Raises:
        SplatFileError: It is such a file, or cannot be read.
        BackendUnavailable: zstandard is missing.
    """
    try:
        with path.open("rb") as file:
            is_gzip = file.read(2) == GZIP
        if is_gzip:
            _check_gzip(path)
        else:
            _check_zstd(path, path.read_bytes(), install)
    except (OSError, EOFError, zlib.error, struct.error) as error:
        raise SplatFileError(f"{path}: is no sound .spz file ({error})") from error


def _check_gzip(path: Path) -> None:
    with gzip.open(path) as file:
        left = _room(path, file.read(16))
        while part := file.read(_BLOCK_BYTES):
            left -= len(part)
            if left < 0:
                raise SplatFileError(f"{path}: unpacks to more than its Gaussians take")


def _check_zstd(path: Path, data: bytes, install: str) -> None:
    left = _room(path, data[:16])
    streams, at = struct.unpack_from("<BI", data, 15)
    zstandard = _zstandard(install)
    start = at + streams * _ENTRY_BYTES
    if at < _HEADER_BYTES or start > len(data):
        raise SplatFileError(f"{path}: is cut off")
    for number in range(streams):
        (size,) = struct.unpack_from("<Q", data, at + number * _ENTRY_BYTES)
        try:
            left -= max(0, zstandard.frame_content_size(data[start : start + size]))
        except zstandard.ZstdError as error:
            raise SplatFileError(f"{path}: is no sound .spz file ({error})") from error
        start += size
    if left < 0:
        raise SplatFileError(f"{path}: unpacks to more than its Gaussians take")


def _room(path: Path, head: bytes) -> int:
    """Return how many bytes the Gaussians that a header names may take."""
    if len(head) < 16 or not head.startswith(MAGIC):
        raise SplatFileError(f"{path}: is no .spz file")
    (count,) = struct.unpack_from("<I", head, 8)
    if count > MAX_GAUSSIANS:
        raise SplatFileError(f"{path}: has {count:,} Gaussians, and at most {MAX_GAUSSIANS:,}")
    return count * BYTES_PER_GAUSSIAN + MORE_BYTES


def _zstandard(install: str) -> Any:
    try:
        return importlib.import_module("zstandard")
    except ImportError as error:
        raise BackendUnavailable(f"zstandard is not installed: {install}") from error
