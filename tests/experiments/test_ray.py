"""Ray tasks find what a process finds; not part of a plain run: `pytest -m ray` with the extra."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from peaking.experiments.executors import InProcess, RayTasks
from peaking.experiments.plan import EvaluationOptions, EvaluationStep
from peaking.experiments.run import evaluate
from peaking.experiments.steps import Found
from peaking.options import DEFAULT
from recordings import lateral_cameras, write_recording

pytestmark = [pytest.mark.ray, pytest.mark.filterwarnings("default")]


class Killing:
    """Ray, of which one worker is killed once, after its first result."""

    def __init__(self, tasks: RayTasks) -> None:
        self._tasks = tasks
        self.killed = 0
        self.results: list[EvaluationStep] = []

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        for step, found in self._tasks.run(steps):
            if not self.killed:
                self.killed = kill_a_worker()
            self.results.append(step)
            yield step, found


def kill_a_worker() -> int:
    """Kill a worker that does a step; return its number."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            words = (entry / "cmdline").read_bytes()
            if words.startswith(b"ray::_perform"):
                os.kill(int(entry.name), signal.SIGKILL)
                return int(entry.name)
    raise AssertionError("no worker does a step")


@pytest.fixture
def two_workers() -> Iterator[None]:
    import ray  # pyright: ignore[reportMissingImports]

    module: Any = ray
    root = Path(__file__).parents[2]
    module.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        runtime_env={"env_vars": {"PYTHONPATH": f"{root}/src:{root}/tests"}},
    )
    yield
    module.shutdown()


def test_one_of_two_workers_is_killed_and_nothing_is_lost_or_doubled(
    two_workers: None, tmp_path: Path
) -> None:
    scene = write_recording(tmp_path / "walk", cameras=lateral_cameras(24, 48, 64))
    plan = EvaluationOptions(
        scenes=(scene,),
        options=replace(DEFAULT, pixels=48 * 64, num_planes=8),
        strategies=("peaking", "threshold", "uniform", "random"),
        views=(4,),
        seeds=3,
    )
    here = evaluate(plan, tmp_path / "here", InProcess())
    tasks = Killing(RayTasks())
    there = evaluate(plan, tmp_path / "there", tasks)
    assert tasks.killed
    assert len(tasks.results) == len(set(tasks.results))
    for one, other in zip(here.results, there.results, strict=True):
        assert one.case == other.case
        assert one.views == other.views
        for a, b in zip(one.scores, other.scores, strict=True):
            assert a.psnr == pytest.approx(b.psnr, abs=1e-6)
            assert a.flip == pytest.approx(b.flip, abs=1e-6)
