import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from replay_factories import path_record, settings, walk

from peaking.replay.records import (
    FrameRecord,
    PoseCorrection,
    summarize,
    write_frames_csv,
    write_summary,
)


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def test_two_frames_by_hand(tmp_path: Path) -> None:
    first = FrameRecord(
        index=0,
        name="a, b.jpg",
        position_m=np.array([1.0, -2.0, 0.5]),
        forward=np.array([0.0, 0.0, 1.0]),
        up=np.array([0.0, -1.0, 0.0]),
        captured=True,
        timestamp_s=1700000000.123456,
        stage_ms={"read": 1.5},
    )
    second = FrameRecord(
        index=1,
        name="c.jpg",
        position_m=np.array([1.0, -2.0, 0.6]),
        forward=np.array([0.0, 0.0, 1.0]),
        up=np.array([0.0, -1.0, 0.0]),
        captured=False,
        nearest_distance_m=0.1,
        peaked_share=0.03125,
        unseen_share=0.0,
        mean_error=0.25,
        stage_ms={"read": 1.25, "render": 12.0},
    )
    write_frames_csv(tmp_path / "frames.csv", [first, second])
    assert (tmp_path / "frames.csv").read_text() == (
        "index,name,timestamp_s,captured,dropped_at,reason,peaked_share,wrong_share,unseen_share,unfixable_share,"
        "mean_error,nearest_distance_m,"
        "position_x_m,position_y_m,position_z_m,forward_x,forward_y,forward_z,up_x,up_y,up_z,"
        "ms_read,ms_render\n"
        '0,"a, b.jpg",1700000000.123456,true,,,,,,,,,1.000000,-2.000000,0.500000,'
        "0.000000,0.000000,1.000000,0.000000,-1.000000,0.000000,1.500,\n"
        "1,c.jpg,,false,,,0.031250,,0.000000,,0.250000,0.100000,1.000000,-2.000000,0.600000,"
        "0.000000,0.000000,1.000000,0.000000,-1.000000,0.000000,1.250,12.000\n"
    )


def test_corrected_poses_stand_beside_the_recorded_ones(tmp_path: Path) -> None:
    correction = PoseCorrection(
        moved_m=0.006,
        turned_rad=0.004,
        failure=None,
        position_m=np.array([0.006, 0.0, 0.0]),
        forward=np.array([0.0, 0.0, 1.0]),
        up=np.array([0.0, -1.0, 0.0]),
    )
    failed = replace(correction, moved_m=0.0, turned_rad=0.0, failure="too-few-pixels")
    first, second, third = walk()[:3]
    records = [first, replace(second, correction=correction), replace(third, correction=failed)]
    write_frames_csv(tmp_path / "frames.csv", records)
    rows = read_csv(tmp_path / "frames.csv")
    assert [row["correction_m"] for row in rows] == ["", "0.006000", "0.000000"]
    assert [row["corrected_position_x_m"] for row in rows] == ["", "0.006000", "0.006000"]
    assert [row["correction_failure"] for row in rows] == ["", "", "too-few-pixels"]
    assert summarize(settings(), records).poses == {
        "corrected": 1,
        "failed": 1,
        "median_moved_m": 0.006,
        "median_turned_rad": 0.004,
    }
    assert summarize(settings(), [first]).poses is None


def test_the_first_frame_has_no_share_and_is_captured(tmp_path: Path) -> None:
    write_frames_csv(tmp_path / "frames.csv", walk())
    rows = read_csv(tmp_path / "frames.csv")
    assert len(rows) == 150
    assert rows[0]["peaked_share"] == rows[0]["unseen_share"] == rows[0]["mean_error"] == ""
    assert rows[0]["captured"] == "true"
    assert [float(row["peaked_share"]) for row in rows[1:3]] == [0.0038, 0.0076]


def test_the_summary_by_hand() -> None:
    records = [
        path_record(0, stage_ms={"read": 5.0}),
        path_record(1, peaked_share=0.02, captured=False, stage_ms={"read": 1.0, "render": 8.0}),
        path_record(2, peaked_share=0.05, captured=True, stage_ms={"read": 2.0, "render": 10.0}),
    ]
    summary = summarize(settings(), records)
    assert summary.frames == 3
    assert summary.captured == 2
    assert summary.captured_indices == (0, 2)
    assert summary.mean_peaked_share == pytest.approx(0.035)
    assert summary.stage_ms == {"read": 2.0, "render": 9.0}


def test_the_summary_file_begins_with_version_and_configuration(tmp_path: Path) -> None:
    write_summary(tmp_path / "summary.json", summarize(settings(), walk()))
    document = json.loads((tmp_path / "summary.json").read_text())
    assert list(document) == [
        *("version", "preset", "options", "scene", "size_px", "fps", "threshold_share"),
        *("policy", "num_views"),
        *("frames", "captured", "captured_indices", "mean_peaked_share", "mean_wrong_share"),
        *("mean_unseen_share", "mean_unfixable_share", "stage_ms"),
    ]
    assert document["version"] == "9.8.7"
    assert document["options"] == {"views": 3, "error": {"kind": "<l1>", "threshold": 0.4}}
    assert document["captured_indices"] == list(range(0, 150, 12))
    assert document["stage_ms"] == {"read": 2.0, "render": 85.0}


def test_a_single_frame_has_no_mean_share(tmp_path: Path) -> None:
    write_summary(tmp_path / "summary.json", summarize(settings(), [path_record(0)]))
    assert json.loads((tmp_path / "summary.json").read_text())["mean_peaked_share"] is None


def test_options_that_json_has_not_become_text_or_lists(tmp_path: Path) -> None:
    options = {
        "far_m": float("inf"),
        "scene": Path("a/b"),
        "scale": np.float32(0.5),
        "weights": np.array([1.0, 2.0]),
        "size": (3, 4),
        "none": None,
    }
    write_summary(tmp_path / "summary.json", summarize(settings(options=options), walk()))
    assert json.loads((tmp_path / "summary.json").read_text())["options"] == {
        "far_m": "inf",
        "scene": "a/b",
        "scale": 0.5,
        "weights": [1.0, 2.0],
        "size": [3, 4],
        "none": None,
    }


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"peaked_share": 1.5}, "peaked_share"),
        ({"unseen_share": float("nan")}, "unseen_share"),
        ({"nearest_distance_m": -0.1}, "nearest_distance_m"),
        ({"mean_error": float("inf")}, "mean_error"),
        ({"position_m": np.array([0.0, np.nan, 0.0])}, "position_m"),
        ({"up": np.zeros(2)}, "up"),
        ({"index": -1}, "index"),
    ],
)
def test_a_record_refuses_what_cannot_be(changes: dict[str, object], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        path_record(**{"index": 1, **changes})  # type: ignore[arg-type]


def test_a_name_that_is_not_text_does_not_stop_the_table(tmp_path: Path) -> None:
    write_frames_csv(tmp_path / "frames.csv", [path_record(0, name="bad\udcff.jpg")])
    assert read_csv(tmp_path / "frames.csv")[0]["name"] == "bad?.jpg"
