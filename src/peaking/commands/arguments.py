"""Wrong arguments of the command line.

A ValueError is reported as a wrong argument only where arguments are checked: anywhere else it is a
fault of the program and ends with a traceback.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from types import NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import tyro

from peaking.errors import PeakingError


class ArgumentError(PeakingError):
    """An argument of the command line is wrong; the message says what is needed."""


T = TypeVar("T")


def with_plain_help(command: type[T]) -> type[T]:
    """Let the help of a command, a dataclass, not speak of None where an argument may be left out.

    What happens then stands in the argument's own docstring.
    """
    hints = get_type_hints(command, include_extras=True)
    for field in fields(command):  # type: ignore[arg-type]
        kind = hints[field.name]
        bare, *marks = get_args(kind) if get_origin(kind) is Annotated else (kind,)
        if field.default is None and NoneType in get_args(bare):
            has_hint = any(getattr(mark, "help_behavior_hint", None) for mark in marks)
            hint = None if has_hint else ""
            shown = metavar(bare)
            shown = f"[{shown}]" if tyro.conf.Positional in marks else shown
            plain = tyro.conf.arg(metavar=shown, help_behavior_hint=hint)
            command.__annotations__[field.name] = Annotated[(bare, *marks, plain)]
    return command


def metavar(optional: Any) -> str:
    """Return what the help calls the value of an argument that may be None."""
    (kind,) = (kind for kind in get_args(optional) if kind is not NoneType)
    if get_origin(kind) is Literal:
        return "{" + ",".join(map(str, get_args(kind))) + "}"
    return "{True,False}" if kind is bool else kind.__name__.upper()


@contextmanager
def checked_arguments(**options: str) -> Generator[None]:
    """Turn a ValueError into an `ArgumentError`: to be put around the making of a plan.

    Args:
        options: Names of options, by what a complaint calls them where that is not their own name.

    Raises:
        ArgumentError: Something inside refused a value; the names in it are those of options.
    """
    try:
        yield
    except ValueError as error:
        raise ArgumentError(_with_options(str(error), options)) from error


def _with_options(complaint: str, options: Mapping[str, str]) -> str:
    """Return "need --max-frames >= 1" for "need max_frames >= 1"."""

    def named(found: re.Match[str]) -> str:
        return options.get(found[0], "--" + found[0].replace("_", "-"))

    return re.sub(r"\b[a-z]+(_[a-z]+)+\b|(?<= )[a-z]+(?= [<>]=? )", named, complaint)
