"""A folder in the user's cache for what takes long to make of a recording: unpacked, or computed.

Every process that opens the same recording finds it there. What nobody used for a month is removed.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import peaking
from peaking.errors import OutputError, RecordingError
from peaking.output import complete_or_absent

KEPT_DAYS = 30
"""What was not used for so long is removed when something else is made."""
_USED = ".used"
_DAY_S = 86400.0


def cache_folder() -> Path:
    """Return where it lies: $PEAKING_CACHE, or `peaking` in the user's cache (XDG)."""
    own = os.environ.get("PEAKING_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "peaking"


def made_once(
    path: Path,
    kind: str,
    make: Callable[[Path], None],
    *,
    options: str = "",
    now_s: Callable[[], float] = time.time,
) -> Path:
    """Return a folder made of a recording, and make it where it is not there yet.

    It is made anew when the recording, the options or the version of peaking change. An exception
    of `make`, a `KeyboardInterrupt` too, leaves nothing behind.

    Args:
        path: The file or folder it is made of.
        kind: What it is: a name for a folder.
        make: Fills an empty folder.
        options: What else the result depends on.
        now_s: The clock.

    Raises:
        RecordingError: The recording cannot be looked at.
        OutputError: The cache cannot be written to.
    """
    text = f"{peaking.__version__};{kind};{options};{os.path.realpath(path)};{state_of(path)}"
    root = cache_folder() / kind
    target = root / hashlib.sha256(text.encode()).hexdigest()[:24]
    if not (target / _USED).is_file():
        _remove_unused(root, now_s() - KEPT_DAYS * _DAY_S)
        try:
            with complete_or_absent(target) as folder:
                make(folder)
                (folder / _USED).touch()
        except OutputError:
            if not (target / _USED).is_file():  # another process may have been faster
                raise
    if os.access(target / _USED, os.W_OK):
        os.utime(target / _USED, (now_s(), now_s()))
    return target


def state_of(path: Path) -> str:
    """Return a text that changes with a file, or with what lies in a folder.

    Raises:
        RecordingError: It is not there, or may not be read.
    """
    digest = hashlib.sha256()
    try:
        for file in _files(path):
            stat = file.stat()
            digest.update(f"{file}:{stat.st_size}:{stat.st_mtime_ns};".encode(errors="replace"))
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(path, problem, remedy="check the file and its rights") from error
    return digest.hexdigest()


def _files(path: Path) -> Iterator[Path]:
    if not path.is_dir():
        yield path
        return
    for folder, names, files in os.walk(path):
        names.sort()
        yield from (Path(folder, name) for name in sorted(files))


def _remove_unused(root: Path, since_s: float) -> None:
    for used in root.glob(f"*/{_USED}"):
        if used.stat().st_mtime < since_s:
            shutil.rmtree(used.parent, ignore_errors=True)
