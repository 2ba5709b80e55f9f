"""Depth maps as OpenEXR, TIFF and .npz; what is no depth map is named."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR  # pyright: ignore
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.datasets import open_recording
from peaking.datasets.depth_files import depth_size_px, is_floating, read_depth
from peaking.errors import RecordingError, ToolMissing
from peaking.pictures import exr, tiff
from recordings import write_recording

NOISE_M = np.random.default_rng(1).random((64, 64), np.float32) + 1
DEPTH_M = np.linspace(0.5, 3.0, 12 * 16).astype(np.float32).reshape(12, 16)


def write_exr(path: Path, channels: dict[str, np.ndarray], **more: Any) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **more}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))
    return path


def write_depth(path: Path, depth_m: np.ndarray) -> Path:
    """Write metres as a file of the kind that its ending says."""
    if path.suffix == ".exr":
        return write_exr(path, {"Z": depth_m})
    if path.suffix == ".npz":
        np.savez_compressed(path, depth=depth_m, other=np.zeros(3))
    else:
        assert cv2.imwrite(str(path), depth_m)
    return path


@pytest.mark.parametrize("ending", [".exr", ".tiff", ".npz"])
def test_floating_depth_is_what_was_written_and_unknown_where_it_is_nothing(
    ending: str, tmp_path: Path
) -> None:
    depth_m = DEPTH_M.copy()
    depth_m[0, :5] = [0.0, np.inf, np.nan, -1.0, 70000.0 if ending == ".exr" else 0.0]
    path = write_depth(tmp_path / f"d{ending}", depth_m)
    assert depth_size_px(path) == (16, 12)
    assert is_floating(path)
    read = read_depth(path, 2.0)
    assert read is not None
    assert (read[0, :5] == 0).all()
    np.testing.assert_array_equal(read.ravel()[5:], 2 * DEPTH_M.ravel()[5:])


@pytest.mark.parametrize("name", ["Y", "R", "depth", "ViewLayer.Depth.Z"])
def test_half_floats_of_any_usual_name(name: str, tmp_path: Path) -> None:
    half = DEPTH_M.astype(np.float16)
    half[0, 0] = 65504
    others = {} if name in ("Y", "R") else {"A": half, "G": half}
    read = read_depth(write_exr(tmp_path / "d.exr", {name: half, **others}), 1.0)
    assert read is not None
    assert read[0, 0] == 0
    np.testing.assert_array_equal(read.ravel()[1:], half.ravel()[1:].astype(np.float32))


def test_a_tiff_of_16_bits_is_in_units_like_a_png(tmp_path: Path) -> None:
    stored = np.arange(192, dtype=np.uint16).reshape(12, 16)
    stored[1, 1] = 65535
    path = write_depth(tmp_path / "d.tif", stored)
    assert not is_floating(path)
    read = read_depth(path, 0.001)
    assert read is not None
    assert (read[1, 1], read[0, 0]) == (0, 0)
    np.testing.assert_allclose(read[2:], 0.001 * stored[2:], rtol=1e-6)


@pytest.mark.parametrize("ending", [".exr", ".tiff", ".npz"])
def test_a_recording_has_such_depth(ending: str, tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=2)
    expected = open_recording(folder).read(1).depth_m
    top = json.loads((folder / "transforms.json").read_text())
    for frame in top["frames"]:
        path = folder / frame["depth_file_path"]
        depth_mm = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert depth_mm is not None
        frame["depth_file_path"] = str(Path(frame["depth_file_path"]).with_suffix(ending))
        write_depth(folder / frame["depth_file_path"], (depth_mm / 1000).astype(np.float32))
    top.pop("depth_unit_scale_factor", None)
    (folder / "transforms.json").write_text(json.dumps(top))
    with pytest.raises(RecordingError, match="depth_unit_scale_factor: is missing"):
        open_recording(folder)
    (folder / "transforms.json").write_text(json.dumps({**top, "depth_unit_scale_factor": 1}))
    recording = open_recording(folder)
    recording.check_subset([1])
    subset = recording.write_subset([1], tmp_path / "out")
    for frame in (recording.read(1), subset.read(0)):
        assert frame.depth_m is not None
        assert expected is not None
        np.testing.assert_allclose(frame.depth_m, expected, rtol=1e-6)
    assert not list((tmp_path / "out").rglob("*.exr")), "its metadata would be handed on"


def test_without_the_extra_the_command_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_depth(tmp_path / "d.exr", DEPTH_M)

    def nothing(name: str) -> None:
        """Find no package."""

    monkeypatch.setattr(importlib.util, "find_spec", nothing)
    with pytest.raises(ToolMissing, match=r"d\.exr.*pip install 'peaking\[exr\]'"):
        depth_size_px(path)


def written_wrong(folder: Path) -> dict[str, Path]:
    whole = np.zeros((4, 4), np.uint32)
    np.savez(folder / "a.npz", left=DEPTH_M, right=DEPTH_M)
    np.savez(folder / "b.npz", depth=np.zeros((2, 3, 4), np.float32))
    np.savez(folder / "c.npz", depth=np.array([{}], dtype=object))
    window = {"dataWindow": ((2, 2), (17, 13)), "displayWindow": ((0, 0), (31, 31))}
    cv2.imwrite(str(folder / "e.tiff"), np.zeros((4, 4, 3), np.uint16))
    cv2.imwrite(str(folder / "f.tiff"), np.zeros((4, 4), np.uint8))
    return {
        "none is called depth": folder / "a.npz",
        r"of shape \(2, 3, 4\)": folder / "b.npz",
        "object": folder / "c.npz",
        "none is called Z": write_exr(folder / "a.exr", {"A": DEPTH_M, "B": DEPTH_M}),
        "whole numbers": write_exr(folder / "b.exr", {"Z": whole}),
        "a part of its picture": write_exr(folder / "c.exr", {"Z": DEPTH_M}, **window),
        "TIFF of 16 bits and 3 channels": folder / "e.tiff",
        "TIFF of 8 bits": folder / "f.tiff",
    }


def test_what_is_no_depth_is_named(tmp_path: Path) -> None:
    for problem, path in written_wrong(tmp_path).items():
        for look in (depth_size_px, functools.partial(read_depth, unit_m=1.0)):
            with pytest.raises(RecordingError, match=problem) as caught:
                look(path)
            assert caught.value.path == path


@pytest.mark.parametrize("ending", [".exr", ".tiff", ".npz"])
def test_what_is_cut_off_is_named(ending: str, tmp_path: Path) -> None:
    path = write_depth(tmp_path / f"d{ending}", NOISE_M)
    whole = path.read_bytes()
    for share in (0.02, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(RecordingError, match=str(path)):
            read_depth(path, 1.0)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400), st.sampled_from([exr.START, *tiff.STARTS]))
def test_headers_of_any_bytes(data: bytes, start: bytes) -> None:
    with contextlib.suppress(ValueError):
        exr.exr_header(start + data).depth_channel()
    with contextlib.suppress(ValueError):
        tiff.tiff_header(start + data)
