"""`peaking bench view`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.commands.arguments import ArgumentError
from peaking.commands.bench_live import table
from peaking.terminal import say

Part = Literal["first-picture", "light-field", "splat", "memory", "share", "training"]
LEAST_WALK_S = 20.0


@dataclass(frozen=True)
class BenchView:
    """Measure the viewer in a headless browser, what is shared, and trainings beside captures.

    How soon the first picture of 40 views is there; frames of the light field beside the capture
    page's, of 300,000 Gaussians beside Spark's own example; memory while one walks; size and loss
    of a share; and how long views take while another session is trained on.

    Examples:
      peaking bench view
      peaking bench view --only first-picture memory --walk-s 60
      peaking bench view ~/recordings/kitchen --splat kitchen.ply --json view.json
    """

    scene: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """A recording with depth; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    only: tuple[Part, ...] = (
        "first-picture",
        "light-field",
        "splat",
        "memory",
        "share",
        "training",
    )
    """What to measure."""
    walk_s: float = 300.0
    """Seconds of walking while memory is watched."""
    splat: Path | None = None
    """Gaussians that were trained on the recording (`peaking splat`); default: train them."""
    seed: int = 0
    """Of the walk."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.view import ViewOptions, run
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample

        self._check()
        (scene,) = scenes_or_sample(self.scene)
        plan = ViewOptions(scene, self.only, self.walk_s, self.splat, self.seed)
        with tqdm(desc="bench view", bar_format="{desc} [{elapsed}]") as bar:
            document = run(plan, told=lambda text: bar.set_description(f"bench view: {text}"))
        write_results(self, document)
        say(*table(document).splitlines())

    def _check(self) -> None:
        if len(self.scene) > 1:
            raise ArgumentError(f"need one recording, got {len(self.scene)}")
        if not self.only:
            raise ArgumentError("--only needs at least one part")
        if not LEAST_WALK_S <= self.walk_s < float("inf"):
            raise ArgumentError(f"need --walk-s of at least {LEAST_WALK_S:g}, got {self.walk_s:g}")
