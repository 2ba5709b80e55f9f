"""Run an evaluation: choose views, score them, write the results. It can be stopped and goes on."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import peaking
from peaking.datasets import open_recording
from peaking.datasets.mended_poses import refined
from peaking.errors import OutputError, RecordingError
from peaking.experiments.costs import added
from peaking.experiments.evaluation_report import write_report
from peaking.experiments.executors import Executor
from peaking.experiments.intervals import compare
from peaking.experiments.placing import Placement
from peaking.experiments.plan import (
    ChooseStep,
    CountStep,
    EvaluationOptions,
    EvaluationStep,
    PlaceStep,
    ScoreStep,
    case_of,
    choose_steps,
    score_step,
)
from peaking.experiments.results import Case, CaseResult, ViewScore
from peaking.experiments.scoring import with_pictures
from peaking.experiments.splits import budgets, num_candidates
from peaking.experiments.step_cache import StepCache
from peaking.experiments.steps import Found
from peaking.experiments.tables import Evaluation, per_view_csv, results_json, table_md, table_tex
from peaking.metrics.lpips import LpipsName, available
from peaking.output import check_folder, write_atomically
from peaking.selection.registry import POLICIES

CACHE = "cache"
MPIS = "mpis"
"""In the cache, while an evaluation runs: the MPIs that its workers share."""
PICTURES = "pictures"
OUTPUTS = ("results.json", "views.csv", "table.md", "table.tex", "report.html")

BOOTSTRAP_SEED = 20250625
"""Of the resampling of test views: the same results give the same intervals."""

StepProgress = Callable[
    [Iterable[tuple[EvaluationStep, Found]], int, str], Iterable[tuple[EvaluationStep, Found]]
]
"""Wraps finished steps, with their number and what they are, to show how far it is."""


def no_progress(
    steps: Iterable[tuple[EvaluationStep, Found]], total: int, what: str
) -> Iterable[tuple[EvaluationStep, Found]]:
    """Show nothing."""
    return steps


@dataclass(frozen=True)
class Runner:
    """Does steps that are not in the cache yet."""

    cache: StepCache
    executor: Executor
    progress: StepProgress = no_progress
    peaks_mb: dict[str, float] = field(default_factory=dict[str, float])
    """The most memory that each worker had, by its name; of the workers that had most together."""
    took: dict[EvaluationStep, Mapping[str, Any]] = field(
        default_factory=dict[EvaluationStep, Mapping[str, Any]]
    )

    def run(self, steps: Sequence[EvaluationStep], what: str) -> dict[EvaluationStep, Found]:
        """Return what every step found."""
        unique = list(dict.fromkeys(steps))
        found = {step: known for step in unique if (known := self.cache.get(step)) is not None}
        missing = [step for step in unique if step not in found]
        if missing:
            self.cache.tell_if_none_fits()
        peaks_mb: dict[str, float] = {}
        for step, result in self.progress(self.executor.run(missing), len(missing), what):
            self.cache.keep(step, result)
            found[step] = result
            peaks_mb[result["took"]["worker"]] = result["took"]["peak_mb"]
        # Those of the last call are gone by now: they need no room beside these.
        if sum(peaks_mb.values()) > sum(self.peaks_mb.values()):
            self.peaks_mb.clear()
            self.peaks_mb.update(peaks_mb)
        self.took.update({step: result["took"] for step, result in found.items()})
        return found


def evaluate(
    plan: EvaluationOptions,
    out: Path,
    executor: Executor,
    *,
    progress: StepProgress = no_progress,
) -> Evaluation:
    """Run and write `results.json`, `views.csv`, `table.md`, `table.tex`, `report.html`, pictures.

    What single steps find is kept in `out/cache`, so that a run that was stopped goes on where it
    was; the results themselves appear at the end, and old ones are taken away at the start.

    Raises:
        RecordingError: A recording cannot be used or has too few frames.
        CamerasNotFound: COLMAP cannot join the pictures of a recording.
        BackendUnavailable: What a step needs is not installed.
        OutputError: `out` is not writable, or holds something else.
    """
    _begin(out)
    runner = Runner(StepCache(out / CACHE), executor, progress)
    prints = {scene: _checked(plan, scene) for scene in plan.scenes}
    placements = _placements(plan, prints, runner)
    choices: list[ChooseStep] = []
    mpis = (out / CACHE / MPIS).resolve()
    for scene, counts in _counts(plan, prints, runner, mpis).items():
        choices += choose_steps(plan, scene, prints[scene], counts, mpis=mpis)
    chosen = runner.run(choices, "choosing views")
    lpips = _lpips_at_hand(plan)
    scored_as: dict[Case, tuple[tuple[int, ...], ScoreStep]] = {}
    for how in plan.reconstruct:
        for choice in choices:
            found = chosen[choice]
            placement = placements.get(choice.scene)
            step = score_step(plan, choice, found, how=how, placement=placement, lpips=lpips)
            scored_as.setdefault(case_of(choice, found, how=how), (tuple(found["views"]), step))
    scored = runner.run([step for _, step in scored_as.values()], "scoring views")
    results = [
        _result(case, views, step, found=scored[step], out=out)
        for case, (views, step) in scored_as.items()
    ]
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    evaluation = Evaluation(
        plan.as_dict(),
        versions(),
        plan.reference,
        results,
        compare(results, reference=plan.reference, rng=rng),
        notes=[
            *(f"{scene.resolve().name}: {p.words()}." for scene, p in placements.items()),
            *(f"{s.resolve().name}: {_mended(plan, s)}." for s in plan.scenes if plan.refine),
        ],
        costs=added(runner.took.values(), runner.peaks_mb),
    )
    _write(evaluation, out)
    shutil.rmtree(mpis, ignore_errors=True)
    return evaluation


def _begin(out: Path) -> None:
    """Take old results away; refuse a folder that holds something else."""
    ours = {CACHE, PICTURES, *OUTPUTS}
    check_folder(out)
    if out.exists():
        others = sorted(path.name for path in out.iterdir() if path.name not in ours)
        if others:
            raise OutputError(f"{out}: holds {others[0]}, not an evaluation; give a new folder")
    for name in OUTPUTS:
        (out / name).unlink(missing_ok=True)
    shutil.rmtree(out / PICTURES, ignore_errors=True)


def _checked(plan: EvaluationOptions, root: Path) -> str:
    """Return the recording's fingerprint after looking whether the plan fits it."""
    recording = open_recording(root, plan.reading)
    if not any(recording.has_depth):
        needing = sorted(name for name in plan.strategies if POLICIES[name].needs_depth)
        needing += ["--reconstruct mpi"] if "mpi" in plan.reconstruct else []
        if needing:
            raise RecordingError(
                recording.path,
                f"no frame has metric depth, which {' and '.join(needing)} need",
                remedy="leave these out (--strategies, --reconstruct) or record with depth",
            )
    return (refined(recording) if plan.refine else recording).fingerprint()


