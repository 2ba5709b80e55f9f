"""The best frames of a recording: what goes first, what is said of them, and what is written."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.best_frames import BestFrames, choose_best
from peaking.best_frames.choosing import FrameChoice
from peaking.cli import main
from peaking.datasets import Recording, open_recording
from peaking.datasets.depth_unit import typical_distance
from peaking.options import DEFAULT
from peaking.output import encode_png
from peaking.selection.backward_elimination import enough
from peaking.selection.blur import relative_to_nearest, sharpness
from peaking.selection.policy import CurvePoint
from recordings import Room, lateral_cameras, write_recording

NUM_FRAMES = 24
SIZE_PX = (160, 120)
SMALL = replace(DEFAULT, pixels=160 * 120, num_planes=8)
BLURRED = (4, 5, 11, 17)
DARK = 8


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk on which some pictures are blurred and one is dark."""
    root = tmp_path_factory.mktemp("walk") / "walk"
    write_recording(root, cameras=lateral_cameras(NUM_FRAMES, *SIZE_PX))
    for number in (*BLURRED, DARK):
        path = root / f"images/frame_{number:05d}.png"
        bgr = cv2.imread(str(path))
        assert bgr is not None
        changed = cv2.blur(bgr, (7, 1)) if number != DARK else (0.6 * bgr).astype(np.uint8)
        path.write_bytes(encode_png(np.ascontiguousarray(changed[..., ::-1])))
    return root


@pytest.fixture(scope="module")
def recording(walk: Path) -> Recording:
    return open_recording(walk)


@pytest.fixture(scope="module")
def best(recording: Recording) -> BestFrames:
    return choose_best(recording, 6, options=SMALL)


def choice(best: BestFrames, number: int) -> FrameChoice:
    return best.frames[number]


def test_as_many_are_kept_as_asked_and_every_frame_has_its_reason(best: BestFrames) -> None:
    assert len(best.kept) == 6
    assert [frame.number for frame in best.frames] == list(range(NUM_FRAMES))
    assert all(frame.reason for frame in best.frames)


def test_blurred_and_dark_frames_go_first_and_it_is_said(best: BestFrames) -> None:
    assert not {*BLURRED, DARK} & set(best.kept)
    assert {choice(best, number).reason for number in BLURRED} == {
        "less sharp than others from there"
    }
    assert choice(best, DARK).reason == "darker than others from there"
    others = [f for f in best.frames if not f.kept and f.number not in {*BLURRED, DARK}]
    assert {frame.reason for frame in others} == {"the frames kept show the same"}


def test_kept_views_are_worth_something(best: BestFrames) -> None:
    kept = [frame for frame in best.frames if frame.kept]
    assert all(frame.worth_db is not None and frame.worth_db > 0 for frame in kept)
    assert {frame.reason for frame in kept} <= {"shows what no other does", "wrong without it"}
    # The ends of the walk show what nothing else does.
    assert choice(best, best.kept[0]).reason == "shows what no other does"


def test_the_curve_rises_and_says_how_many_are_enough(recording: Recording) -> None:
    best = choose_best(recording, None, options=SMALL)
    psnr_db = [point.psnr_db for point in best.curve if isinstance(point, CurvePoint)]
    assert [point.num_views for point in best.curve][:3] == [1, 2, 3]
    assert psnr_db[0] < psnr_db[3] < psnr_db[7]
    assert 3 <= len(best.kept) < NUM_FRAMES


def test_enough_is_where_twice_as_many_bring_less() -> None:
    curve = [CurvePoint(n, db) for n, db in ((1, 10.0), (2, 15.0), (3, 17.0), (4, 18.0), (8, 18.5))]
    assert enough(curve, gain_db=1.0) == 4
    assert enough(curve, gain_db=4.0) == 2
    assert enough(curve[:1]) == 1
    # What got worse again is no gain.
    assert enough([CurvePoint(1, 10.0), CurvePoint(2, 9.0)]) == 1


