"""`peaking bench generators`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class BenchGenerators:
    """Time AdaMPI at 384×640×32 (the paper's 294×639, padded), with drawn weights.

    On the processor, against the same network as a plain module; and on CUDA where there is one.
    Needs PyTorch.

    Examples:
      peaking bench generators
      peaking bench generators --rounds 5 --json generators.json
    """

    json: Path | None = None
    """Write the results to this file."""
    rounds: int = 2
    """How often each way is timed, in turn; one takes up to a minute and a half."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.errors import BackendUnavailable
        from peaking.output import write_atomically

        if self.rounds < 1:
            raise ValueError(f"need --rounds >= 1, got {self.rounds}")
        try:
            from peaking.benchmarks.generators import run

            document = run(rounds=self.rounds, progress=lambda ways: tqdm(ways, desc="bench"))
        except ImportError as error:
            raise BackendUnavailable(f"{error}; pip install 'peaking[torch]'") from error
        if self.json is not None:
            write_atomically(self.json, (json.dumps(document, indent=2) + "\n").encode())
        print(table(document))


def table(document: dict[str, Any]) -> str:
    """Return the results as a markdown table."""
    lines = [
        f"{document['size']}, {document['threads']} threads, {document['machine']}",
        "",
        "| way | wall s | CPU s | peak GB | times faster by CPU time |",
        "|---|---:|---:|---:|---:|",
    ]
    for row in document["results"]:
        faster = row["times_faster_than_plain_by_cpu_time"]
        lines.append(
            f"| {row['name']} | {row['wall_s']:.3f} | {row['cpu_s']:.2f} | {row['peak_gb']:.2f} "
            f"| {'' if faster is None else faster} |"
        )
    return "\n".join(lines)
