"""Data sets in several files: transforms_train.json, transforms_val.json, transforms_test.json."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import RecordingError
from recordings import write_recording


def split(root: Path) -> Path:
    """Put the frames of a recording into three files, each with the fields of all."""
    top = json.loads((root / "transforms.json").read_text())
    (root / "transforms.json").unlink()
    for name, frames in (("train", [0, 2]), ("val", [1]), ("test", [3])):
        some = {**top, "frames": [top["frames"][i] for i in frames]}
        (root / f"transforms_{name}.json").write_text(json.dumps(some))
    return root


def test_several_files_are_one_recording(tmp_path: Path) -> None:
    whole = open_recording(write_recording(tmp_path / "whole"))
    parts = open_recording(split(write_recording(tmp_path / "parts")))
    assert len(parts) == 4
    for place, index in enumerate((0, 2, 1, 3)):
        assert np.array_equal(parts.read(place).rgb, whole.read(index).rgb)
        assert parts.cameras[place].pinhole == whole.cameras[index].pinhole
        assert parts.timestamps_s[place] == whole.timestamps_s[index]
    assert all(parts.has_depth)
    subset = parts.write_subset([3, 0], tmp_path / "out")
    assert subset.path.name == "transforms.json"
    assert np.array_equal(subset.read(0).rgb, whole.read(3).rgb)


def test_a_change_of_any_file_changes_the_fingerprint(tmp_path: Path) -> None:
    root = split(write_recording(tmp_path / "parts"))
    before = open_recording(root).fingerprint()
    path = root / "transforms_test.json"
    top = json.loads(path.read_text())
    top["frames"][0]["transform_matrix"][0][3] += 0.01
    path.write_text(json.dumps(top))
    assert open_recording(root).fingerprint() != before


def test_nerfs_synthetic_scenes(tmp_path: Path) -> None:
    root = write_recording(tmp_path / "lego", with_depth=False)
    frames = json.loads((root / "transforms.json").read_text())["frames"]
    (root / "transforms.json").unlink()
    for name, some in (("train", frames[:3]), ("test", frames[3:])):
        (root / name).mkdir()
        listed: list[object] = []
        for i, frame in enumerate(some):
            (root / frame["file_path"]).rename(root / name / f"r_{i}.png")
            matrix = frame["transform_matrix"]
            listed.append(
                {"file_path": f"./{name}/r_{i}", "rotation": 0.01} | {"transform_matrix": matrix}
            )
        top = {"camera_angle_x": 2 * math.atan(32 / 60), "frames": listed}
        (root / f"transforms_{name}.json").write_text(json.dumps(top))
    recording = open_recording(root)
    assert len(set(recording.names)) == 4
    assert recording.cameras[3].pinhole.fx_px == pytest.approx(60.0)
    assert recording.read(3).rgb.shape == (48, 64, 3)


@pytest.mark.parametrize("text", ["[1]", "{}", '{"frames": [3]}', '{"frames": []}', "{"])
def test_a_broken_file_is_named(text: str, tmp_path: Path) -> None:
    root = split(write_recording(tmp_path / "parts"))
    (root / "transforms_val.json").write_text(text)
    with pytest.raises(RecordingError, match=r"transforms_val\.json"):
        open_recording(root)
