"""`peaking evaluate`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from peaking.commands.arguments import checked_arguments
from peaking.commands.options import MethodFlags
from peaking.options import PAPER_PEAKED_SHARE

if TYPE_CHECKING:
    from peaking.experiments.executors import Executor
    from peaking.experiments.plan import EvaluationOptions, Step
    from peaking.experiments.steps import Found

StrategyName = Literal["peaking", "threshold", "uniform", "farthest", "plenoptic", "random", "all"]


@dataclass(frozen=True)
class Evaluate:
    """Find out which way of choosing views gives the better models: the paper's Table 1.

    From recordings, strategies choose equally many views; MPIs or 3D Gaussians are made of them,
    and views that were kept back are rendered and compared with their photographs. Writes
    report.html, results.json, views.csv, table.md and table.tex. What is done is kept: run the same
    command again to go on after Ctrl-C.

    Examples:
      peaking evaluate scenes/desk --out out/desk
      peaking evaluate scenes/desk --out out/p --views threshold-count --test-views paper
      peaking evaluate ~/kitchen ~/office --out out/both --reconstruct mpi 3dgs --views 10 20 40
      peaking evaluate scenes/desk --out out/quick --strategies peaking uniform --views 12
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Nerfstudio folders with depth (without: 3dgs and strategies that go by poses only)."""
    out: Path
    """Folder for the results."""
    strategies: tuple[StrategyName, ...] = (
        "peaking", "threshold", "uniform", "farthest", "plenoptic", "random", "all",
    )  # fmt: skip
    """View-selection strategies to compare, all with `peaking`, or with the first without it."""
    reconstruct: tuple[Literal["mpi", "3dgs"], ...] = ("mpi",)
    """What is made of the views; 3dgs trains for a minute or two per data set on a CPU."""
    test_views: tuple[Literal["holdout", "paper"], ...] = ("holdout",)
    """Every n-th frame, never a candidate; or the middle frame between every two of Uniform."""
    views: tuple[str, ...] = ()
    """Numbers of views, or `threshold-count`: as many as `threshold` takes (three budgets)."""
    threshold: float = PAPER_PEAKED_SHARE
    """Peaked share, 0…1, at which `threshold-count` counts (the paper's)."""
    seeds: int = 5
    """Repetitions of what is random."""
    uniform_rotation: float = 0.0
    """Metres of path that a rotation by one radian counts as for `uniform`; 0: places only."""
    iterations: int = 2000
    """Steps of 3dgs training."""
    splat_pixels: int = 57280
    """Pixels of the pictures in 3dgs training and its test (179×320)."""
    backend: Literal["numba", "gsplat"] = "numba"
    """3dgs on the CPU, or with CUDA (extra [splat])."""
    cameras: Literal["recorded", "colmap"] = "recorded"
    """Where 3dgs takes views and test views to be: as recorded, or as COLMAP says (extra
    [colmap]), as in the paper."""
    lpips_weights: Path | None = None
    """Folder with torchvision's alexnet-owt-7be5be79.pth, for LPIPS."""
    workers: int | None = None
    """Processes; one per core without."""
    ray: str | None = None
    """Run as Ray tasks (extra [ray]): the address of a cluster, or `local`."""
    method: MethodFlags = field(default_factory=MethodFlags)

    def run(self) -> None:
        """Evaluate, print the table, and say where the report is."""
        from tqdm import tqdm

        from peaking.experiments.run import evaluate
        from peaking.experiments.tables import table_md

        def shown(
            steps: Iterable[tuple[Step, Found]], total: int, what: str
        ) -> Iterable[tuple[Step, Found]]:
            return tqdm(steps, total=total, desc=what, unit="step", disable=total == 0)

        with checked_arguments():
            plan = self._plan()
        evaluation = evaluate(plan, self.out, self._executor(), progress=shown)
        print(table_md(evaluation))
        if evaluation.costs is not None:
            print(evaluation.costs.line())
        print(f"report: {(self.out / 'report.html').resolve()}")

    def _plan(self) -> EvaluationOptions:
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
            uniform_metres_per_rad=self.uniform_rotation,
            splat=SplatTraining(self.backend, self.iterations, self.splat_pixels),
            cameras=self.cameras,
            lpips_folder=self.lpips_weights,
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
