"""`peaking study simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from peaking.commands.arguments import ArgumentError
from peaking.terminal import say


@dataclass(frozen=True)
class Simulate:
    """Write the data of a simulated study whose true effects are known.

    Use it to try the analysis, or to see what a planned number of participants would show.

    Examples:
      peaking study simulate --participants 20 --seed 1 --out simulated
      peaking study analyse simulated --out simulated-results
    """

    out: Path
    """Folder to write; it must be empty or not exist."""
    participants: int = 20
    """Number of participants."""
    seed: int = 1
    """The same seed gives the same study."""
    effect: Literal["paper", "none"] = "paper"
    """`paper`: the paper's means, standard deviations and medians; `none`: equal conditions."""

    def run(self) -> None:
        """Write it."""
        if not 1 <= self.participants <= 9999:
            raise ArgumentError(f"need --participants of 1..9999, got {self.participants}")
        if self.seed < 0:
            raise ArgumentError(f"need --seed of at least 0, got {self.seed}")

        from peaking.output import complete_or_absent
        from peaking.study.simulation.folder import write_study
        from peaking.study.simulation.truth import PAPER, no_effect

        truths = PAPER if self.effect == "paper" else no_effect(PAPER)
        with complete_or_absent(self.out) as folder:
            write_study(folder, truths, participants=self.participants, seed=self.seed)
        say(f"simulated {self.participants} participants: {self.out}")
        say(f"Next:  peaking study analyse {self.out} --out {self.out}-results")
