"""The options of the method as flags: a preset, and what is to differ from it.

The flags follow from `peaking.options.Options`: a new option there is a new flag here.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, make_dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import tyro

from peaking.commands.arguments import metavar
from peaking.options import PRESETS, Options, PresetName, descriptions


@dataclass(frozen=True)
class PresetOptions:
    """A preset and what differs from it."""

    preset: PresetName = "default"
    """`paper` is the published method to the letter; `default` is our best."""

    def options(self) -> Options:
        """Return the preset with the flags that were given."""
        given = {
            option.name: getattr(self, option.name)
            for option in fields(Options)
            if getattr(self, option.name) is not None
        }
        return replace(PRESETS[self.preset], **given)


def _flags() -> list[tuple[str, Any, Any]]:
    """Return a flag per option, None by default: the preset decides."""
    types = get_type_hints(Options)
    return [
        (
            option.name,
            Annotated[
                types[option.name] | None,
                tyro.conf.arg(
                    help=descriptions()[option.name],
                    help_behavior_hint=_hint(option.name),
                    metavar=metavar(types[option.name] | None),
                ),
            ],
            field(default=None),
        )
        for option in fields(Options)
    ]


def _hint(name: str) -> str:
    """Return what the presets say."""
    values = {preset: getattr(options, name) for preset, options in PRESETS.items()}
    if len(set(values.values())) > 1:
        said = ", ".join(f"--preset {preset}: {_word(value)}" for preset, value in values.items())
    else:
        said = f"default: {_word(values['default'])}"
    return f"({said})"


def _word(value: object) -> str:
    if value is None:
        return "none"
    return str(value).lower() if isinstance(value, bool) else str(value)


if TYPE_CHECKING:
    MethodOptions = PresetOptions
else:
    MethodOptions = make_dataclass("MethodOptions", _flags(), bases=(PresetOptions,), frozen=True)
    MethodOptions.__doc__ = PresetOptions.__doc__
