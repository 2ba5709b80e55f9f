"""Every policy walks a recording; what is dropped on the way is not captured in the end."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from peaking.cli import main
from peaking.datasets import open_recording
from peaking.selection.registry import POLICIES
from recordings import lateral_cameras, write_recording

FRAMES = 12
NUM_VIEWS = 2
SMALL = ["--no-video", "--pixels", "3072", "--num-planes", "8"]


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("policies") / "walk"
    return write_recording(folder, cameras=lateral_cameras(FRAMES, 48, 64))


@pytest.mark.parametrize("policy", sorted(POLICIES))
def test_a_policy_decides_what_is_captured(walked: Path, tmp_path: Path, policy: str) -> None:
    out = tmp_path / "out"
    asked = [] if policy == "all" else ["--views", str(NUM_VIEWS)]
    main(["replay", str(walked), "--out", str(out), "--policy", policy, *asked, *SMALL])
    summary = json.loads((out / "summary.json").read_text())
    with (out / "frames.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert summary["policy"] == policy
    assert summary["captured"] == (FRAMES if policy == "all" else NUM_VIEWS)
    captured = [int(row["index"]) for row in rows if row["captured"] == "true"]
    assert captured == summary["captured_indices"]
    assert len(open_recording(out / "captured")) == summary["captured"]
    assert all(row["reason"] for row in rows)
    dropped = [row for row in rows if row["dropped_at"]]
    assert bool(dropped) == (policy in ("peaking", "auto-shutter"))
    for row in dropped:
        assert int(row["index"]) <= int(row["dropped_at"]) < FRAMES
        assert row["captured"] == "false"
    if policy != "threshold":
        assert f"<dd>{policy}" in (out / "report.html").read_text()


def test_without_a_number_of_views_it_says_what_is_needed(
    walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(walked), "--out", str(tmp_path / "o"), "--policy", "uniform", *SMALL])
    assert ended.value.code == 2
    assert "need a number of views for the policy uniform" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("policy", ["peaking", "uniform", "threshold"])
def test_more_views_than_frames_are_refused_before_the_walk(
    walked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], policy: str
) -> None:
    asked = ["--policy", policy, "--views", "6", "--max-frames", "5"]
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(walked), "--out", str(tmp_path / "o"), *asked, *SMALL])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "leaves 5 frames to choose from, and 6 views were asked for" in said
    assert "Traceback" not in said
    assert not (tmp_path / "o").exists()
