"""`peaking evaluate`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from peaking.commands.arguments import checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.options import PAPER_PEAKED_SHARE, POLICY_NAMES, PolicyName
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.experiments.executors import Executor
    from peaking.experiments.plan import EvaluationOptions, EvaluationStep
    from peaking.experiments.steps import Found


@dataclass(frozen=True)
class Evaluate:
    """Compare view-selection strategies by the models that their views give: the paper's Table 1.

    Strategies choose equally many views from recordings; MPIs or 3D Gaussians are made from these,
    and held-out views are rendered and compared with their photographs. Writes report.html,
    results.json, views.csv, table.md and table.tex. Finished steps are kept: after Ctrl-C, run the
    same command again to continue.

    Examples:
      peaking evaluate scenes/desk --out out/desk
      peaking evaluate scenes/desk --out out/p --views threshold-count --test-views paper
      peaking evaluate ~/kitchen ~/office --out out/both --reconstruct mpi 3dgs --views 10 20 40
      peaking evaluate scenes/desk --out out/quick --strategies peaking uniform --views 12
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Recordings of any format (docs/formats.md), with depth (without: only 3dgs, and strategies
    that use poses)."""
    out: Path
    """Folder to write the results to."""
    strategies: tuple[PolicyName, ...] = POLICY_NAMES
    """View-selection strategies; all are compared with `peaking`, or with the first if it is not
    among them."""
    reconstruct: tuple[Literal["mpi", "3dgs"], ...] = ("mpi",)
    """What is made from the views; 3dgs trains for a minute or two per set of views on a CPU."""
    test_views: tuple[Literal["holdout", "paper"], ...] = ("holdout",)
    """`holdout`: every n-th frame, which no strategy may choose; `paper`: the middle frame between
    every two views of Uniform."""
    views: tuple[str, ...] = ()
    """Numbers of views, or `threshold-count`: as many as `threshold` takes. Default: three
    budgets."""
    threshold: float = PAPER_PEAKED_SHARE
    """With --views threshold-count: peaked share, 0…1, of that threshold (the paper's)."""
    seeds: int = 5
    """Repetitions of random strategies."""
    uniform_m_per_rad: float = 0.0
    """Metres of path that a rotation by one radian counts as for `uniform`; 0: positions only."""
    iterations: int = 2000
    """Training steps of 3dgs."""
    splat_pixels: int = 57280
    """Size in pixels of the pictures that 3dgs is trained and tested on (179×320)."""
    backend: Literal["numba", "gsplat"] = "numba"
    """Train 3dgs on the CPU (numba) or on CUDA (gsplat, extra `splat`)."""
    cameras: Literal["recorded", "colmap"] = "recorded"
    """Camera poses of 3dgs: the recorded ones or, as in the paper, COLMAP's (extra `colmap`)."""
    lpips_checkpoints: Path | None = None
    """Folder with torchvision's alexnet-owt-7be5be79.pth, for LPIPS; default: the folder that
    `peaking checkpoints` prints."""
    workers: int | None = None
    """Number of processes; default: one per core."""
    ray: str | None = None
    """Run as Ray tasks (extra `ray`): the address of a cluster, or `local`."""
    json: Path | None = None
    """Also write results.json to this file."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Evaluate, print the table and the path of the report."""
        from tqdm import tqdm

        from peaking.experiments.run import evaluate
        from peaking.experiments.tables import results_json, table_md
        from peaking.output import write_atomically

        def shown(
            steps: Iterable[tuple[EvaluationStep, Found]], total: int, what: str
        ) -> Iterable[tuple[EvaluationStep, Found]]:
            return tqdm(steps, total=total, desc=what, unit="step", disable=total == 0)

        with checked_arguments(
            threshold_share="--threshold", uniform_metres_per_rad="--uniform-m-per-rad"
        ):
            plan = self._plan()
        evaluation = evaluate(plan, self.out, self._executor(), progress=shown)
        if self.json is not None:
            write_atomically(self.json, results_json(evaluation).encode())
        say(*table_md(evaluation).splitlines())
        if evaluation.costs is not None:
            say(evaluation.costs.line())
        say(f"report: {(self.out / 'report.html').resolve()}")

    def _plan(self) -> EvaluationOptions:
        from peaking.datasets import Reading
        from peaking.experiments.plan import EvaluationOptions
        from peaking.experiments.reconstruct import SplatTraining

        return EvaluationOptions(
            scenes=self.scenes,
            options=self.method.options(),
            strategies=self.strategies,
            reconstruct=self.reconstruct,
            test_views=self.test_views,
            views=_views(self.views),
            threshold_share=self.threshold,
            seeds=self.seeds,
            uniform_metres_per_rad=self.uniform_m_per_rad,
            splat=SplatTraining(self.backend, self.iterations, self.splat_pixels),
            cameras=self.cameras,
            refine=self.reading.refine,
            reading=Reading(self.reading.format, self.reading.images),
            lpips_folder=self.lpips_checkpoints,
        )

    def _executor(self) -> Executor:
        from peaking.experiments.executors import ProcessPool, RayTasks

        if self.ray is not None:
            return RayTasks(None if self.ray == "local" else self.ray)
        return ProcessPool(self.workers)


def _views(words: tuple[str, ...]) -> tuple[int, ...] | Literal["threshold-count"] | None:
    if not words:
        return None
    if words == ("threshold-count",):
        return "threshold-count"
    if not all(word.isdecimal() for word in words):
        raise ValueError(f"need numbers or threshold-count for --views, got {' '.join(words)}")
    return tuple(int(word) for word in words)
