"""`peaking study`: the commands for user studies."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from peaking.commands import (
    study_analyse,
    study_init,
    study_privacy,
    study_serve,
    study_simulate,
)
from peaking.commands.arguments import with_plain_help


def _subcommand(name: str, command: type[Any]) -> Any:
    return tyro.conf.subcommand(name, description=inspect.getdoc(with_plain_help(command)))


StudyCommands = (
    Annotated[study_init.Init, _subcommand("init", study_init.Init)]
    | Annotated[study_serve.ServeStudy, _subcommand("serve", study_serve.ServeStudy)]
    | Annotated[study_analyse.Analyse, _subcommand("analyse", study_analyse.Analyse)]
    | Annotated[study_simulate.Simulate, _subcommand("simulate", study_simulate.Simulate)]
    | Annotated[study_privacy.Export, _subcommand("export", study_privacy.Export)]
    | Annotated[study_privacy.Erase, _subcommand("erase", study_privacy.Erase)]
)


@dataclass(frozen=True)
class Study:
    """Run a user study of capture methods: protocol, console, participants' pages, statistics.

    Examples:
      peaking study init study          # then read and edit study/protocol.toml
      peaking study serve study         # prints the link of the console
      peaking study analyse study --out results
      peaking study simulate --participants 20 --seed 1 --out simulated
      peaking study export study P01 --out P01.zip
      peaking study erase study P01
    """

    command: tyro.conf.OmitSubcommandPrefixes[StudyCommands]
    """What to do."""

    def run(self) -> None:
        """Do it."""
        self.command.run()
