"""`peaking study export` and `peaking study erase`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.terminal import harmless, say


@dataclass(frozen=True)
class Export:
    """Write all data of a participant to a zip file, to give to them.

    Example:
      peaking study export study P01 --out P01.zip
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study."""
    participant: Annotated[str, tyro.conf.Positional]
    """Pseudonym, such as P01."""
    out: Path
    """The zip file to write."""

    def run(self) -> None:
        """Write it."""
        from peaking.commands.serving import keep_private
        from peaking.server.study.export import export_participant

        keep_private()
        export_participant(self.folder, self.participant, self.out)
        say(f"Wrote {self.out}")


@dataclass(frozen=True)
class Erase:
    """Erase all data of a participant, photos included. This cannot be undone.

    Only the pseudonym stays reserved. The next participant takes their place in the design.

    Example:
      peaking study erase study P01
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study; it must not be served at the same time."""
    participant: Annotated[str, tyro.conf.Positional]
    """Pseudonym, such as P01."""
    yes: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not ask for confirmation."""

    def run(self) -> None:
        """Ask, and delete."""
        from peaking.commands.serving import keep_private
        from peaking.server.study.erasure import erase_participant

        keep_private()
        if not self.yes:
            answer = input(
                harmless(f"Delete all data of {self.participant} in {self.folder}? Type yes: ")
            )
            if answer.strip().lower() != "yes":
                say("Nothing was deleted.")
                return
        erase_participant(self.folder, self.participant)
        say(f"Erased {self.participant}.")
