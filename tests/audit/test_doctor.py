"""`peaking doctor`: planted faults are found, and sound pictures are left alone."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from peaking.audit.examination import Examination, examine
from peaking.benchmarks.planted_faults import FOUND_AS, SINGLE, SpoiltRecording
from peaking.cli import main
from peaking.datasets import open_recording

DESK = Path(__file__).parent.parent.parent / "scenes/desk"
FRAMES = range(0, 138, 3)
PLANTED = dict(zip((3, 7, 11, 15, 19, 23, 27, 31, 35), SINGLE, strict=True)) | {41: "swapped"}
"""By place: one of each, and the other one of the two that are swapped."""


@pytest.fixture(scope="module")
def spoilt() -> Examination:
    recording = SpoiltRecording(open_recording(DESK), FRAMES, PLANTED, seed=3)
    return examine(recording)  # type: ignore[arg-type]


@pytest.mark.parametrize(("place", "fault"), PLANTED.items())
def test_each_fault_is_found_as_what_it_is(spoilt: Examination, place: int, fault: str) -> None:
    assert {finding.kind for finding in spoilt.of(place)} & set(FOUND_AS[fault])


def test_no_other_picture_is_called_wrong(spoilt: Examination) -> None:
    twin_of = 35 - 1  # of two that show the same, the later one is named
    others = set(range(len(FRAMES))) - set(PLANTED) - {twin_of}
    assert [finding for finding in spoilt.findings if finding.frame in others] == []


@pytest.mark.parametrize("with_depth", [True, False])
def test_a_sound_recording_has_nothing_wrong(with_depth: bool) -> None:
    recording = SpoiltRecording(open_recording(DESK), FRAMES[:20], {}, seed=0)
    if not with_depth:
        recording.has_depth = [False] * 20
    found = examine(recording)  # type: ignore[arg-type]
    assert list(found.findings) == []
    assert found.whole is None
    assert bool(found.not_checked) != with_depth


@pytest.mark.parametrize(
    ("fault", "says"), [("intrinsics", "0.91 times"), ("axes", "mirrored (left-handed)")]
)
def test_faults_of_all_pictures_are_named_once(fault: str, says: str) -> None:
    recording = SpoiltRecording(open_recording(DESK), FRAMES[:24], {}, 0, fault)
    found = examine(recording)  # type: ignore[arg-type]
    assert found.whole is not None
    assert found.whole.kind == fault
    assert says in found.whole.words
    assert found.whole.mended_px < 0.3
    assert not any(finding.kind in ("pose", "swapped") for finding in found.findings)


def test_the_command_writes_a_page_a_table_and_a_list(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = open_recording(DESK).write_subset(range(0, 48, 3), tmp_path / "desk")
    picture = tmp_path / "desk" / f"images/{recording.names[5]}.jpg"
    picture.write_bytes((tmp_path / "desk" / f"images/{recording.names[12]}.jpg").read_bytes())
    out, found = str(tmp_path / "out"), str(tmp_path / "found.json")
    main(["doctor", str(tmp_path / "desk"), "--out", out, "--json", found])
    printed = capsys.readouterr().out
    assert recording.names[5] in printed
    assert "pictures have something to look at" in printed
    rows = list(csv.DictReader((tmp_path / "out/doctor.csv").read_text().splitlines()))
    assert [row["finding"] for row in rows if row["name"] == recording.names[5]] == ["pose"]
    assert "data:image/jpeg" in (tmp_path / "out/report.html").read_text()
    findings = json.loads((tmp_path / "found.json").read_text())["findings"]
    assert findings[0]["name"] == recording.names[5]
