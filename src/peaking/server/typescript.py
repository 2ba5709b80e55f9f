"""Write the TypeScript twins of `wire.py` and `study/wire.py`; `make wire` calls it."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from itertools import pairwise
from types import ModuleType
from typing import Any, get_args

import msgspec

from peaking.server import wire
from peaking.server.study import wire as study_wire

HEADER = """// Generated from src/peaking/server/{file} by `make wire`; do not edit.
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
    return _file("wire.py", wire, ["SessionEvent", "ServerEvent"])


def study_typescript() -> str:
    """Return study/wire.ts."""
    return _file("study/wire.py", study_wire, ["StudyEvent"])


def structs(module: ModuleType = wire) -> list[type[msgspec.Struct]]:
    """Return the structs of a wire, in the order of the file."""
    found = [value for value in vars(module).values() if isinstance(value, type)]
    return [k for k in found if issubclass(k, msgspec.Struct) and k is not module.Struct]


def _constants(module: ModuleType) -> Iterator[str]:
    """Yield the numbers that both languages need, each with what its docstring says."""
    said: dict[str, str] = {}
    for before, after in pairwise(ast.parse(inspect.getsource(module)).body):
        match before, after:
            case (
                ast.Assign(targets=[ast.Name(name)]),
                ast.Expr(ast.Constant(str(text))),
            ):
                said[name] = " ".join(text.split())
            case _:
                pass
    for name in module.CONSTANTS:
        value = getattr(module, name)
        yield f"/** {said[name]} */"
        yield f"export const {name} = {value:.15g};"


def _file(source: str, module: ModuleType, unions: list[str]) -> str:
    lines = [HEADER.format(file=source), *_constants(module)]
    for struct in structs(module):
        lines += ["", *_interface(struct)]
    for name in unions:
        members = " | ".join(member.__name__ for member in get_args(getattr(module, name)))
        lines += ["", f"export type {name} = {members};"]
    return "\n".join(lines) + "\n"


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
    if isinstance(kind, msgspec.inspect.DictType):
        return f"Readonly<Record<string, {_type(kind.value_type)}>>"
    if isinstance(kind, msgspec.inspect.LiteralType):
        return " | ".join(f"'{value}'" for value in sorted(kind.values, key=str))
    if isinstance(kind, msgspec.inspect.UnionType):
        return " | ".join(dict.fromkeys(_type(member) for member in kind.types))
    return _PLAIN[type(kind)]


def _in_array(item: str) -> str:
    return f"({item})" if " " in item else item


if __name__ == "__main__":
    sys.stdout.write(study_typescript() if sys.argv[1:] == ["study"] else typescript())
