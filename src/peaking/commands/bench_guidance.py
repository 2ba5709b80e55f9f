"""`peaking bench guidance`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class BenchGuidance:
    """Ask whether the score of a capture ranks sets of views as their quality does.

    Sets of several kinds and sizes are scored, and shown the frames held out. 1: the same order,
    0: none. "Equal number" is the mean over sizes of what holds among sets of the same size.

    Examples:
      peaking bench guidance
      peaking bench guidance scenes/desk ~/recordings/kitchen --json guidance.json
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    seed: int = 0
    """Of the sets that are drawn."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.guidance import measure_scenes
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample

        with tqdm(desc="bench guidance", unit="set") as bar:

            def told(scene: str, _done: int, of: int) -> None:
                bar.set_description(f"bench guidance: {scene}, {of} sets")
                bar.update()

            document = measure_scenes(scenes_or_sample(self.scenes), seed=self.seed, told=told)
        write_results(self, document)
        say(*table(document).splitlines())


def table(document: Mapping[str, Any]) -> str:
    """Return the results as a markdown table."""
    lines = ["| scene | sets | all | equal number | by number |", "|---|---:|---:|---:|---|"]
    for scene in document["scenes"]:
        by_count = ", ".join(f"{n}: {value:.2f}" for n, value in scene["spearman_by_count"].items())
        lines.append(
            f"| {scene['scene']} | {len(scene['sets'])} | {scene['spearman_all']:.2f} "
            f"| {scene['spearman_equal_count']:.2f} | {by_count} |"
        )
    return "\n".join(lines)
