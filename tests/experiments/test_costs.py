"""What an evaluation takes: every MPI made once, every second counted once, memory of all."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evaluate_factories import FRAMES

from peaking.cli import main
from peaking.datasets import open_recording
from peaking.errors import OutputError
from peaking.experiments.costs import Costs, added, took, worker_name
from peaking.experiments.executors import InProcess, ProcessPool
from peaking.experiments.plan import EvaluationOptions, EvaluationStep
from peaking.experiments.run import evaluate
from peaking.experiments.steps import Found
from peaking.mpi import Mpi
from peaking.options import DEFAULT
from peaking.selection.mpi_files import MpiFiles
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.threshold import taken_at

SMALL = replace(DEFAULT, pixels=48 * 64, num_planes=8)


@pytest.fixture
def plan(walk: Path) -> EvaluationOptions:
    return EvaluationOptions(
        scenes=(walk,),
        options=SMALL,
        strategies=("peaking", "threshold", "uniform", "random", "all"),
        views=(3, 4),
        seeds=3,
    )


class Kept:
    """A pool whose results are looked at as they come."""

    def __init__(self) -> None:
        self.found: list[Found] = []

    def run(self, steps: Sequence[EvaluationStep]) -> Iterator[tuple[EvaluationStep, Found]]:
        for step, found in ProcessPool(2).run(steps):
            self.found.append(found)
            yield step, found


def test_two_workers_make_every_mpi_once(plan: EvaluationOptions, tmp_path: Path) -> None:
    """The 18 candidates at the full size, and at the size at which `peaking` looks at errors."""
    pool = Kept()
    costs = evaluate(plan, tmp_path / "out", pool).costs
    assert costs is not None
    assert costs.mpis_made == 2 * 18
    assert len({found["took"]["worker"] for found in pool.found}) > 1
    assert not (tmp_path / "out" / "cache" / "mpis").exists()


def test_who_finds_an_mpi_in_the_making_waits_for_it(walk: Path, tmp_path: Path) -> None:
    scene = RecordedFrames(open_recording(walk), SMALL)
    mpi = scene.mpi(0)
    made = Counter[int]()

    def make() -> Mpi:
        made[0] += 1
        return mpi

    with ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(MpiFiles(tmp_path).get, 0, make) for _ in range(8)]
        found = [future.result() for future in asked]
    assert made == {0: 1}
    for one in found:
        assert one.camera.pinhole == mpi.camera.pinhole
        np.testing.assert_array_equal(
            one.camera.world_from_cam.matrix(), mpi.camera.world_from_cam.matrix()
        )
        np.testing.assert_array_equal(one.plane_depths_m, mpi.plane_depths_m)
        np.testing.assert_array_equal(one.tile_places, mpi.tile_places)
        np.testing.assert_array_equal(one.texels, mpi.texels)
        assert one.generator == mpi.generator


def test_a_damaged_mpi_is_made_again(walk: Path, tmp_path: Path) -> None:
    mpi = RecordedFrames(open_recording(walk), SMALL).mpi(0)
    files = MpiFiles(tmp_path)
    files.get(0, lambda: mpi)
    (kept,) = tmp_path.glob("*.npz")
    kept.write_bytes(kept.read_bytes()[:-500])
    assert files.read(0) is None
    files.get(0, lambda: mpi)
    assert files.read(0) is not None


def test_mpis_that_cannot_be_kept_are_an_error_with_the_place(walk: Path, tmp_path: Path) -> None:
    mpi = RecordedFrames(open_recording(walk), SMALL).mpi(0)
    (tmp_path / "mpis").write_text("a file")
    with pytest.raises(OutputError, match=r"mpis/000000\.npz: cannot be written \(.*some 4 MB per"):
        MpiFiles(tmp_path / "mpis").get(0, lambda: mpi)


def test_a_walk_renders_nothing_that_another_saw(walk: Path) -> None:
    """The same threshold again costs no rendering; another one costs fewer than it would alone."""
    recording = open_recording(walk)
    scene, alone = RecordedFrames(recording, SMALL), RecordedFrames(recording, SMALL)
    path, path_alone = (frames.path(range(FRAMES)).candidates for frames in (scene, alone))
    first = taken_at(path, 0.02)
    looked = scene.peaked_share.cache_info().misses
    assert taken_at(path, 0.02) == first
    assert scene.peaked_share.cache_info().misses == looked
    other = taken_at(path, 0.03)
    assert other == taken_at(path_alone, 0.03)
    more = scene.peaked_share.cache_info().misses - looked
    assert more < alone.peaked_share.cache_info().misses


def test_every_second_counts_once() -> None:
    """Worked by hand: 3 s of which 1 s is reading and 0.5 s generating."""
    step = took("choosing", 3.0, {"reading": 1000.0, "generating": 500.0}, 7)
    assert step["processor_s"] == {"reading": 1.0, "generating": 0.5, "choosing": 1.5}
    costs = added([step, step], {"a:1": 200.0, "b:1": 300.0})
    assert costs.processor_s["choosing"] == 3.0
    assert sum(costs.processor_s.values()) == 6.0
    assert costs.mpis_made == 14
    assert costs.processes == 3
    assert costs.peak_mb > 500 + 10
    # This process is not counted twice where it is the worker.
    assert added([step], {worker_name(): 1.0}).processes == 1


def test_costs_in_one_line() -> None:
    costs = Costs({"reading": 1.0, "choosing": 3.0, "training": 0.0}, 12, 1234.0, 3)
    assert costs.line() == (
        "4 processor seconds: reading 25%, choosing 75%; 12 MPIs made; "
        "at most 1.2 GB in 3 processes"
    )


def test_what_earlier_runs_did_counts_and_their_workers_do_not(
    plan: EvaluationOptions, tmp_path: Path
) -> None:
    first = evaluate(plan, tmp_path / "out", ProcessPool(2)).costs
    again = evaluate(plan, tmp_path / "out", InProcess()).costs
    assert first is not None
    assert again is not None
    assert again.processor_s == pytest.approx(first.processor_s)
    assert first.processes == 3  # workers of one time and this; not those of all times
    assert again.processes == 1
    written = json.loads((tmp_path / "out" / "results.json").read_text())["costs"]
    assert written["processor_s"]["choosing"] > 0
    assert written["processor_s"]["scoring"] > 0


def test_the_command_says_what_it_took(
    walk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        *("evaluate", str(walk), "--out", str(tmp_path / "out"), "--views", "4"),
        *("--strategies", "uniform", "--pixels", "3072", "--num-planes", "8", "--workers", "1"),
    ]
    main(words)
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "processor seconds" in one]
    assert "rendering" in line
    assert "4 MPIs made" in line
    assert "in 2 processes" in line
