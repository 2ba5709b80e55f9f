"""`peaking bench live`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class BenchLive:
    """Time the live loop: a real server, real bytes over loopback, the client in Chromium.

    One phone (latencies), one long session, 20 phones at once, and the virtual phone in a headless
    browser (playwright and a Chromium are needed for that).

    Examples:
      peaking bench live
      peaking bench live ~/recordings/kitchen --json live.json
      peaking bench live --no-browser --phones-for-s 10
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth to take frames from; without any, the sample scene."""
    json: Path | None = None
    """Write the results to this file."""
    captures: int = 60
    """Captures of the one phone."""
    phones_for_s: float = 60.0
    """How long the 20 phones keep shooting, seconds."""
    no_browser: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Leave the browser out."""

    def run(self) -> None:
        """Measure, print, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks.live import LivePlan, run
        from peaking.commands.scenes import scenes_or_sample
        from peaking.datasets import open_recording
        from peaking.output import write_atomically

        plan = LivePlan(
            recordings=[open_recording(scene) for scene in scenes_or_sample(self.scenes)],
            captures=self.captures,
            phones_for_s=self.phones_for_s,
            with_browser=not self.no_browser,
        )
        with tqdm(desc="bench live", bar_format="{desc} [{elapsed}]") as bar:
            document = run(plan, told=lambda text: bar.set_description(f"bench live: {text}"))
        text = json.dumps(document, indent=2) + "\n"
        if self.json is not None:
            write_atomically(self.json, text.encode())
        print(text, end="")
