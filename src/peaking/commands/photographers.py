"""`peaking photographers`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.experiments.executors import Executor
    from peaking.experiments.plan import EvaluationStep
    from peaking.experiments.steps import Found
    from peaking.photographers.plan import PhotographersPlan
    from peaking.photographers.tasks import SceneName


@dataclass(frozen=True)
class Photographers:
    """Does guidance help? Simulated photographers in drawn scenes, guide against guide.

    They walk, tremble, look at the screen late, and make mistakes; what they bring home within a
    limit of photos and of seconds is made into MPIs, which are compared with pictures from the
    whole volume that was to be photographed, off every path. docs/photographers.md says how. Scenes
    and photographers are drawn by the program: nothing is downloaded. Finished steps are kept:
    after Ctrl-C, run the same command again to continue.

    Examples:
      peaking photographers --json photographers.json
      peaking photographers --json quick.json --scenes desk --photographers 3 --photos 8 16
      peaking photographers --json gs.json --guides interval auto --splats 3
      peaking photographers --json red.json --guides threshold red --scenes room hall
      peaking photographers --walks out/walks --scenes room --photographers 3
    """

    json: Path | None = None
    """File to write all results to; can be left out with --walks alone."""
    out: Path | None = None
    """Folder for the table, pictures of scenes and paths, and what is needed to go on; default: the
    name of --json without its ending."""
    scenes: tuple[Literal["desk", "still-life", "room", "hall"], ...] = (
        "desk",
        "still-life",
        "room",
        "hall",
    )
    """Scenes; desk and still-life are for tuning, room and hall for reporting."""
    guides: tuple[Literal["interval", "llff", "threshold", "red", "auto", "next"], ...] = (
        "interval",
        "llff",
        "threshold",
        "red",
        "auto",
        "next",
    )
    """An interval shutter and no guide; LLFF's grids; the paper's red, pressed at 4.28 %; our red
    by hand; our red with the automatic shutter; the same with a frame to step into next. All are
    compared with `auto`, or with the first."""
    photos: tuple[int, ...] = (8, 16, 32)
    """Limits of photos."""
    seconds: float = 60.0
    """Limit of time, in seconds of the photographer."""
    photographers: int = 12
    """Photographers per guide and scene; of every three one is calm, one hasty, one dreamy."""
    test_views: int = 24
    """Pictures per scene to compare with."""
    splats: int = 0
    """Also train 3D Gaussians on what so many photographers brought home, at the largest limit."""
    iterations: int = 2000
    """Training steps of 3D Gaussians."""
    walks: Path | None = None
    """Only film the walks, without a guide, and write each as a recording into this folder."""
    workers: int | None = None
    """Number of processes; default: one per core."""
    ray: str | None = None
    """Run as Ray tasks (extra `ray`): the address of a cluster, or `local`."""

    def run(self) -> None:
        """Let them photograph, print the table and where the rest is."""
        from tqdm import tqdm

        from peaking.output import write_atomically
        from peaking.photographers.run import let_photograph
        from peaking.photographers.table import results_json, table_md

        def shown(
            steps: Iterable[tuple[EvaluationStep, Found]], total: int, what: str
        ) -> Iterable[tuple[EvaluationStep, Found]]:
            return tqdm(steps, total=total, desc=what, unit="step", disable=total == 0)

        with checked_arguments():
            plan = self._plan()
        if self.walks is not None:
            self._film(plan, self.walks)
            return
        if self.json is None:
            raise ArgumentError("need --json, the file to write results to")
        out = self.json.with_suffix("") if self.out is None else self.out
        if out == self.json:
            raise ArgumentError("need --out, for --json has no ending to leave out")
        photographed = let_photograph(plan, out, self._executor(), progress=shown)
        write_atomically(self.json, results_json(photographed).encode())
        say(*table_md(photographed).splitlines())
        say(photographed.costs.line())
        say(f"results: {self.json.resolve()}; table and pictures: {out.resolve()}")

    def _film(self, plan: PhotographersPlan, folder: Path) -> None:
        from tqdm import tqdm

        from peaking.photographers.recording import record_walk

        numbers = range(plan.photographers)
        walks: list[tuple[SceneName, int]] = [(s, k) for s in plan.scenes for k in numbers]
        for scene, photographer in tqdm(walks, desc="filming", unit="walk"):
            recording = record_walk(scene, photographer, seconds=plan.seconds)
            recording.write_subset(range(len(recording)), folder / recording.name)
        say(f"{len(walks)} recordings: {folder.resolve()}")

    def _plan(self) -> PhotographersPlan:
        from peaking.experiments.reconstruct import SplatTraining
        from peaking.photographers.plan import PhotographersPlan

        return PhotographersPlan(
            scenes=self.scenes,
            guides=self.guides,
            photos=self.photos,
            seconds=self.seconds,
            photographers=self.photographers,
            test_views=self.test_views,
            splats=self.splats,
            splat=SplatTraining(iterations=self.iterations),
        )

    def _executor(self) -> Executor:
        from peaking.experiments.executors import ProcessPool, RayTasks
        from peaking.photographers.steps import perform

        if self.ray is not None:
            return RayTasks(None if self.ray == "local" else self.ray, perform=perform)
        return ProcessPool(self.workers, perform=perform)
