"""`peaking info`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.scenes import SceneOptions, residuals_of
from peaking.terminal import say


@dataclass(frozen=True)
class Info:
    """Say what a recording is: format, cameras, path, depth and its unit, sharpness, exposure.

    Formats are found by looking at the path; docs/formats.md has a table of all.

    Examples:
      peaking info scenes/desk
      peaking info ~/Downloads/scan.zip
      peaking info ~/colmap/garden --images ~/photos/garden --quick
    """

    path: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md), or a zip of one."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Read some pictures only, and say nothing of sharpness and exposure."""
    json: Path | None = None
    """Also write what was found to this file, as JSON."""
    reading: SceneOptions = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Look, and print."""
        from tqdm import tqdm

        from peaking.audit.facts import facts_of
        from peaking.audit.words import lines_of, path_lines
        from peaking.commands.results import write_results

        recording = self.reading.open(self.path, with_notes=False)

        def shown(numbers: Sequence[int]) -> Iterable[int]:
            return tqdm(numbers, desc="looking", unit="frame", leave=False)

        facts = facts_of(recording, with_looks=not self.quick, progress=shown)
        say(*lines_of(recording, facts))
        say("", *path_lines(recording))
        found = asdict(facts)
        if facts.looks is not None:
            found["looks"] = {key: value.tolist() for key, value in vars(facts.looks).items()}
        found |= residuals_of(recording)
        write_results(self, {"format": recording.format, "frames": len(recording), **found})
