"""Write the TypeScript twin of `wire.py`; `make wire` calls it."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from typing import Any, get_args

import msgspec

from peaking.server import wire

HEADER = """// Generated from src/peaking/server/wire.py by `make wire`; do not edit.
/* eslint-disable */
"""

_PLAIN = {
    msgspec.inspect.StrType: "string",
    msgspec.inspect.IntType: "number",
    msgspec.inspect.FloatType: "number",
    msgspec.inspect.BoolType: "boolean",
    msgspec.inspect.NoneType: "null",
}


def typescript() -> str:
    """Return wire.ts: an interface per struct, a type per union of events."""
    lines = [HEADER, f"export const PROTOCOL = {wire.PROTOCOL};"]
    for struct in structs():
        lines += ["", *_interface(struct)]
    for name in ("SessionEvent", "ServerEvent"):
        members = " | ".join(member.__name__ for member in get_args(getattr(wire, name)))
        lines += ["", f"export type {name} = {members};"]
    return "\n".join(lines) + "\n"


def structs() -> list[type[msgspec.Struct]]:
    """Return the structs of the wire, in the order of the file."""
    found = [value for value in vars(wire).values() if isinstance(value, type)]
    return [kind for kind in found if issubclass(kind, wire.Struct) and kind is not wire.Struct]


def _interface(struct: type[msgspec.Struct]) -> Iterator[str]:
    info = msgspec.inspect.type_info(struct)
    assert isinstance(info, msgspec.inspect.StructType)
    yield f"/** {' '.join((inspect.getdoc(struct) or '').split())} */"
    yield f"export interface {struct.__name__} {{"
    if info.tag is not None:
        yield f"  readonly {info.tag_field}: '{info.tag}';"
    for field in info.fields:
        optional = "" if field.required else "?"
        yield f"  readonly {field.encode_name}{optional}: {_type(field.type)};"
    yield "}"


def _type(kind: Any) -> str:
    if isinstance(kind, msgspec.inspect.StructType):
        return kind.cls.__name__
    if isinstance(kind, msgspec.inspect.Metadata):
        return _type(kind.type)
    if isinstance(kind, msgspec.inspect.ListType):
        return f"readonly {_in_array(_type(kind.item_type))}[]"
    if isinstance(kind, msgspec.inspect.LiteralType):
        return " | ".join(f"'{value}'" for value in sorted(kind.values, key=str))
    if isinstance(kind, msgspec.inspect.UnionType):
        return " | ".join(_type(member) for member in kind.types)
    return _PLAIN[type(kind)]


def _in_array(item: str) -> str:
    return f"({item})" if " " in item else item


if __name__ == "__main__":
    sys.stdout.write(typescript())
