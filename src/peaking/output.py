"""Output that is complete or absent: never half a folder, never half a file.

Inside, write with `Path.write_bytes` and the encoders below: `cv2.imwrite` answers a full disk with
`False` and nothing else.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import secrets
import shutil
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import simplejpeg
from jaxtyping import Float, UInt8, UInt16

from peaking.errors import OutputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says when a disk is full, or the share of it that one may use."""

SATURATED_MM = 65535
"""The largest number of 16 bits: no depth, but what stands for none (`datasets.stored_images`)."""

_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EOPNOTSUPP, errno.EMLINK)
"""What a file system says that has no hard links."""

_FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)


@contextlib.contextmanager
def complete_or_absent(out: Path) -> Generator[Path, None, None]:
    """Yield a hidden folder beside `out` that becomes `out` when the block ends well.

    Only its owner can look into it: what is written may be people's photos or answers. It is
    flushed to the disk and renamed in one step. When the block raises (a `KeyboardInterrupt`
    too), it is removed, and so are parents of `out` that were made for it.

    Raises:
        OutputError: `out` exists and is not an empty folder, cannot be written to, or the disk is
            full.
    """
    target = Path(os.path.realpath(out))
    _refuse_taken(target, out)
    partial = _hidden_sibling(target)
    with _parents_made(target, out):
        try:
            with _explained(out, partial):
                partial.mkdir(mode=0o700)
            # What the block raises is only translated where it speaks of this folder.
            with _explained(out, partial, only_within=True):
                yield partial
            with _explained(out, partial):
                _flush_tree(partial)
                partial.rename(target)
                flush(target.parent)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise


def check_new(out: Path) -> None:
    """Refuse, before any work, a folder that `complete_or_absent` would refuse.

    Raises:
        OutputError: It exists and is not an empty folder.
    """
    _refuse_taken(Path(os.path.realpath(out)), out)


@contextlib.contextmanager
def replaced(path: Path) -> Generator[Path, None, None]:
    """Yield where to write a file that becomes `path` in one step; parents are made.

    It does when the block ends well, and is removed when the block raises.

    Raises:
        OutputError: The path is a folder, cannot be written to, or the disk is full.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file")
    partial = _hidden_sibling(target)
    with _parents_made(target, path):
        try:
            # What the block raises is only translated where it speaks of this file.
            with _explained(path, partial, only_within=True):
                yield partial
            with _explained(path, partial):
                flush(partial)
                partial.replace(target)
                flush(target.parent)
        except BaseException:
            with contextlib.suppress(OSError):  # a read-only disk refuses this too
                partial.unlink(missing_ok=True)
            raise


def check_folder(folder: Path) -> None:
    """Refuse a file, and what would lie below one, as a folder to write into; makes nothing.

    Raises:
        OutputError: It is such a place, or cannot be looked at.
    """
    with _explained(folder, folder):
        if folder.is_dir():
            return
        if os.path.lexists(folder):
            raise OutputError(f"{folder}: is a file; give the name of a folder")
        above = next(parent for parent in folder.absolute().parents if os.path.lexists(parent))
        if not above.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file, or replace it, in one step; parents are made.

    Raises:
        OutputError: The path is a folder, cannot be written to, or the disk is full.
    """
    with replaced(path) as partial, _explained(path, partial):
        partial.write_bytes(data)


def write_new(path: Path, data: bytes) -> None:
    """Write a file that must not be there yet, in one step; nothing is ever replaced.

    Raises:
        OutputError: There is something of that name, the folder cannot be written to, or the disk
            is full.
    """
    partial = _hidden_sibling(path)
    with _explained(path, partial):
        try:
            partial.write_bytes(data)
            flush(partial)
            try:
                os.link(partial, path)
            except OSError as error:
                if error.errno not in _NO_LINKS:
                    raise
                # This file system has no links: a name is taken first, then replaced.
                os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
                partial.replace(path)
            try:
                flush(path.parent)
            except BaseException:
                path.unlink()
                raise
        finally:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)


Image = (
    UInt8[np.ndarray, "h w 3"]
    | UInt8[np.ndarray, "h w 4"]
    | UInt8[np.ndarray, "h w"]
    | UInt16[np.ndarray, "h w"]
)


def encode_png(picture: Image) -> bytes:
    """Return RGB, RGB with straight alpha, grey, or depth in millimetres as the bytes of a PNG."""
    turned = picture
    if picture.ndim == 3:
        how = cv2.COLOR_RGB2BGR if picture.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
        turned = cv2.cvtColor(picture, how)
    done, data = cv2.imencode(".png", turned)
    if not done:
        raise ValueError(f"need a picture that PNG can hold, got {picture.dtype} {picture.shape}")
    return data.tobytes()


