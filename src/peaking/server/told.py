"""What phones are told of problems: the cause, and no path of the server's disk."""

from __future__ import annotations

import os
import re
from pathlib import Path

_PATH_FIRST = re.compile(r"(?:~|[A-Za-z]:)?[/\\].*?(?=: |\Z)", re.DOTALL)
"""An error begins with the path of a file, then ": ", as a rule."""
_PATH = re.compile(
    r"(?<![\w.~/:<*-])~?(?:/[^\s/:;,'\"()][^/:;,'\"()\n]*(?=/))*(?:/[^\s/:;,'\"()]+)/?"
)
"""Names of folders may have spaces in them."""


def without_paths(text: str, *folders: Path) -> str:
    """Return a sentence that names files and not where they lie.

    Args:
        text: What went wrong.
        folders: Of the server: what lies below them is named from there.
    """
    for folder in folders:
        for place in {str(folder), os.path.realpath(folder)} - {".", "/"}:
            text = re.sub(rf"(?<![\w./-]){re.escape(place)}(/|(?![\w./-]))", "", text)
    if first := _PATH_FIRST.match(text):
        text = _last(first[0]) + text[first.end() :]
    return _PATH.sub(lambda found: _last(found[0]), text)


def cause_of(error: BaseException) -> str:
    """Return in a few words why something failed that should not: nothing of the program's inside.

    An error of the system is said in its words, a fault of the program by its kind.
    """
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, MemoryError):
        return "not enough memory"
    return f"a fault of the program: {type(error).__name__}"


def _last(path: str) -> str:
    return re.split(r"[/\\]", path.rstrip("/\\"))[-1]
