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
    _rewrite(top, folder, is_path=False)


def _rewrite(value: dict[str, Any] | list[Any], folder: Path, *, is_path: bool) -> None:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in list(items):
        named = is_path or (isinstance(key, str) and key.endswith(_PATHS))
        if isinstance(inner, str):
            if named and ("\\" in inner or _ROOTED.match(inner)):
                cast("dict[Any, Any]", value)[key] = _relative(inner, folder)
        elif isinstance(inner, dict | list):
            _rewrite(cast("dict[str, Any]", inner), folder, is_path=named)


def _relative(text: str, folder: Path) -> str:
    slashed = text.replace("\\", "/")
    if not _ROOTED.match(slashed):
        return slashed
    parts = [part for part in slashed.split("/") if part not in ("", ".")]
    if ".." in parts or "\0" in text:
        return text
    # os.path's test answers False for names that no file can have; Path's raises.
    ends = ("/".join(parts[i:]) for i in range(max(0, len(parts) - _MOST_PARTS), len(parts)))
    return next((end for end in ends if not _ROOTED.match(end) and _lies_in(folder, end)), text)


def _lies_in(folder: Path, name: str) -> bool:
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
