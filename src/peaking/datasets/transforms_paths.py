"""Paths in transforms.json, from any machine, made relative to its folder; none may leave it.

A backslash is a separator. A path with a root or a drive stands for the longest end of it that lies
in the folder: recordings are moved, and come from Windows.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

PICTURE_ENDINGS = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG", ".heic", ".HEIC")
_ROOTED = re.compile(r"/|[A-Za-z]:")
_LEAVES = re.compile(r"/|\.\.(/|\Z)|[A-Za-z]:")
"""How a path begins that leaves its folder: a root, the folder above, a drive."""
_PATHS = ("_path", "_paths", "_filename", "_filenames")
_MOST_PARTS = 32
"""Of an absolute path: that many of its last parts may lie in the folder."""
_MOST_LOST = 20
"""Where so many lie elsewhere, others are not looked for: the file is refused."""


def leaves(text: str) -> bool:
    """Return whether a path has a root, a drive, a backslash or a zero byte, or goes up by ".."."""
    return bool(_LEAVES.match(os.path.normpath(text))) or "\\" in text or "\0" in text


def paths_in(key: str, value: Any) -> Iterator[str]:
    """Yield the texts in a field that are paths.

    They are those in fields whose names end in `_path`, `_paths`, `_filename` or `_filenames`,
    however deep they lie.
    """
    yield from _texts(value, is_path=key.endswith(_PATHS))


def inner_values(value: Any) -> Iterator[Any]:
    """Yield the lists and objects that a list or an object holds."""
    inner = cast("dict[str, Any]", value).values() if isinstance(value, dict) else value
    yield from (one for one in cast("list[Any]", inner) if isinstance(one, list | dict))


def make_relative(top: dict[str, Any], folder: Path) -> None:
    """Rewrite, in place, the paths that are not relative or have backslashes.

    What does not lie in the folder stays as it is, for who refuses it by its name.

    Args:
        top: What transforms.json holds.
        folder: The one that it lies in.
    """
    _Ends(folder).rewrite(top, is_path=False)


class _Ends:
    """Finds the ends of absolute paths in a folder; the same beginning is dropped again first."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._dropped: list[str] = []
        self._lost = 0

    def rewrite(self, value: dict[str, Any] | list[Any], *, is_path: bool) -> None:
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in list(items):
            named = is_path or (isinstance(key, str) and key.endswith(_PATHS))
            if isinstance(inner, str):
                if named and ("\\" in inner or _ROOTED.match(inner)):
                    cast("dict[Any, Any]", value)[key] = self._relative(inner)
            elif isinstance(inner, dict | list):
                self.rewrite(cast("dict[str, Any]", inner), is_path=named)

    def _relative(self, text: str) -> str:
        slashed = text.replace("\\", "/")
        if not _ROOTED.match(slashed):
            return slashed
        parts = [part for part in slashed.split("/") if part not in ("", ".")]
        if ".." in parts or "\0" in text or self._lost >= _MOST_LOST:
            return text
        known = len(self._dropped)
        starts = [known] if parts[:known] == self._dropped else []
        for start in (*starts, *range(max(0, len(parts) - _MOST_PARTS), len(parts))):
            end = "/".join(parts[start:])
            if not _ROOTED.match(end) and _lies_in(self._folder, end):
                self._dropped = parts[:start]
                return end
        self._lost += 1
        return text


def _lies_in(folder: Path, name: str) -> bool:
    # os.path's test answers False for names that no file can have; Path's raises.
    return any(os.path.isfile(folder / (name + end)) for end in PICTURE_ENDINGS)  # noqa: PTH113


def _texts(value: Any, *, is_path: bool) -> Iterator[str]:
    if isinstance(value, str) and is_path:
        yield value
    elif isinstance(value, list):
        for inner in cast("list[Any]", value):
            yield from _texts(inner, is_path=is_path)
    elif isinstance(value, dict):
        for key, inner in cast("dict[str, Any]", value).items():
            yield from _texts(inner, is_path=is_path or key.endswith(_PATHS))
