"""`peaking quality`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class Quality:
    """Measure the quality of MPIs and of depth completion on recordings.

    An MPI (`layered`) is made from one picture with depth and rendered 5, 10 and 20 cm away, where
    the recording has a picture to compare with; so are forward point splatting and a textured depth
    mesh cut at edges. Depth completion is compared with nearest and bilinear upsampling.

    Examples:
      peaking quality
      peaking quality ~/recordings/kitchen ~/recordings/office --json quality.json
      peaking quality --pairs 5
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Recordings with depth; default: the sample scene scenes/desk."""
    json: Path | None = None
    """Also write the results to this file, as JSON."""
    pairs: int = 20
    """Pairs of views per scene and distance, at most."""

    def run(self) -> None:
        """Measure, print tables, write the file."""
        from tqdm import tqdm

        from peaking.benchmarks import depth_completion, single_view
        from peaking.commands.arguments import ArgumentError
        from peaking.commands.results import write_results
        from peaking.commands.scenes import scenes_or_sample

        if self.pairs < 1:
            raise ArgumentError(f"need --pairs of at least 1, got {self.pairs}")
        scenes = scenes_or_sample(self.scenes)
        measured: dict[str, object] = {}
        for scene in tqdm(scenes, desc="quality", unit="scene"):
            views = single_view.single_view_quality(scene, pairs_per_distance=self.pairs)
            depths = depth_completion.depth_quality(scene)
            name = scene.resolve().name
            measured[name] = {
                "single_view": single_view.as_dict(views),
                "depth": depth_completion.as_dict(depths),
            }
            with tqdm.external_write_mode():
                say("", f"## {name}: from one view to a neighbour", "")
                say(*single_view.as_markdown(views).splitlines())
                say("", f"## {name}: depth completion", "")
                say(*depth_completion.as_markdown(depths).splitlines())
        write_results(self, {"scenes": measured})
