"""Every example runs, on a small recording, and does what its first line says."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.mpi_file import read_mpi
from peaking.splat.ply import read_ply
from recordings import lateral_cameras, write_recording

EXAMPLES = Path(__file__).parent.parent / "examples"
FRAMES = 9


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> str:
    cameras = lateral_cameras(FRAMES, 96, 64)
    return str(write_recording(tmp_path_factory.mktemp("scenes") / "room", cameras=cameras))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Runner:
    return Runner(monkeypatch, capsys)


class Runner:
    """Runs an example as its user would, and returns what it printed."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch = monkeypatch
        self._capsys = capsys

    def __call__(self, name: str, *arguments: str) -> str:
        self._monkeypatch.setattr("sys.argv", [name, *arguments])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return self._capsys.readouterr().out


def test_what_is_missing(scene: str, run: Runner) -> None:
    lines = run("what_is_missing.py", scene).splitlines()
    shares = [[float(share) for share in re.findall(r"([\d.]+)%", line)] for line in lines]
    assert len(lines) == FRAMES
    assert shares[0][0] < 2
    assert shares[-1][1] > shares[0][1]


def test_choose_views(scene: str, run: Runner) -> None:
    few, many = (run("choose_views.py", scene, share) for share in ("0.2", "0.02"))
    taken, kept = zip(*(numbers_in(said) for said in (few, many)), strict=True)
    assert taken[0][0] == taken[1][0] == 0
    assert len(taken[0]) < len(taken[1]) < FRAMES
    assert [len(views) for views in kept] == [len(views) for views in taken]


def numbers_in(said: str) -> list[list[int]]:
    return [[int(word) for word in line.partition(":")[2].split()] for line in said.splitlines()]


def test_view_from_aside(scene: str, run: Runner, tmp_path: Path) -> None:
    mpi, aside = tmp_path / "view.mpi", tmp_path / "aside.png"
    said = run("view_from_aside.py", scene, str(mpi), str(aside))
    share = float(re.findall(r"([\d.]+)%", said)[0])
    assert 50 < share < 100
    picture = np.asarray(cv2.imread(str(aside)))
    assert picture.shape[:2] == read_mpi(mpi).camera.pinhole.size_px[::-1]
    assert picture.std() > 10


def test_train_gaussians(scene: str, run: Runner, tmp_path: Path) -> None:
    ply = tmp_path / "room.ply"
    said = run("train_gaussians.py", scene, str(ply), "20")
    assert said.endswith(f"{len(read_ply(ply))} Gaussians\n")


def test_every_example_is_run_here_and_named_in_the_readme() -> None:
    tests, readme = Path(__file__).read_text(), (EXAMPLES / "README.md").read_text()
    for example in EXAMPLES.glob("*.py"):
        assert f'"{example.name}"' in tests
        assert example.name in readme
