"""The file that `--json` writes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Protocol, cast, runtime_checkable


@runtime_checkable
class Measures(Protocol):
    """A command with the option `--json`."""

    @property
    def json(self) -> Path | None:
        """The file to write the results to."""
        ...


def write_results(command: Measures, results: Mapping[str, object]) -> None:
    """Write results as JSON if `--json` asks for it, after the version and the arguments.

    Raises:
        OutputError: The place is taken by a folder, full or not writable.
    """
    if command.json is None:
        return
    import peaking
    from peaking.output import write_atomically

    document = {"version": peaking.__version__, "arguments": _arguments(command), **results}
    write_atomically(command.json, (json.dumps(document, indent=2) + "\n").encode())


def _arguments(command: Any) -> dict[str, object]:
    """Return the fields of a command as JSON has them, without `json` itself."""
    return {
        field.name: _plain(getattr(command, field.name))
        for field in fields(command)
        if field.name != "json"
    }


def _plain(value: object) -> object:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, tuple | list):
        return [_plain(one) for one in cast("Sequence[object]", value)]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return value
