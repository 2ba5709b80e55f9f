"""`peaking splat` as people run it, on a drawn room."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import pytest

from peaking.cli import main
from peaking.splat.ply import read_ply
from recordings import write_recording

QUICK = ["--iterations", "60", "--pixels", "3072", "--backend", "numba"]


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    return drawn(folder)


def drawn(folder: Path, *, with_depth: bool = True) -> Path:
    return write_recording(folder, num_frames=8, width_px=64, height_px=48, with_depth=with_depth)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must end with code 2 and write nothing; return its last line."""
    with pytest.raises(SystemExit) as ended:
        main(["splat", *arguments])
    assert ended.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize("with_depth", (True, False))
def test_writes_a_ply_and_a_preview(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], *, with_depth: bool
) -> None:
    scene = room if with_depth else drawn(tmp_path / "scene", with_depth=False)
    out = tmp_path / "new" / "room.ply"
    main(["splat", str(scene), "--out", str(out), "--hold-out", "4", "--previews", "2", *QUICK])
    assert sorted(path.name for path in out.parent.iterdir()) == ["room.ply", "room_preview.jpg"]
    gaussians = read_ply(out)
    assert len(gaussians) > 100
    picture = cv2.imread(str(out.with_name("room_preview.jpg")))
    assert picture is not None
    assert picture.shape == (2 * 48 + 4, 3 * 64 + 8, 3)
    said = capsys.readouterr().out
    assert f"{len(gaussians)} Gaussians" in said
    decibels = float(said.split("held-out pictures: ")[1].split(" dB")[0])
    assert decibels > 15.0


def test_the_same_seed_gives_the_same_file(room: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        out = tmp_path / f"{name}.ply"
        main(["splat", str(room), "--out", str(out), "--previews", "0", "--seed", "3", *QUICK])
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ply", "b.ply"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "x.splat"], "need a file name ending in .ply"),
        (["--out", "x.ply", "--hold-out", "1"], "--hold-out 0 or at least 2"),
        (["--out", "x.ply", "--views", "2"], "--views of at least 3"),
        (["--out", "x.ply", "--iterations", "0"], "iterations"),
        (["--out", "x.ply", "--views", "4", "--hold-out", "2"], "has 2 pictures to train on"),
    ],
)
def test_wrong_arguments_are_named(
    room: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in fails([str(room), *arguments], capsys)
    assert not list(tmp_path.iterdir())


def test_places_that_cannot_be_written_to_are_found_at_once(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken.ply").mkdir()
    assert "is a folder" in fails([str(room), "--out", str(tmp_path / "taken.ply")], capsys)
    (tmp_path / "file").write_bytes(b"")
    below = tmp_path / "file" / "x.ply"
    assert "file: is a file" in fails([str(room), "--out", str(below)], capsys)


def test_a_scene_without_depth_or_movement_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = drawn(tmp_path / "scene", with_depth=False)
    fields = json.loads((scene / "transforms.json").read_text(encoding="utf-8"))
    for frame in fields["frames"]:
        for row in range(3):
            frame["transform_matrix"][row][3] = 0.0
    (scene / "transforms.json").write_text(json.dumps(fields), encoding="utf-8")
    said = fails([str(scene), "--out", str(tmp_path / "x.ply"), *QUICK], capsys)
    assert "has no depth, and no surface could be matched between two pictures" in said
    assert not (tmp_path / "x.ply").exists()


def test_what_is_not_installed_is_named(
    room: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    out = str(tmp_path / "x.ply")
    said = fails([str(room), "--out", out, "--cameras", "colmap"], capsys)
    assert "peaking[colmap]" in said
    assert not list(tmp_path.iterdir())
