"""Identifiers match whole strings: a line break at the end is no part of any of them."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import peaking.server
import peaking.study

ENDS = ["\n", "\r", "\r\n", "\u2028", "\x85", "\0", " "]


def patterns_in(kind: Any) -> Iterator[str]:
    """Yield the patterns of a type, however deep."""
    if get_origin(kind) is Annotated:
        metas = [m for m in kind.__metadata__ if isinstance(m, msgspec.Meta)]
        yield from (m.pattern for m in metas if m.pattern is not None)
    for inner in get_args(kind):
        yield from patterns_in(inner)


def modules() -> Iterator[ModuleType]:
    for package in (peaking.server, peaking.study):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if ".analysis" not in found.name and ".statistics" not in found.name:
                yield importlib.import_module(found.name)


def all_patterns() -> set[str]:
    found: set[str] = set()
    for module in modules():
        for value in vars(module).values():
            found |= set(patterns_in(value))
            if isinstance(value, type) and issubclass(value, msgspec.Struct):
                for hint in get_type_hints(value, include_extras=True).values():
                    found |= set(patterns_in(hint))
    return found


PATTERNS = sorted(all_patterns())


def test_the_patterns_are_found() -> None:
    assert len(PATTERNS) >= 6


@pytest.mark.parametrize("pattern", PATTERNS)
@given(st.data())
def test_nothing_may_follow_an_identifier(pattern: str, data: st.DataObject) -> None:
    kind = Annotated[str, msgspec.Meta(pattern=pattern)]
    good = data.draw(st.from_regex(pattern))
    assert msgspec.convert(good, kind) == good
    assert re.fullmatch(pattern, good)
    for end in ENDS:
        for wrong in (good + end, end + good):
            with pytest.raises(msgspec.ValidationError):
                msgspec.convert(wrong, kind)