def _mended(plan: EvaluationOptions, scene: Path) -> str:
    """Say what became of the poses of a scene."""
    return refined(open_recording(scene, plan.reading)).mended.words


def _counts(
    plan: EvaluationOptions, prints: Mapping[Path, str], runner: Runner, mpis: Path
) -> dict[Path, tuple[int, ...]]:
    """Return for every scene how many views to choose."""
    if isinstance(plan.views, tuple):
        return dict.fromkeys(plan.scenes, plan.views)
    if plan.views is None:
        opened = {scene: open_recording(scene, plan.reading) for scene in plan.scenes}
        return {scene: budgets(num_candidates(one)) for scene, one in opened.items()}
    steps = {
        scene: CountStep(
            scene, prints[scene], plan.options, plan.threshold_share, mpis, plan.reading
        )
        for scene in plan.scenes
    }
    found = runner.run(list(steps.values()), "counting views")
    return {scene: (int(found[step]["count"]),) for scene, step in steps.items()}


def _placements(
    plan: EvaluationOptions, prints: Mapping[Path, str], runner: Runner
) -> dict[Path, Placement]:
    """Return where COLMAP says that the frames were taken; nothing where it is not asked."""
    if plan.cameras == "recorded":
        return {}
    steps = {scene: PlaceStep(scene, prints[scene], plan.reading) for scene in plan.scenes}
    found = runner.run(list(steps.values()), "finding cameras (COLMAP; minutes)")
    return {scene: Placement.read(found[step]) for scene, step in steps.items()}


def _lpips_at_hand(plan: EvaluationOptions) -> tuple[LpipsName, ...]:
    """Return the learned distances whose weights are here: the official one, else the other."""
    names: tuple[LpipsName, ...] = ("lpips-alex", "st-lpips-alex")
    for name in names:
        if available(name, folder=plan.lpips_folder):
            return (name,)
    return ()


def _result(
    case: Case, views: tuple[int, ...], step: ScoreStep, *, found: Found, out: Path
) -> CaseResult:
    """Return the scores of a case, after writing the pictures of its worst views."""
    stem = f"{case.scene}_{case.strategy}_{case.reconstruct}_{case.test_views}"
    stem += f"_{case.n_views}_{case.seed}"
    files = _write_pictures(found["pictures"], out, stem)
    scores = [ViewScore(**score) for score in found["scores"]]
    lost = len(views) - len(step.views)
    return CaseResult(case, views, tuple(with_pictures(scores, files)), found["seconds"], lost)


def _write_pictures(pictures: Mapping[str, str], out: Path, stem: str) -> dict[int, str]:
    """Write the pictures of the worst views; return their names by view."""
    files: dict[int, str] = {}
    for view, encoded in pictures.items():
        name = f"{PICTURES}/{stem}_{view}.jpg"
        write_atomically(out / name, base64.b64decode(encoded))
        files[int(view)] = name
    return files


def versions() -> dict[str, str]:
    """Return the versions of what the figures depend on."""
    found = {"peaking": peaking.__version__}
    for name in ("numpy", "numba", "opencv-python-headless", "torch", "gsplat", "pycolmap"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _write(evaluation: Evaluation, out: Path) -> None:
    """Write the results; `results.json` comes last, and says that the others are whole."""
    write_atomically(out / "views.csv", per_view_csv(evaluation).encode())
    write_atomically(out / "table.md", table_md(evaluation).encode())
    write_atomically(out / "table.tex", table_tex(evaluation).encode())
    write_report(out / "report.html", evaluation, out_root=out)
    write_atomically(out / "results.json", results_json(evaluation).encode())
