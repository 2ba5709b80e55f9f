"""Run photographers; it can be stopped, and goes on where it was."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from peaking.errors import OutputError
from peaking.experiments.costs import added
from peaking.experiments.executors import Executor
from peaking.experiments.plan import EvaluationStep
from peaking.experiments.run import CACHE, Runner, StepProgress, no_progress, versions
from peaking.experiments.step_cache import StepCache
from peaking.output import check_folder, encode_png, write_atomically
from peaking.photographers.pictures import paths, sheet
from peaking.photographers.plan import PhotographersPlan, SessionStep, SplatStep, session_steps
from peaking.photographers.results import Home, compare
from peaking.photographers.sensor import Shot
from peaking.photographers.table import Photographed, results_json, table_md

BOOTSTRAP_SEED = 0
RESULTS, TABLE = "results.json", "table.md"


def let_photograph(
    plan: PhotographersPlan,
    out: Path,
    executor: Executor,
    *,
    progress: StepProgress = no_progress,
) -> Photographed:
    """Run, and write `results.json`, `table.md` and a picture of every scene and its paths.

    What single steps find is kept in `out/cache`.

    Args:
        plan: Who photographs what.
        out: The folder, new or of an earlier run.
        executor: Does steps by `photographers.steps.perform`.
        progress: Shows how far it is.

    Raises:
        OutputError: `out` is not writable, or holds something else.
    """
    _begin(plan, out)
    runner = Runner(StepCache(out / CACHE), executor, progress)
    sessions = session_steps(plan)
    found = runner.run(sessions, "photographing")
    homes = [home for step in sessions for home in _homes(step, found[step])]
    splats = {
        step: _splat_step(plan, step, found[step])
        for step in sessions
        if step.photographer < plan.splats and found[step]["limits"][-1]["shots"]
    }
    trained = runner.run(list(splats.values()), "training 3D Gaussians")
    homes += [
        _home(step, found[step]["limits"][-1] | trained[splat], model="3dgs")
        for step, splat in splats.items()
    ]
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    limits = sorted(plan.photos)
    differences, needed = compare(homes, reference=plan.reference, limits=limits, rng=rng)
    costs = added(runner.took.values(), runner.peaks_mb)
    photographed = Photographed(
        plan.as_dict(), versions(), plan.reference, limits, homes, differences, needed, costs
    )
    _draw(plan, out, found)
    write_atomically(out / TABLE, table_md(photographed).encode())
    write_atomically(out / RESULTS, results_json(photographed).encode())
    return photographed


def _begin(plan: PhotographersPlan, out: Path) -> None:
    check_folder(out)
    if out.exists():
        ours = {CACHE, RESULTS, TABLE}
        others = sorted(
            path.name for path in out.iterdir() if path.name not in ours and path.suffix != ".png"
        )
        if others:
            raise OutputError(f"{out}: holds {others[0]}, not photographers; give a new folder")
    for name in (RESULTS, TABLE):
        (out / name).unlink(missing_ok=True)


def _homes(step: SessionStep, found: Mapping[str, Any]) -> list[Home]:
    return [_home(step, limit, model="mpi") for limit in found["limits"]]


def _home(step: SessionStep, limit: Mapping[str, Any], *, model: str) -> Home:
    return Home(
        step.place,
        step.guide,
        model,
        limit["photos"],
        step.photographer,
        len(limit["shots"]),
        limit["seconds"],
        tuple(limit["psnr"]),
        tuple(limit["ssim"]),
    )


def _splat_step(plan: PhotographersPlan, step: SessionStep, found: Mapping[str, Any]) -> SplatStep:
    shots = tuple(
        Shot(s["number"], s["time_s"], tuple(s["world_from_cam"]), tuple(s["blur_px"]))
        for s in found["limits"][-1]["shots"]
    )
    return SplatStep(step.place, step.guide, step.photographer, shots, step.test_views, plan.splat)


def _draw(
    plan: PhotographersPlan, out: Path, found: Mapping[EvaluationStep, Mapping[str, Any]]
) -> None:
    """Draw every scene, and what its first photographer did with every guide."""
    for scene in plan.scenes:
        write_atomically(out / f"{scene}.png", encode_png(sheet(scene)))
        walked = {
            step.guide: (
                found[step]["path"],
                [shot["world_from_cam"] for shot in found[step]["limits"][-1]["shots"]],
            )
            for step in session_steps(plan)
            if step.place == scene and step.photographer == 0
        }
        picture = paths(scene, walked, plan.test_views)
        write_atomically(out / f"{scene}-paths.png", encode_png(picture))
