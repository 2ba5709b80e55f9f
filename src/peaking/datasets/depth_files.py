"""Depth maps as they lie in files: 16-bit PNG, TIFF, OpenEXR, .npy and .npz."""

from __future__ import annotations

import importlib.util
import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy.lib import format as npy_format
from numpy.lib.format import open_memmap

from peaking.datasets.foreign_files import opened, real_path
from peaking.datasets.stored_images import CUT_OFF, explained, head_of, picture_bytes
from peaking.errors import RecordingError, ToolMissing
from peaking.limits import MAX_PICTURE_BYTES
from peaking.pictures import exr, png, tiff
from peaking.pictures.decoding import decode_elsewhere, decode_stored
from peaking.pictures.too_costly import check_pixels

_FORMAT = (
    "store depth as a PNG or TIFF of 16 bits with one channel, a floating-point TIFF, an OpenEXR "
    "picture, or as an array (height, width) in an .npy or .npz"
)
_ARRAYS = ("depth", "depth_m", "arr_0")
"""Of an .npz that holds several; the first that there is."""
_MOST_HALF = 65504.0
"""The largest number of 16-bit floats: in OpenEXR what is as far away, or farther, is nothing."""


def depth_size_px(path: Path, *, within: Path | None = None) -> tuple[int, int]:
    """Return width and height of a depth map from its header.

    Args:
        path: The file.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read or is no depth map of a kind that is read.
        ToolMissing: The extra that its kind needs is not installed.
    """
    return _looked_at(path, within)[:2]


def is_floating(path: Path, *, within: Path | None = None) -> bool:
    """Return whether a depth map, whose header is sound, holds floating-point numbers.

    Raises:
        RecordingError: The file cannot be read.
    """
    return _looked_at(path, within)[2]


def read_depth(
    path: Path, unit_m: float, *, within: Path | None = None
) -> Float32[np.ndarray, "h w"] | None:
    """Decode a depth map to metres, 0 = unknown; None where nothing is known.

    Unknown is what is not finite or not > 0, and the largest number of integers and of 16-bit
    floats: what a sensor writes where it measures nothing, or a program where something is too far.

    Args:
        path: The file.
        unit_m: Of its values, in metres.
        within: A folder; links that lead out of it are refused.

    Raises:
        RecordingError: The file cannot be read, or is not complete.
        ToolMissing: The extra that its kind needs is not installed.
    """
    stored, most = _stored(path, within)
    if stored.ndim != 2:
        raise RecordingError(path, f"has shape {stored.shape}", remedy=_FORMAT)
    with np.errstate(over="ignore"):  # what float32 has no room for is unknown
        depth_m = stored.astype(np.float32) * np.float32(unit_m)
    known = np.isfinite(depth_m) & (depth_m > 0)
    if most is not None:
        known &= stored < most
    return np.where(known, depth_m, np.float32(0)) if known.any() else None


def _looked_at(path: Path, within: Path | None) -> tuple[int, int, bool]:
    """Return width, height, and whether numbers are floating-point."""
    if path.suffix.lower() == ".npy":
        array = _npy(path, within)
        return array.shape[1], array.shape[0], array.dtype.kind == "f"
    if path.suffix.lower() == ".npz":
        with _npz_member(path, within) as (_, shape, kind):
            return shape[1], shape[0], kind.kind == "f"
    head = head_of(path, within)
    if head.startswith(exr.START):
        if importlib.util.find_spec("OpenEXR") is None:
            raise ToolMissing(f"{path}: {exr.NEEDED}")
        header = explained(path, exr.exr_header, head, remedy=_FORMAT)
        explained(path, lambda one: one.depth_channel(), header, remedy=_FORMAT)
        explained(path, lambda one: check_pixels(one.width_px, one.height_px), header)
        return header.width_px, header.height_px, True
    if tiff.is_tiff(head):
        return _tiff(path, within)
    width, height, bits, color = explained(path, png.png_header, head, remedy=_FORMAT)
    if (bits, color) != (16, 0):
        channels = {0: "grey", 2: "RGB", 3: "palette", 4: "grey and alpha", 6: "RGBA"}
        raise RecordingError(path, f"is {bits}-bit {channels[color]}", remedy=_FORMAT)
    return width, height, False