def depth_mm(depth_m: Float[np.ndarray, "h w"]) -> UInt16[np.ndarray, "h w"]:
    """Return depth in whole millimetres; 0, unknown, is also what 16 bits have no room for."""
    with np.errstate(invalid="ignore", over="ignore"):
        mm = np.rint(depth_m * 1000.0)
    return np.where((mm > 0) & (mm < SATURATED_MM), mm, 0).astype(np.uint16)


def encode_jpeg(rgb: UInt8[np.ndarray, "h w 3"], *, quality: int = 95) -> bytes:
    """Return an RGB picture as the bytes of a JPEG (4:4:4)."""
    contiguous = np.ascontiguousarray(rgb)
    return simplejpeg.encode_jpeg(contiguous, quality=quality, colorspace="RGB")


def plain(value: object) -> object:
    """Turn options into what JSON has; a value it has not becomes its text, never a failure."""
    if isinstance(value, Mapping):
        mapping = cast("Mapping[object, object]", value)
        return {str(key): plain(inner) for key, inner in mapping.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(cast("object", value.tolist()))  # pyright: ignore[reportUnknownMemberType]
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in cast("Sequence[object]", value)]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)


def _refuse_taken(target: Path, out: Path) -> None:
    try:
        if target.is_dir():
            if any(target.iterdir()):
                raise OutputError(f"{out}: is not empty; give a new folder or empty this one")
            if os.path.ismount(target):
                raise OutputError(f"{out}: is a mount point; give a new folder inside it")
        elif os.path.lexists(target):
            raise OutputError(f"{out}: is a file; give the name of a new folder")
    except OSError as error:
        raise OutputError(_sentence(error, out)) from error


def _hidden_sibling(target: Path, token: Callable[[int], str] = secrets.token_hex) -> Path:
    """Return a free name on the same file system, where a rename is one step."""
    return target.with_name(f".{target.name}.partial-{token(4)}")


@contextlib.contextmanager
def _parents_made(target: Path, out: Path) -> Generator[None, None, None]:
    """Make missing parents; take back the ones made here when the block raises."""
    missing = [parent for parent in target.parents if not parent.exists()]
    made: list[Path] = []
    try:
        with _explained(out, target):
            for parent in reversed(missing):
                parent.mkdir(exist_ok=True)
                made.append(parent)
                flush(parent.parent)
        yield
    except BaseException:
        for parent in reversed(made):
            with contextlib.suppress(OSError):  # someone else may have put something there
                parent.rmdir()
        raise


@contextlib.contextmanager
def _explained(
    out: Path, partial: Path, *, only_within: bool = False
) -> Generator[None, None, None]:
    """Turn the system's refusal to write into a sentence that says what to do.

    With `only_within`, an error stays as it is when it may be about something else than writing
    below `partial`: the block under guard also reads files from elsewhere.
    """
    try:
        yield
    except OSError as error:
        if only_within and not _is_about_writing(error, partial):
            raise
        raise OutputError(_sentence(error, out)) from error


def _is_about_writing(error: OSError, partial: Path) -> bool:
    if error.errno in (*NO_ROOM, errno.EROFS):
        return True
    named = [name for name in (error.filename, error.filename2) if isinstance(name, str)]
    return error.errno in _FORBIDDEN and any(Path(name).is_relative_to(partial) for name in named)


def _sentence(error: OSError, out: Path) -> str:
    if error.errno in NO_ROOM:
        return (
            f"{out}: no room: {error.strerror} ({_free_mb(out):.0f} MB free); "
            "nothing was kept: free some space or give a folder on another disk"
        )
    if error.errno in _FORBIDDEN:
        return f"{out}: not writable ({error.strerror}); give a folder that you may write to"
    if error.errno in (errno.ENOTEMPTY, errno.EEXIST):
        return f"{out}: something else was written there meanwhile; give a new folder"
    if error.errno == errno.ENOTDIR:
        return f"{out}: lies below something that is a file; give a place inside a folder"
    if error.errno == errno.ENAMETOOLONG:
        return f"{out}: the name is too long for the file system; give a shorter one"
    return f"{out}: cannot be written ({error.strerror}); give a folder on another disk"


def _free_mb(out: Path) -> float:
    """Return the room left where `out` is or would be."""
    real = Path(os.path.realpath(out))
    existing = next(place for place in (real, *real.parents) if place.exists())
    return shutil.disk_usage(existing).free / 1e6


def _flush_tree(folder: Path) -> None:
    for place, _, names in os.walk(folder):
        for name in names:
            flush(Path(place) / name)
        flush(Path(place))


def flush(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
