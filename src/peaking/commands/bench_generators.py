"""`peaking bench generators`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from peaking.terminal import say


@dataclass(frozen=True)
class BenchGenerators:
    """Time AdaMPI at 384×640 pixels (the paper's 294×639, padded) and 32 planes.

    On the CPU, our implementation beside the same network as a plain PyTorch module; on a GPU too,
    if there is one. The weights are random. Needs PyTorch.

    Examples:
      peaking bench generators
      peaking bench generators --rounds 5 --json generators.json
    """

    json: Path | None = None
    """Also write the results to this file, as JSON."""
    rounds: int = 2
    """Times that each way is run; one round takes up to a minute and a half."""

    def run(self) -> None:
        """Measure, print a table, write the file."""
        from tqdm import tqdm

        from peaking.commands.arguments import ArgumentError
        from peaking.commands.results import write_results
        from peaking.errors import BackendUnavailable

        if self.rounds < 1:
            raise ArgumentError(f"need --rounds of at least 1, got {self.rounds}")
        try:
            from peaking.benchmarks.generators import run

            document = run(rounds=self.rounds, progress=lambda ways: tqdm(ways, desc="bench"))
        except ImportError as error:
            raise BackendUnavailable(f"{error}; pip install 'peaking[torch]'") from error
        write_results(self, document)
        say(*table(document).splitlines())


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
