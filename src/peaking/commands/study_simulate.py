"""`peaking study simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Simulate:
    """Write a study that nobody took part in, with effects that are known.

    To try the analysis, to see what a planned number of participants would find, to test.

    Examples:
      peaking study simulate --participants 20 --seed 1 --out simulated
      peaking study analyse simulated --out simulated-results
    """

    out: Path
    """Folder to write; it must not exist, or be empty."""
    participants: int = 20
    """How many took part."""
    seed: int = 1
    """The same seed gives the same study."""
    effect: Literal["paper", "none"] = "paper"
    """The paper's means, standard deviations and medians, or the same in both conditions."""

    def run(self) -> None:
        """Write it."""
        if not 1 <= self.participants <= 9999:
            raise ValueError(f"need --participants from 1 to 9999, got {self.participants}")
        if self.seed < 0:
            raise ValueError(f"need --seed of 0 or more, got {self.seed}")

        from peaking.output import complete_or_absent
        from peaking.study.simulation.folder import write_study
        from peaking.study.simulation.truth import PAPER, no_effect

        truths = PAPER if self.effect == "paper" else no_effect(PAPER)
        with complete_or_absent(self.out) as folder:
            write_study(folder, truths, participants=self.participants, seed=self.seed)
        print(f"simulated {self.participants} participants: {self.out}")
        print(f"Then:  peaking study analyse {self.out} --out {self.out}-results")
