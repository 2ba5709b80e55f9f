"""`peaking bench live`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class BenchLive:
    """Time live capture: a real server on this machine, simulated phones, the client in a browser.

    Measures the latencies of one phone, a session of 300 views, 20 phones at once, and the virtual
    phone in a headless browser (which needs playwright and a Chromium). Then the server under
    strain: 100 phones and one that floods, 2,000 connections that only wait, a disk that is slow.

    Examples:
      peaking bench live
      peaking bench live ~/recordings/kitchen --json live.json
      peaking bench live --no-browser --phones-for-s 10
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth to take frames from; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    captures: int = 60
    """Captures of the single phone."""
    phones_for_s: float = 60.0
    """Seconds for which the 20 phones take pictures."""
    no_browser: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not time the client in a browser."""

    def run(self) -> None:
        """Measure, print, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.live import LiveOptions, run
        from peaking.commands.arguments import ArgumentError
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample
        from peaking.datasets import open_recording

        if self.captures < 1 or not 2 <= self.phones_for_s < float("inf"):
            raise ArgumentError("need --captures of at least 1 and --phones-for-s of at least 2")
        plan = LiveOptions(
            recordings=[open_recording(scene) for scene in scenes_or_sample(self.scenes)],
            captures=self.captures,
            phones_for_s=self.phones_for_s,
            with_browser=not self.no_browser,
        )
        with tqdm(desc="bench live", bar_format="{desc} [{elapsed}]") as bar:
            document = run(plan, told=lambda text: bar.set_description(f"bench live: {text}"))
        write_results(self, document)
        say(*table(document).splitlines())


def table(document: Mapping[str, Any]) -> str:
    """Return the results as a markdown table."""
    rows = [f"| {name} | {value} |" for name, value in _flat(document)]
    return "\n".join(["| figure | value |", "|---|---:|", *rows])


def _flat(document: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    for name, value in document.items():
        if isinstance(value, Mapping):
            yield from _flat(cast("Mapping[str, Any]", value), f"{prefix}{name}.")
        elif value not in ([], None):
            yield f"{prefix}{name}", value
