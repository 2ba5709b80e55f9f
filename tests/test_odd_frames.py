"""A frame that is unlike the others costs itself at most: replay, splats and servers go on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from peaking.cli import main
from peaking.datasets import open_recording
from peaking.output import SATURATED_MM, depth_mm, encode_png
from peaking.selection.registry import POLICIES
from peaking.server.recordings import PlayedRecording
from recordings import lateral_cameras, write_recording

SMALL = ["--no-video", "--pixels", "3072", "--num-planes", "8"]
UNKNOWN = 2
"""The frame that has a depth map in which nothing is known."""


@pytest.fixture(scope="module")
def gap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gap") / "walk"
    write_recording(folder, cameras=lateral_cameras(6, 48, 64))
    unknown = encode_png(np.zeros((64, 48), np.uint16))
    (folder / f"depths/frame_{UNKNOWN:05d}.png").write_bytes(unknown)
    return folder


@pytest.mark.parametrize("policy", sorted(POLICIES))
def test_a_replay_goes_on_after_a_frame_without_any_depth(
    gap: Path, tmp_path: Path, policy: str
) -> None:
    asked = [] if policy in ("all", "threshold") else ["--views", "5"]
    main(["replay", str(gap), "--out", str(tmp_path / "o"), "--policy", policy, *asked, *SMALL])
    summary = json.loads((tmp_path / "o/summary.json").read_text())
    assert summary["frames"] == 6
    assert UNKNOWN not in summary["captured_indices"]
    if asked or policy == "all":
        assert summary["captured_indices"] == [0, 1, 3, 4, 5]


def test_splats_are_trained_with_a_frame_without_any_depth(
    gap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    quick = ["--iterations", "20", "--pixels", "3072", "--backend", "numba", "--previews", "0"]
    main(["splat", str(gap), "--out", str(tmp_path / "a.ply"), *quick])
    assert "Gaussians" in capsys.readouterr().out


def test_a_recording_plays_over_a_frame_without_any_depth(gap: Path) -> None:
    """The index says that there is a map: a client that got none would ask for ever."""
    played = PlayedRecording("gap", open_recording(gap))
    layout = played.index.frames[UNKNOWN].depth
    assert layout is not None
    assert played.depth(UNKNOWN) == bytes(2 * layout.width_px * layout.height_px)


def test_what_is_too_far_for_16_bits_is_unknown() -> None:
    metres = np.array([[0.0, 0.0004, 0.0006, 65.534, 65.535, 65.536, 1e9, np.inf, np.nan, -1.0]])
    np.testing.assert_array_equal(depth_mm(metres), [[0, 0, 1, 65534, 0, 0, 0, 0, 0, 0]])
    assert SATURATED_MM == 65535


def test_a_recording_plays_what_is_too_far_as_unknown(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "far")
    far = np.full((48, 64), 3000, np.uint16)
    far[0, :2] = [40000, 60000]
    (folder / "depths/frame_00000.png").write_bytes(encode_png(far))
    top = json.loads((folder / "transforms.json").read_text())
    (folder / "transforms.json").write_text(json.dumps(top | {"depth_unit_scale_factor": 0.0015}))
    sent = PlayedRecording("far", open_recording(folder)).depth(0)
    assert sent is not None
    assert np.frombuffer(sent, "<u2")[:3].tolist() == [60000, 0, 4500]
