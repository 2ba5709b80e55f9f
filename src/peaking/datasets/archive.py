"""Recordings in zip files: unpacked once into the user's cache, with limits."""

from __future__ import annotations

import shutil
import stat
import zipfile
import zlib
from pathlib import Path

from peaking.datasets.cache import made_once
from peaking.errors import RecordingError
from peaking.limits import MAX_ARCHIVE_BYTES, MAX_ARCHIVE_FILES, MAX_ARCHIVE_RATIO

_START = b"PK\x03\x04"
_BLOCK_BYTES = 1 << 20
_IGNORED = ("__MACOSX/", ".DS_Store")
_AGAIN = "export or copy it again"


def is_archive(path: Path) -> bool:
    """Return whether a file begins as a zip does."""
    try:
        with path.open("rb") as file:
            return file.read(len(_START)) == _START
    except OSError:
        return False


def unpacked(path: Path) -> Path:
    """Return the folder that holds what is in a zip.

    Raises:
        RecordingError: It is damaged or cut off, its files would lie outside of the folder, or
            they are more, or larger, than is read (`peaking.limits`).
        OutputError: The cache cannot be written to, or is full.
    """
    return made_once(path, "unpacked", lambda folder: _unpack(path, folder / _stem(path))) / (
        _stem(path)
    )


def _stem(path: Path) -> str:
    return path.stem.strip(". ") or "recording"


def _unpack(path: Path, folder: Path) -> None:
    folder.mkdir()
    try:
        with zipfile.ZipFile(path) as archive:
            members = [
                one
                for one in archive.infolist()
                if not one.is_dir() and not one.filename.startswith(_IGNORED)
            ]
            _check(path, members)
            for member in members:
                _copy(path, archive, member, folder)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise RecordingError(path, f"is not a sound zip ({error})", remedy=_AGAIN) from error


def _check(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Refuse what should not be unpacked, by what the directory of the zip says."""
    if len(members) > MAX_ARCHIVE_FILES:
        problem = f"holds {len(members):,} files, and at most {MAX_ARCHIVE_FILES:,} are unpacked"
        raise RecordingError(path, problem, remedy="unpack it yourself, and name the folder")
    total = sum(member.file_size for member in members)
    packed = max(1, path.stat().st_size)
    if total > MAX_ARCHIVE_BYTES or total > MAX_ARCHIVE_RATIO * packed:
        problem = f"would be {total / 1e9:,.1f} GB unpacked, of {packed / 1e6:,.1f} MB"
        raise RecordingError(path, problem, remedy="unpack it yourself, and name the folder")
    for member in members:
        name = member.filename
        parts = name.replace("\\", "/").split("/")
        if name.startswith(("/", "\\")) or ".." in parts or ":" in parts[0] or "\0" in name:
            raise RecordingError(
                path, f"holds a file that would lie outside: {name!r}", remedy=_AGAIN
            )
        if stat.S_ISLNK(member.external_attr >> 16):
            raise RecordingError(path, f"holds a link: {name!r}", remedy="pack the files")
        if member.flag_bits & 1:
            remedy = "unpack it yourself, and name the folder"
            raise RecordingError(path, "is encrypted", remedy=remedy)


def _copy(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    target = folder / member.filename.replace("\\", "/")
    if target.exists() or any(parent.is_file() for parent in target.parents):
        raise RecordingError(path, f"holds {member.filename!r} twice", remedy=_AGAIN)
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(member) as source, target.open("wb") as file:
        # zipfile stops at the size that the directory states, and compares the checksum.
        shutil.copyfileobj(source, file, _BLOCK_BYTES)
    if target.stat().st_size != member.file_size:
        raise RecordingError(path, f"is cut off in {member.filename!r}", remedy=_AGAIN)
