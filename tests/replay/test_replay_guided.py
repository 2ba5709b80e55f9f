"""Guided replays of a path that was drawn for it: sideways before a box, 5 cm per frame."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from peaking.cli import main
from peaking.datasets import Recording, open_recording
from peaking.errors import RecordingError
from peaking.options import DEFAULT
from peaking.replay.guided import GuideOptions, guided_walk
from recordings import write_recording

OPTIONS = replace(DEFAULT, pixels=160 * 120, num_planes=16)
"""f = 144 px and the box is 1 m away: Δu = 16 / 144 = 11.1 cm."""

GRID = GuideOptions(kind="plenoptic", area_side_m=0.3, near_m=0.005)
"""Three views a side, 10 cm apart: the middle row lies on the path, two frames apart."""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("guided") / "room"
    return write_recording(folder, num_frames=11, width_px=160, height_px=120)


def walked(room: Path) -> Recording:
    return open_recording(room)


def test_the_middle_row_of_the_grid_by_hand(room: Path) -> None:
    walk = guided_walk(walked(room), GRID, num_frames=11, options=OPTIONS)
    # Cameras that are turned have an edge of the box a little nearer along their axis.
    assert walk.bound.z_min_m == pytest.approx(1.0, abs=0.01)
    assert (walk.bound.views_per_side, len(walk.guide.targets)) == (3, 9)
    assert walk.target_of_frame == {3: 3, 5: 4, 7: 5}
    assert walk.as_dict()["reached"] == 3


def test_each_frame_and_each_target_counts_once_and_the_nearest_pair_first(room: Path) -> None:
    """With 30 cm of tolerance all nine targets find a frame; those on the path keep theirs."""
    wide = replace(GRID, near_m=0.3)
    walk = guided_walk(walked(room), wide, num_frames=11, options=OPTIONS)
    assert {3: 3, 5: 4, 7: 5}.items() <= walk.target_of_frame.items()
    assert sorted(walk.target_of_frame.values()) == list(range(9))


def test_a_direction_that_is_not_the_targets_does_not_count(room: Path) -> None:
    """Frames 3 and 7 are turned by 2.3°."""
    walk = guided_walk(walked(room), replace(GRID, angle_deg=2.0), num_frames=11, options=OPTIONS)
    assert walk.target_of_frame == {5: 4}


def test_hemisphere_and_planes_begin_at_the_anchor(room: Path) -> None:
    for kind in ("planes", "hemisphere"):
        choice = replace(GRID, kind=kind)
        walk = guided_walk(walked(room), choice, num_frames=11, options=OPTIONS)
        assert 5 in walk.target_of_frame


def test_the_command_writes_what_was_reached(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["--guide", "plenoptic", "--area-m", "0.3", "--near-m", "0.005", "--no-video"]
    arguments += ["--pixels", "19200", "--num-planes", "16"]
    main(["replay", str(room), "--out", str(out), *arguments])
    assert "the recorded path reaches 3 of 9 targets" in capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["captured_indices"] == [3, 5, 7]
    assert summary["guide"]["kind"] == "plenoptic"
    assert summary["guide"]["targets"] == 9
    report = (out / "report.html").read_text()
    assert "3 / 9" in report
    assert "guide.z_min_m" in report
    assert len(open_recording(out / "captured")) == 3


def test_what_cannot_be_guided_is_refused(room: Path, tmp_path: Path) -> None:
    blind = write_recording(tmp_path / "blind", with_depth=False)
    with pytest.raises(RecordingError, match="without --guide"):
        guided_walk(walked(blind), GRID, num_frames=4, options=OPTIONS)
    with pytest.raises(RecordingError, match="smaller --area-m"):
        guided_walk(walked(room), replace(GRID, area_side_m=100.0), num_frames=11, options=OPTIONS)
    # Four views a side: none of them lies on the path.
    even = replace(GRID, area_side_m=0.4)
    with pytest.raises(RecordingError, match="larger --near-m"):
        guided_walk(walked(room), even, num_frames=11, options=OPTIONS)
    with pytest.raises(ValueError, match="need area_m > 0"):
        replace(GRID, area_side_m=0.0)
    with pytest.raises(ValueError, match="need near_m > 0"):
        replace(GRID, near_m=-1.0)
