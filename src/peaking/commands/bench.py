"""`peaking bench`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class Bench:
    """Time each stage at 294×639 pixels and 32 planes on recorded frames, beside its peers.

    All candidates take turns; figures are medians after a warm-up. "Times faster than" is a peer's
    median divided by ours; `bandwidth_floor` stands for reading and writing the memory once.

    Examples:
      peaking bench
      peaking bench ~/recordings/kitchen --json bench.json --rounds 60
      peaking bench --no-peers
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth to take frames from; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    rounds: int = 54
    """Times that each stage is run."""
    no_peers: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not time the peers, which need PyTorch and transformers (extra `torch`)."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.stages import run
        from peaking.commands.arguments import ArgumentError
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample
        from peaking.datasets import open_recording

        if self.rounds < 1:
            raise ArgumentError(f"need --rounds of at least 1, got {self.rounds}")
        recordings = [open_recording(scene) for scene in scenes_or_sample(self.scenes)]
        document = run(
            recordings,
            rounds=self.rounds,
            with_peers=not self.no_peers,
            progress=lambda turns: tqdm(turns, desc="bench", unit="round"),
        )
        write_results(self, document)
        say(*table(document).splitlines())


def table(document: Mapping[str, Any]) -> str:
    """Return the results as a markdown table."""
    lines = [
        "| stage | median ms | p10 | p90 | bytes | times faster than |",
        "|---|---:|---:|---:|---:|---|",
    ]
    results: list[dict[str, Any]] = document["results"]
    for row in results:
        ratios = ", ".join(f"{peer} {ratio:.2f}" for peer, ratio in row["vs"].items())
        size = "" if row["bytes"] is None else f"{row['bytes']:,}"
        lines.append(
            f"| {row['name']} | {row['median_ms']:.2f} | {row['p10_ms']:.2f} "
            f"| {row['p90_ms']:.2f} | {size} | {ratios} |"
        )
    return "\n".join(lines)
