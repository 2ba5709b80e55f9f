"""`peaking quality`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Quality:
    """Measure on recordings how good an MPI from one view is, and the completed depth.

    From one picture with depth to a neighbour 5, 10 and 20 cm away, `layered` against forward
    point splatting and a textured depth mesh cut at edges; and depth completion against nearest
    and bilinear upsampling.

    Examples:
      peaking quality
      peaking quality ~/recordings/kitchen ~/recordings/office --json quality.json
      peaking quality --pairs 5
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth; without any, the sample scene."""
    json: Path | None = None
    """Write the figures to this file."""
    pairs: int = 20
    """Pairs of views per scene and distance, at most."""

    def run(self) -> None:
        """Measure, print tables, write the file."""
        from tqdm import tqdm

        import peaking
        from peaking.benchmarks import depth_completion, single_view
        from peaking.commands.scenes import scenes_or_sample
        from peaking.output import write_atomically

        scenes = scenes_or_sample(self.scenes)
        document: dict[str, object] = {"version": peaking.__version__, "pairs": self.pairs}
        for scene in tqdm(scenes, desc="quality", unit="scene"):
            views = single_view.single_view_quality(scene, pairs_per_distance=self.pairs)
            depths = depth_completion.depth_quality(scene)
            name = scene.resolve().name
            document[name] = {
                "single_view": single_view.as_dict(views),
                "depth": depth_completion.as_dict(depths),
            }
            tqdm.write(f"\n## {name}: one view to a neighbour\n\n{single_view.as_markdown(views)}")
            tqdm.write(f"\n## {name}: depth completion\n\n{depth_completion.as_markdown(depths)}")
        if self.json is not None:
            write_atomically(self.json, (json.dumps(document, indent=2) + "\n").encode())
