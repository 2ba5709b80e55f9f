"""`peaking study export` and `peaking study erase`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Export:
    """Write all that is kept of a participant into a zip, for them.

    Example:
      peaking study export study P01 --out P01.zip
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study."""
    participant: Annotated[str, tyro.conf.Positional]
    """Pseudonym, such as P01."""
    out: Path
    """The zip."""

    def run(self) -> None:
        """Write it."""
        from peaking.study.privacy import export_participant

        export_participant(self.folder, self.participant, self.out)
        print(f"Wrote {self.out}")


@dataclass(frozen=True)
class Erase:
    """Delete all that is kept of a participant, photos too. There is no way back.

    Only the pseudonym stays taken. Their place in the design is given to somebody else.

    Example:
      peaking study erase study P01
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study; it must not be served at the moment."""
    participant: Annotated[str, tyro.conf.Positional]
    """Pseudonym, such as P01."""
    yes: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not ask."""

    def run(self) -> None:
        """Ask, and delete."""
        from peaking.study.privacy import erase_participant

        if not self.yes:
            answer = input(f"Delete all of {self.participant} in {self.folder}? Write yes: ")
            if answer.strip().lower() != "yes":
                print("Nothing was deleted.")
                return
        erase_participant(self.folder, self.participant)
        print(f"Erased {self.participant}.")
