"""The commands as people run them, end to end on a drawn room."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

import peaking
from peaking.cli import COMMANDS, main
from peaking.commands.generate import Generate
from peaking.datasets import open_recording
from peaking.mpi_file import DEFAULT_QUALITY, read_mpi
from recordings import write_recording

FLAGS = ["--pixels", "19200"]


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    return write_recording(folder, num_frames=12, width_px=160, height_px=120)


def read_png(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return np.asarray(picture)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must end with code 2 and one line; return the line."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    last = said.strip().splitlines()[-1]
    assert last.startswith("peaking: ")
    assert "Traceback" not in said
    return last


def test_help_shows_the_commands_with_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    for command in ("replay", "generate", "render", "quality", "bench"):
        assert command in text
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert f"peaking {command}" in capsys.readouterr().out


def test_help_lists_every_command_with_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    listed = capsys.readouterr().out.partition("subcommands")[2]
    for name in COMMANDS:
        assert f"• {name} " in listed
    assert "Examples" not in listed


def test_commands_of_two_words_say_so_in_their_help(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("bench live", "bench generators", "bench trust"):
        with pytest.raises(SystemExit) as ended:
            main([*name.split(), "--help"])
        assert ended.value.code == 0
        assert f"usage: peaking {name} " in capsys.readouterr().out


STUDY = ("init", "serve", "analyse", "simulate", "export", "erase")


@pytest.mark.parametrize("name", [*COMMANDS, *(f"study {command}" for command in STUDY)])
def test_help_says_nothing_of_none(capsys: pytest.CaptureFixture[str], name: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*name.split(), "--help"])
    assert ended.value.code == 0
    assert "None" not in capsys.readouterr().out


def test_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--version"])
    assert capsys.readouterr().out == f"peaking {peaking.__version__}\n"


def test_what_measures_can_write_json() -> None:
    names = ("replay", "evaluate", "quality", "bench", "bench live", "bench generators", "plan")
    for name in (*names, "splat", "bench trust"):
        command: Any = COMMANDS[name]
        assert "json" in {field.name for field in dataclasses.fields(command)}


def test_a_value_error_that_is_no_wrong_argument_is_not_hidden(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*_: object) -> None:
        raise ValueError("operands could not be broadcast together")

    monkeypatch.setattr(COMMANDS["plan"], "run", broken)
    with pytest.raises(ValueError, match="broadcast"):
        main(["plan"])


def test_replay_writes_all_it_promises(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    main(["replay", str(room), "--out", str(out), "--threshold", "0.02", *FLAGS])
    assert {p.name for p in out.iterdir()} == {
        "overlay.mp4",
        "frames.csv",
        "summary.json",
        "report.html",
        "captured",
    }
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frames"] == 12
    assert summary["captured"] == len(summary["captured_indices"]) > 1
    assert summary["captured_indices"][0] == 0
    assert 0 < summary["mean_peaked_share"] < 0.2
    assert summary["preset"] == "default"
    assert summary["options"]["pixels"] == 19200
    assert {"render", "blend", "compare", "generate"} <= set(summary["stage_ms"])
    with (out / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    chosen = [i for i, row in enumerate(rows) if row["captured"] == "true"]
    assert chosen == summary["captured_indices"]
    for row in rows[1:]:
        assert (float(row["peaked_share"]) > 0.02) == (row["captured"] == "true")
    captured = open_recording(out / "captured")
    assert len(captured) == summary["captured"]
    np.testing.assert_array_equal(captured.read(1).rgb, open_recording(room).read(chosen[1]).rgb)
    said = capsys.readouterr().out
    assert said.strip().splitlines()[-1] == f"report: {(out / 'report.html').resolve()}"


def test_replay_of_the_sample_scene(tmp_path: Path) -> None:
    """Forty frames, 60 cm to the right: some views are needed, and far fewer than all."""
    desk, out = Path(__file__).parent.parent / "scenes/desk", tmp_path / "out"
    main(["replay", str(desk), "--out", str(out), "--max-frames", "40", "--no-video"])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frames"] == 40
    assert 3 <= summary["captured"] <= 12
    assert summary["mean_peaked_share"] < 0.0428
    assert summary["size_px"] == [294, 639]
    assert len(open_recording(out / "captured")) == summary["captured"]


def test_the_captured_views_can_be_replayed_again(room: Path, tmp_path: Path) -> None:
    main(["replay", str(room), "--out", str(tmp_path / "a"), "--no-video", *FLAGS])
    main(
        ["replay", str(tmp_path / "a/captured"), "--out", str(tmp_path / "b"), "--no-video", *FLAGS]
    )
    assert not (tmp_path / "b/overlay.mp4").exists()


def test_max_frames_presets_and_overlays(room: Path, tmp_path: Path) -> None:
    arguments = ["--preset", "paper", "--max-frames", "3", "--overlay", "video", "--no-video"]
    main(["replay", str(room), "--out", str(tmp_path / "out"), *arguments, *FLAGS])
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["frames"] == 3
    assert summary["preset"] == "paper"
    assert summary["options"]["blend_weights"] == "paper"
    assert summary["options"]["overlay"] == "video"


def test_generate_and_render(room: Path, tmp_path: Path) -> None:
    mpi_path, png, moved = tmp_path / "a.mpi", tmp_path / "a.png", tmp_path / "b.png"
    flags = ["--frame", "3", "--codec", "lossless", *FLAGS]
    main(["generate", str(room), "--out", str(mpi_path), *flags])
    mpi = read_mpi(mpi_path)
    assert mpi.camera.pinhole.size_px == (160, 120)
    assert mpi.num_planes == 32
    main(["render", str(mpi_path), "--out", str(png)])
    picture = read_png(png)
    original = open_recording(room).read(3).rgb[..., ::-1].astype(int)
    assert picture.shape == (120, 160, 4)
    assert np.abs(picture[..., :3] - original).mean() < 1.0
    main(
        [
            "render",
            str(room),
            "--frame",
            "3",
            "--move-m",
            "0.05",
            "0",
            "0",
            "--out",
            str(moved),
            *FLAGS,
        ]
    )
    assert read_png(moved).shape == (120, 160, 4)
    main(["render", str(mpi_path), "--show", "depth", "--out", str(tmp_path / "d.png")])
    depth = read_png(tmp_path / "d.png")
    assert depth.dtype == np.uint16
    recorded = open_recording(room).read(3).depth_m
    assert recorded is not None
    assert abs(np.median(depth / 1000.0 / recorded) - 1) < 0.01


def test_generate_has_the_librarys_default_quality() -> None:
    (quality,) = [f for f in dataclasses.fields(Generate) if f.name == "quality"]
    assert quality.default == DEFAULT_QUALITY


def test_a_folder_in_use_is_left_alone(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    line = fails(["replay", str(room), "--out", str(tmp_path), "--no-video"], capsys)
    assert str(tmp_path) in line
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_a_recording_that_breaks_off_leaves_nothing(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(room, broken)
    picture = sorted((broken / "images").iterdir())[5]
    picture.write_bytes(picture.read_bytes()[:-300])
    out = tmp_path / "deep/out"
    line = fails(["replay", str(broken), "--out", str(out), "--no-video", *FLAGS], capsys)
    assert picture.name in line
    assert not out.parent.exists()


def test_a_disk_that_the_video_fills_gets_one_sentence(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "bin/ffmpeg"
    program.parent.mkdir()
    program.write_text(
        "#!/bin/sh\n"
        "case \"$*\" in *-encoders*) echo ' V..... libx264 H.264'; exit 0;; esac\n"
        "head -c 100 >/dev/null\n"
        "echo 'Error writing trailer: No space left on device' >&2\n"
        "echo 'Error closing file: No space left on device' >&2\n"
        "exit 1\n"
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/usr/bin:/bin")
    out = tmp_path / "out"
    line = fails(["replay", str(room), "--out", str(out), *FLAGS], capsys)
    assert line.startswith("peaking: overlay.mp4: no room on the disk; free some space")
    assert not out.exists()


def test_a_recording_without_depth_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flat = write_recording(tmp_path / "flat", num_frames=2, with_depth=False)
    out = tmp_path / "out"
    line = fails(["replay", str(flat), "--out", str(out), "--no-video"], capsys)
    assert "transforms.json: no frame has depth;" in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (["--max-frames", "0"], "need --max-frames >= 1, got 0"),
        (["--threshold", "2"], "need 0 <= --threshold < 1, got 2.0"),
        (["--views", "0"], "need --views >= 1, got 0"),
        (["--fps", "0"], "need --fps > 0, got 0.0"),
        (["--guide", "planes", "--near-m", "-1"], "need --near-m > 0, got -1.0"),
        (["--error-threshold", "9"], "need 0 < --error-threshold < 3, got 9.0"),
        (["--pixels", "1"], "need --pixels >= "),
    ],
)
def test_a_complaint_names_the_option(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: list[str], says: str
) -> None:
    line = fails(["replay", str(room), "--out", str(tmp_path / "o"), "--no-video", *asked], capsys)
    assert says in line


def test_all_unknown_depth_says_so(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(room, broken)
    for depth in (p for p in broken.rglob("*.png") if "depth" in str(p.parent)):
        cv2.imwrite(str(depth), np.zeros_like(read_png(depth)))
    line = fails(
        ["replay", str(broken), "--out", str(tmp_path / "out"), "--no-video", *FLAGS], capsys
    )
    assert "no frame that the policy wanted has metric depth" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["replay", "{room}/nowhere", "--out", "{out}"], "nowhere"),
        (["replay", "{room}", "--out", "{out}", "--threshold", "1.5"], "threshold"),
        (["replay", "{room}", "--out", "{out}", "--max-frames", "0"], "--max-frames"),
        (["replay", "{room}", "--out", "{out}", "--neighbours", "0"], "neighbours"),
        (["generate", "{room}", "--out", "{out}", "--frame", "99"], "frame"),
        (["render", "{room}/transforms.json", "--out", "{out}"], "transforms.json"),
        (["render", "{room}/nothing.mpi", "--out", "{out}"], "nothing.mpi"),
        (["quality", "{room}/nowhere"], "nowhere"),
        (["quality", "{room}", "--pairs", "0"], "--pairs"),
        (["generate", "{room}", "--out", "{out}", "--quality", "0"], "--quality"),
        (["bench", "{room}", "--rounds", "0"], "--rounds"),
        (["bench", "live", "{room}", "--captures", "0"], "--captures"),
        (["bench", "generators", "--rounds", "0"], "--rounds"),
        (["bench", "trust", "{room}", "--only", "speed"], "--only"),
        (["demo", "--host", "0.0.0.0"], "loopback"),
        (["demo", "--host", "kitchen"], "kitchen"),
        (["demo", "--port", "99999"], "--port"),
        (["serve", "{out}", "--token", "Wq3vZ81-kTb5xNcE7r"], "--token-file"),
        (["serve", "{out}", "--token-file", "{room}/nothing"], "cannot be read"),
        (["serve", "{out}", "--token-file", "{room}/transforms.json"], "token"),
        (["serve", "{out}", "--port", "-1"], "--port"),
    ],
)
def test_bad_arguments_get_one_line(
    arguments: list[str],
    says: str,
    room: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    filled = [a.format(room=room, out=out) for a in arguments]
    assert says in fails(filled, capsys)
    assert not out.exists()


def test_a_corrupt_mpi_is_named(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.mpi"
    main(["generate", str(room), "--out", str(path), *FLAGS])
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    line = fails(["render", str(path), "--out", str(tmp_path / "a.png")], capsys)
    assert "a.mpi" in line
    assert not (tmp_path / "a.png").exists()


def test_plan_is_the_papers_by_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot = tmp_path / "plan.svg"
    main(["plan", "--plot", str(plot)])
    said = capsys.readouterr().out
    assert "N = 10.58: 11 views, at most 46.1 mm apart; as a square grid 4 × 4 = 16" in said
    assert "limited by        MPI pixel" in said
    drawing = ElementTree.fromstring(plot.read_text())
    assert "N = 10.6, 46.1 mm apart" in "".join(drawing.itertext())


def test_plan_draws_a_png_too(tmp_path: Path) -> None:
    plot = tmp_path / "plan.png"
    main(["plan", "--plot", str(plot)])
    picture = cv2.imread(str(plot))
    assert picture is not None
    assert picture.shape == (840, 1520, 3)
    assert (picture[0, 0] == 255).all()
    # The line of the MPI's pixel is blue (#1d5fc4), and the labels stand inside the picture.
    assert (picture == np.array([0xC4, 0x5F, 0x1D], np.uint8)).all(axis=2).sum() > 500
    assert (picture[:, -3:] == 255).all()


def test_plan_as_png_without_the_extra_says_what_to_install(
    tmp_path: Path,
) -> None:
    plot = tmp_path / "plan.png"
    code = (
        "import sys; sys.modules['matplotlib'] = None; from peaking.cli import main; "
        f"main(['plan', '--plot', {str(plot)!r}])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install 'peaking[study]', or name it plan.svg" in done.stderr
    assert not plot.exists()


def test_plan_says_what_limits_the_detail(capsys: pytest.CaptureFixture[str]) -> None:
    main(["plan", "--eye-m", "2"])
    assert "limited by        eye" in capsys.readouterr().out
    main(["plan", "--speed-m-per-s", "0.1"])
    assert "limited by        motion" in capsys.readouterr().out


def test_plan_writes_what_it_prints_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "new/plan.json"
    main(["plan", "--eye-m", "2", "--json", str(path)])
    written = json.loads(path.read_text())
    assert written["version"] == peaking.__version__
    assert written["arguments"]["eye_m"] == 2
    assert written["limited_by"] == "eye"
    views = written["visible_detail"]["num_views"]
    assert f"{views} views" in capsys.readouterr().out
    assert {limit["factor"] for limit in written["limits"]} == {"mpi", "eye", "display"}


def test_plan_refuses_what_is_no_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--z-min-m" in fails(["plan", "--z-min-m", "0"], capsys)
    assert "--eye-m" in fails(["plan", "--eye-m", "nan"], capsys)
    plot = tmp_path / "plan.pdf"
    assert ".svg or .png" in fails(["plan", "--plot", str(plot)], capsys)
    assert not plot.exists()
