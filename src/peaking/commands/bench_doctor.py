"""`peaking bench doctor`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.arguments import ArgumentError
from peaking.terminal import say


@dataclass(frozen=True)
class BenchDoctor:
    """Ask whether `peaking doctor` finds faults that are put into recordings, and little else.

    Some pictures of each recording are blurred, darkened, over-exposed, otherwise exposed, swapped
    or taken twice, get a pose that is off by 3 cm or 2°, or a part that moved; then all get a focal
    length that is 10 % too long, or mirrored axes.

    Examples:
      peaking bench doctor
      peaking bench doctor scenes/desk ~/recordings/office --json doctor.json
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings; default: the sample scene scenes/desk."""
    frames: int = 160
    """Frames of each that are taken, at even steps, at most."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    seed: int = 0
    """Of which picture gets which fault."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.planted_faults import SINGLE, WHOLE, Found, found_faults
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample
        from peaking.datasets import open_recording

        if self.frames < 20:
            raise ArgumentError(f"need --frames of at least 20, got {self.frames}")
        measured: dict[str, Found] = {}
        for scene in tqdm(scenes_or_sample(self.scenes), desc="bench doctor", unit="scene"):
            recording = open_recording(scene)
            measured[recording.name] = found_faults(recording, most=self.frames, seed=self.seed)
        say("| fault | " + " | ".join(measured) + " |", "|---" * (len(measured) + 1) + "|")
        for kind in SINGLE:
            cells = [
                f"{one.found[kind]} of {one.planted[kind]}" if kind in one.planted else "-"
                for one in measured.values()
            ]
            say(f"| {kind} | " + " | ".join(cells) + " |")
        for kind in WHOLE:
            cells = ["found" if one.whole[kind] else "not found" for one in measured.values()]
            say(f"| {kind} of all | " + " | ".join(cells) + " |")
        cells = [f"{one.flagged} of {one.others}" for one in measured.values()]
        say("| others called wrong | " + " | ".join(cells) + " |")
        cells = [f"{one.flagged_before} of {one.frames}" for one in measured.values()]
        say("| called wrong as recorded | " + " | ".join(cells) + " |")
        scenes = [{"scene": name, **asdict(one)} for name, one in measured.items()]
        write_results(self, {"scenes": scenes})
