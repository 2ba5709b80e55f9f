"""`peaking bench trust`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.benchmarks.trust.run import MeasureName


@dataclass(frozen=True)
class BenchTrust:
    """Measure whether red can be trusted, on recordings with depth, the paper's rule beside it.

    seen: is "never seen" in no view? false_red: what is red although only the camera changed?
    true_red: is what is wrong red? useful: does a view help where it is red? steady: does red stay
    as it is from frame to frame? classes: are wrong, never seen and "no view will help" told apart?
    pose: how far off are poses before and after correction? docs/trust.md says how.

    Examples:
      peaking bench trust
      peaking bench trust scenes/desk ~/recordings/kitchen --json trust.json
      peaking bench trust --only seen,steady
      peaking bench trust --quick
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    only: str | None = None
    """Measure these alone, with commas between."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Ask at few frames: a minute per scene, and figures that are only roughly right."""

    def run(self) -> None:
        """Measure, print tables, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.trust.run import measure_scenes
        from peaking.benchmarks.trust.stage import QUICK, Plan
        from peaking.benchmarks.trust.table import as_markdown
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample

        measures = self._measures()
        scenes = scenes_or_sample(self.scenes)
        with tqdm(total=len(scenes) * len(measures), desc="bench trust", unit="measure") as bar:
            begun: set[tuple[str, str]] = set()

            def told(scene: str, measure: str, step: int) -> None:
                begun.add((scene, measure))
                bar.n = len(begun) - 1
                bar.set_description(f"bench trust: {scene}, {measure}, {step + 1}")

            document = measure_scenes(
                scenes, only=measures, plan=QUICK if self.quick else Plan(), told=told
            )
            bar.n = len(begun)
            bar.set_description("bench trust")
        write_results(self, document)
        say(*as_markdown(document).splitlines())

    def _measures(self) -> tuple[MeasureName, ...]:
        from peaking.benchmarks.trust.run import MEASURE_NAMES
        from peaking.commands.arguments import ArgumentError

        if self.only is None:
            return MEASURE_NAMES
        words = [word.strip() for word in self.only.split(",")]
        unknown = [word for word in words if word not in MEASURE_NAMES]
        if unknown:
            raise ArgumentError(
                f"need --only of {', '.join(MEASURE_NAMES)}, got {', '.join(unknown)}"
            )
        return tuple(name for name in MEASURE_NAMES if name in words)