def test_without_depth_poses_and_sharpness_decide(tmp_path: Path) -> None:
    root = tmp_path / "no_depth"
    write_recording(root, cameras=lateral_cameras(NUM_FRAMES, *SIZE_PX), with_depth=False)
    best = choose_best(open_recording(root), 6, options=SMALL)
    assert not best.by_pictures
    assert len(best.kept) == 6
    assert np.diff([0, *best.kept, NUM_FRAMES - 1]).max() <= NUM_FRAMES // 3
    gaps = [point.gap_share for point in best.curve if not isinstance(point, CurvePoint)]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] == pytest.approx(0.0, abs=1e-6)


def test_how_far_things_are_is_told_by_pictures_and_poses(tmp_path: Path) -> None:
    room = Room(wall_m=3.0, box_m=None)
    write_recording(tmp_path / "far", cameras=lateral_cameras(8, 320, 240), room=room)
    far = open_recording(tmp_path / "far")
    assert typical_distance(far.cameras, far.read) == pytest.approx(3.0, rel=0.05)


def test_more_than_there_are_is_refused(recording: Recording) -> None:
    with pytest.raises(ValueError, match="need 1 to 24 views, got 25"):
        choose_best(recording, 25, options=SMALL)


def test_the_command_writes_a_data_set_and_why(walk: Path, tmp_path: Path) -> None:
    out, numbers = tmp_path / "best", tmp_path / "best.json"
    size = ["--pixels", str(SMALL.pixels), "--num-planes", "8"]
    main(["select", str(walk), "--views", "6", "--out", str(out), "--json", str(numbers), *size])
    written = open_recording(out)
    found = json.loads(numbers.read_text())
    assert len(written) == 6
    assert all(written.has_depth)
    rows = list(csv.DictReader((out / "selection.csv").read_text().splitlines()))
    assert [int(row["index"]) for row in rows if row["kept"] == "1"] == found["kept"]
    assert all(row["reason"] for row in rows)
    assert found["seconds"].keys() == {"reading", "generating", "choosing"}
    page = (out / "report.html").read_text()
    assert "Kept (6)" in page
    assert "less sharp than others from there (4)" in page
    assert not re.search(r'(src|href)="(?!data:|selection\.csv|transforms\.json)', page)


def test_fewer_than_asked_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walked = lateral_cameras(6, 64, 48)
    root = write_recording(tmp_path / "still", cameras=[walked[0]] * 4 + walked[1:])
    main(
        ["select", str(root), "--views", "8", "--out", str(tmp_path / "best"), "--num-planes", "8"]
    )
    assert len(open_recording(tmp_path / "best")) == 6
    assert "only 6 frames were taken from different places" in capsys.readouterr().out


def test_nothing_is_left_when_it_cannot_be_done(
    walk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["select", str(walk), "--views", "99", "--out", str(tmp_path / "best")])
    assert ended.value.code == 2
    assert "need 1 to 24 views, got 99" in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []


# Sharpness


@pytest.mark.parametrize("kernel", [(5, 1), (1, 5), (4, 4)], ids=str)
def test_blur_in_any_direction_is_seen(kernel: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    rgb = cv2.resize(rng.integers(0, 255, (60, 80, 3), dtype=np.uint8), (320, 240))
    assert sharpness(cv2.blur(rgb, kernel)) < 0.8 * sharpness(rgb)


def test_sharpness_does_not_depend_on_exposure() -> None:
    rng = np.random.default_rng(1)
    rgb = cv2.resize(rng.integers(0, 255, (60, 80, 3), dtype=np.uint8), (320, 240))
    assert sharpness((rgb * 0.5).astype(np.uint8)) == pytest.approx(sharpness(rgb), rel=0.05)
    assert sharpness(np.zeros((20, 20, 3), np.uint8)) == 0.0


def test_values_are_compared_with_those_from_nearby() -> None:
    cameras = lateral_cameras(40, 64, 48)
    values = np.where(np.arange(40) < 20, 1.0, 3.0)
    values[10] = 0.5
    relative = relative_to_nearest(cameras, values)
    assert relative[10] == pytest.approx(0.5)
    assert relative[[0, 39]].tolist() == [1.0, 1.0]