def _stored(path: Path, within: Path | None) -> tuple[np.ndarray, float | None]:
    """Return what is stored, and the number from which on it is no measurement."""
    if path.suffix.lower() == ".npy":
        stored = _npy(path, within)
    elif path.suffix.lower() == ".npz":
        stored = _npz(path, within)
    else:
        data = picture_bytes(path, within)
        if data.startswith(exr.START):
            header = explained(path, exr.exr_header, data, remedy=_FORMAT)
            name = explained(path, lambda one: one.depth_channel(), header, remedy=_FORMAT)
            return explained(path, lambda one: decode_elsewhere(one, name), data), _MOST_HALF
        if tiff.is_tiff(data):
            _tiff(path, within)
        stored = explained(path, decode_stored, data)
    return stored, _largest(stored.dtype)


def _largest(kind: np.dtype) -> float | None:
    """Return the largest number of a type where it is no measurement: of all but large floats."""
    if kind.kind in "ui":
        return float(np.iinfo(kind).max)
    return float(np.finfo(kind).max) if kind.itemsize == 2 else None


def _tiff(path: Path, within: Path | None) -> tuple[int, int, bool]:
    header = explained(path, tiff.tiff_header, picture_bytes(path, within))
    explained(path, lambda one: check_pixels(one.width_px, one.height_px), header)
    kinds = (32, 64) if header.is_floating else (16,)
    if header.channels != 1 or header.bits not in kinds or header.is_signed:
        kind = "floating-point " if header.is_floating else "signed " if header.is_signed else ""
        problem = f"is a {kind}TIFF of {header.bits} bits and {header.channels} channels"
        raise RecordingError(path, problem, remedy=_FORMAT)
    return header.width_px, header.height_px, header.is_floating


def _npy(path: Path, within: Path | None) -> np.ndarray:
    """Map an .npy file into memory; its length is checked against its header."""
    with real_path(path, within=within) as name:
        try:
            array = open_memmap(name, mode="r")  # np.load opens archives and pickles too
        except Exception as error:  # damaged bytes raise anything
            raise RecordingError(path, f"is not a sound .npy ({error})", remedy=CUT_OFF) from error
    _check(path, array.shape, array.dtype)
    return array


def _npz(path: Path, within: Path | None) -> np.ndarray:
    with _npz_member(path, within) as (file, _, _):
        try:
            return npy_format.read_array(file, allow_pickle=False)
        except Exception as error:  # damaged bytes raise anything
            raise RecordingError(path, f"is not a sound .npz ({error})", remedy=CUT_OFF) from error


@contextmanager
def _npz_member(
    path: Path, within: Path | None
) -> Generator[tuple[Any, tuple[int, ...], np.dtype]]:
    """Yield the array of depth in an .npz as a file at its beginning, its shape and its type."""
    with opened(path, within=within, at_most=MAX_PICTURE_BYTES) as file:
        try:
            archive = zipfile.ZipFile(file)
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            name = names[0] if len(names) == 1 else next((n for n in _ARRAYS if n in names), None)
            shape, kind = (0,), np.dtype(np.float32)
            if name is not None:
                with archive.open(f"{name}.npy") as member:
                    shape, kind = _npy_header(member)
        except Exception as error:  # damaged bytes raise anything
            raise RecordingError(path, f"is not a sound .npz ({error})", remedy=CUT_OFF) from error
        if name is None:
            problem = f"holds {', '.join(names)[:60] or 'nothing'}, and none is called depth"
            raise RecordingError(path, problem, remedy="store one array, or call that one depth")
        _check(path, shape, kind)
        with archive.open(f"{name}.npy") as member:
            yield member, shape, kind


def _npy_header(member: Any) -> tuple[tuple[int, ...], np.dtype]:
    version = npy_format.read_magic(member)
    read = (
        npy_format.read_array_header_1_0 if version == (1, 0) else npy_format.read_array_header_2_0
    )
    shape, _, kind = read(member)
    return shape, kind


def _check(path: Path, shape: tuple[int, ...], kind: np.dtype) -> None:
    if len(shape) != 2 or kind.kind not in "uif" or 0 in shape:
        raise RecordingError(path, f"holds {kind} of shape {shape}", remedy=_FORMAT)
    explained(path, lambda size: check_pixels(size[1], size[0]), shape)
