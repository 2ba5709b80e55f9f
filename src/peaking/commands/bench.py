"""`peaking bench`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Bench:
    """Time the stages at 294×639×32 on real frames, in turn with their peers.

    Figures are medians after a warm-up. `vs` gives a peer's median divided by ours, so 12 means 12
    times faster; `bandwidth_floor` is the time to read and write the memory once, divided by ours.

    Examples:
      peaking bench
      peaking bench ~/recordings/kitchen --json bench.json --rounds 60
      peaking bench --no-peers
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth to take frames from; without any, the sample scene."""
    json: Path | None = None
    """Write the results to this file."""
    rounds: int = 54
    """How often each stage is timed."""
    no_peers: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Leave out the peers that need PyTorch and transformers (the extra `torch`)."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.stages import run
        from peaking.commands.scenes import scenes_or_sample
        from peaking.datasets import open_recording
        from peaking.output import write_atomically

        recordings = [open_recording(scene) for scene in scenes_or_sample(self.scenes)]
        document = run(
            recordings,
            rounds=self.rounds,
            with_peers=not self.no_peers,
            progress=lambda turns: tqdm(turns, desc="bench", unit="round"),
        )
        text = json.dumps(document, indent=2) + "\n"
        if self.json is not None:
            write_atomically(self.json, text.encode())
        print(table(document))


def table(document: dict[str, object]) -> str:
    """Return the results as a markdown table."""
    lines = [
        "| stage | median ms | p10 | p90 | bytes | times faster than |",
        "|---|---:|---:|---:|---:|---|",
    ]
    results = document["results"]
    assert isinstance(results, list)
    for row in results:
        ratios = ", ".join(f"{peer} {ratio:.2f}" for peer, ratio in row["vs"].items())
        size = "" if row["bytes"] is None else f"{row['bytes']:,}"
        lines.append(
            f"| {row['name']} | {row['median_ms']:.2f} | {row['p10_ms']:.2f} "
            f"| {row['p90_ms']:.2f} | {size} | {ratios} |"
        )
    return "\n".join(lines)
