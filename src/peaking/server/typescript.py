"""Write the TypeScript twins of `wire.py` and `study/wire.py`; `make wire` calls it."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from itertools import pairwise
from types import ModuleType
from typing import Any, get_args

import msgspec

from peaking.server import wire
from peaking.server.study import wire as study_wire

HEADER = "// Generated from src/peaking/server/{file} by `make wire`; do not edit.\n"

RECEIVED = (
    wire.ServerInfo,
    wire.SessionEvent,
    wire.ServerEvent,
    wire.PeakedSamples,
    wire.Selection,
    wire.Guidance,
    wire.RecordingIndex,
    wire.Paired,
    wire.PairedDevices,
    wire.PairingLink,
    wire.Problem,
)
"""What clients hear, and so check."""

STUDY_RECEIVED = (
    study_wire.ParticipantState,
    study_wire.ConsoleState,
    study_wire.AnswersRefused,
    study_wire.NewParticipant,
    study_wire.Told,
)
"""Of the study; what happened is kept in the browser until it is sent."""

_PLAIN = {
    msgspec.inspect.StrType: "string",
    msgspec.inspect.IntType: "number",
    msgspec.inspect.FloatType: "number",
    msgspec.inspect.BoolType: "boolean",
    msgspec.inspect.NoneType: "null",
}


def wire_typescript() -> str:
    """Return wire.ts: an interface per struct, a type per union, a schema of what is received."""
    return _file("wire.py", wire, RECEIVED, ["SessionEvent", "ServerEvent"])


def study_typescript() -> str:
    """Return study/wire.ts."""
    return _file("study/wire.py", study_wire, STUDY_RECEIVED, ["StudyEvent"])


def structs(module: ModuleType = wire) -> list[type[msgspec.Struct]]:
    """Return the structs of a wire, in the order of the file."""
    found = [value for value in vars(module).values() if isinstance(value, type)]
    return [
        k
        for k in found
        if issubclass(k, msgspec.Struct)
        and k is not module.Struct
        and (module is wire or k.__module__ != wire.__name__)
    ]


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


def _file(source: str, module: ModuleType, received: Sequence[Any], unions: list[str]) -> str:
    lines = list(_constants(module))
    for struct in structs(module):
        lines += ["", *_interface(struct)]
    for name in unions:
        members = " | ".join(member.__name__ for member in get_args(getattr(module, name)))
        lines += ["", f"export type {name} = {members};"]
    heard = {struct for kind in received for struct in _reachable(msgspec.inspect.type_info(kind))}
    for struct in structs(module):
        if struct in heard:
            lines += ["", *_schema(struct)]
    for name in unions:
        members = get_args(getattr(module, name))
        if set(members) <= heard:
            lines += ["", *_union_schema(name, members)]
    words = set(re.findall(r"\b(" + "|".join(_SCHEMA_WORDS) + r")\(?", _code_of(lines)))
    path = "../" * source.count("/") + "schema"
    path = path if path.startswith("..") else f"./{path}"
    names = textwrap.fill(
        ", ".join([*sorted(words), "type Schema"]), 96, initial_indent="  ", subsequent_indent="  "
    )
    imports = f"import {{\n{names},\n}} from '{path}';\n"
    return "\n".join([HEADER.format(file=source), imports, *lines]) + "\n"


_SCHEMA_WORDS = (
    "dictionary", "flag", "integer", "list", "nothing", "nullable", "number", "oneOf", "optional",
    "record", "tagged", "text", "union",
)  # fmt: skip


def _code_of(lines: list[str]) -> str:
    """Return the lines that define schemas."""
    begins = next(i for i, line in enumerate(lines) if "Schema: Schema<" in line)
    return "\n".join(re.sub(r"^ {2}\w+:", "", line) for line in lines[begins:])


def _reachable(kind: Any) -> Iterator[type[msgspec.Struct]]:
    """Yield the structs that a type is made of."""
    match kind:
        case msgspec.inspect.StructType():
            yield kind.cls
            for field in kind.fields:
                yield from _reachable(field.type)
        case msgspec.inspect.UnionType():
            for member in kind.types:
                yield from _reachable(member)
        case msgspec.inspect.ListType():
            yield from _reachable(kind.item_type)
        case msgspec.inspect.DictType():
            yield from _reachable(kind.value_type)
        case msgspec.inspect.Metadata():
            yield from _reachable(kind.type)
        case _:
            pass


def _schema(struct: type[msgspec.Struct]) -> Iterator[str]:
    info = msgspec.inspect.type_info(struct)
    assert isinstance(info, msgspec.inspect.StructType)
    name = struct.__name__
    yield f"export const {_schema_name(name)}: Schema<{name}> = /* @__PURE__ */ record<{name}>({{"
    if info.tag is not None:
        yield f"  {info.tag_field}: oneOf('{info.tag}'),"
    for field in info.fields:
        check = _check(field.type)
        yield f"  {field.encode_name}: {check if field.required else f'optional({check})'},"
    yield "});"


def _union_schema(name: str, members: Sequence[type[msgspec.Struct]]) -> Iterator[str]:
    yield f"export const {_schema_name(name)}: Schema<{name}> = /* @__PURE__ */ tagged<{name}>({{"
    for member in members:
        yield f"  {member.__name__}: {_schema_name(member.__name__)},"
    yield "});"


def _schema_name(name: str) -> str:
    return f"{name[0].lower()}{name[1:]}Schema"


def _check(kind: Any) -> str:
    """Return the schema of a type."""
    match kind:
        case msgspec.inspect.StructType():
            return _schema_name(kind.cls.__name__)
        case msgspec.inspect.Metadata():
            return _check(kind.type)
        case msgspec.inspect.ListType():
            item = _check(kind.item_type)
            sizes = _bounds(kind.min_length or None, kind.max_length)
            return f"list({', '.join([item, *sizes]).replace('-Infinity', '0')})"
        case msgspec.inspect.DictType():
            return f"dictionary({_check(kind.value_type)})"
        case msgspec.inspect.LiteralType():
            return f"oneOf({', '.join(repr(value) for value in sorted(kind.values, key=str))})"
        case msgspec.inspect.UnionType():
            members = [_check(m) for m in kind.types if not _is_none(m)]
            whole = members[0] if len(members) == 1 else f"union({', '.join(members)})"
            return whole if len(members) == len(kind.types) else f"nullable({whole})"
        case msgspec.inspect.IntType():
            return f"integer({', '.join(_bounds(kind.ge, kind.le))})"
        case msgspec.inspect.FloatType():
            return f"number({', '.join(_bounds(kind.gt if kind.ge is None else kind.ge, kind.le))})"
        case msgspec.inspect.BoolType():
            return "flag"
        case msgspec.inspect.NoneType():
            return "nothing"
        case _:
            assert isinstance(kind, msgspec.inspect.StrType)
            return "text"


def _is_none(kind: Any) -> bool:
    return isinstance(kind, msgspec.inspect.NoneType)


def _bounds(low: int | float | None, high: int | float | None) -> list[str]:
    if low is None and high is None:
        return []
    first = "-Infinity" if low is None else f"{low:.15g}"
    return [first] if high is None else [first, f"{high:.15g}"]


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
    sys.stdout.write(study_typescript() if sys.argv[1:] == ["study"] else wire_typescript())
