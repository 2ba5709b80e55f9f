"""What a mask leaves out (`mask_path`) is in no MPI, no share and no training."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.cli import main
from peaking.datasets import open_recording
from peaking.errors import RecordingError
from peaking.frame import Frame, mask_resized
from peaking.options import PRESETS
from peaking.output import encode_png
from peaking.pipeline import Reconstruction
from peaking.splat.options import SplatOptions
from peaking.splat.rasterise import render
from peaking.splat.training import train
from recordings import Room, lateral_cameras, transforms_json, write_recording

OPTIONS = replace(PRESETS["default"], pixels=3072, num_planes=8)
SMALL = ["--no-video", "--pixels", "3072", "--num-planes", "8"]
PERSON = (slice(8, 40), slice(20, 34))
"""Somebody who stands before the camera, somewhere else in every frame."""


def with_person(folder: Path, *, masked: bool = True) -> Path:
    """Write a recording in which a pink person is before the camera, and masks of it."""
    cameras = lateral_cameras(6, 64, 48)
    write_recording(folder, cameras=cameras)
    (folder / "masks").mkdir()
    top = transforms_json(cameras)
    for i, camera in enumerate(cameras):
        rgb, depth_m = Room().photographed(camera)
        mask = np.full((48, 64), 255, np.uint8)
        if i > 0:
            rows, columns = PERSON
            where = rows, slice(columns.start + 3 * i, columns.stop + 3 * i)
            rgb[where], depth_m[where], mask[where] = (255, 0, 200), 0.6, 0
        (folder / f"images/frame_{i:05d}.png").write_bytes(encode_png(rgb))
        depth_mm = np.round(1000 * depth_m).astype(np.uint16)
        (folder / f"depths/frame_{i:05d}.png").write_bytes(encode_png(depth_mm))
        (folder / f"masks/{i}.png").write_bytes(encode_png(mask))
        if masked:
            top["frames"][i]["mask_path"] = f"masks/{i}.png"
    (folder / "transforms.json").write_text(json.dumps(top))
    return folder


def test_a_mask_at_another_size_leaves_out_all_that_it_touches() -> None:
    mask = np.ones((4, 8), np.bool_)
    mask[0, 0] = False
    np.testing.assert_array_equal(mask_resized(mask, 4, 2), [[0, 1, 1, 1], [1, 1, 1, 1]])
    larger = mask_resized(mask, 16, 8)
    assert not larger[:2, :2].any()
    assert larger.sum() == 16 * 8 - 4


def test_a_frame_has_its_mask_and_no_depth_beyond_it(tmp_path: Path) -> None:
    frame = open_recording(with_person(tmp_path / "r")).read(2)
    assert frame.mask is not None
    assert not frame.mask[8:40, 26:40].any()
    assert frame.mask.sum() == 48 * 64 - 32 * 14
    assert frame.depth_m is not None
    np.testing.assert_array_equal(frame.depth_m > 0, frame.mask)
    half = frame.resized(32, 24)
    assert half.mask is not None
    np.testing.assert_array_equal(half.mask, frame.mask[::2, ::2])


def test_an_mpi_has_nothing_of_what_is_left_out(tmp_path: Path) -> None:
    recording = open_recording(with_person(tmp_path / "r"))
    scene = Reconstruction(OPTIONS)
    frame = recording.read(2)
    mpi = scene.add_view(frame)
    assert frame.mask is not None
    alpha = mpi.dense()[..., 3].max(axis=0)
    assert not alpha[~frame.mask].any()
    assert (alpha[frame.mask] > 128).mean() > 0.95
    with pytest.raises(ValueError, match="mask"):
        mpi.masked(np.ones((2, 2), np.bool_))


def shares(folder: Path, out: Path) -> tuple[int, list[float]]:
    main(["replay", str(folder), "--out", str(out), *SMALL])
    with (out / "frames.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    return (
        sum(row["captured"] == "true" for row in rows),
        [float(row["peaked_share"]) for row in rows if row["peaked_share"]],
    )


def test_what_is_left_out_is_not_red(tmp_path: Path) -> None:
    captured, with_masks = shares(with_person(tmp_path / "r"), tmp_path / "out")
    _, without = shares(with_person(tmp_path / "n", masked=False), tmp_path / "none")
    assert captured >= 1
    assert with_masks[0] < 0.25 * without[0]
    assert open_recording(tmp_path / "out/captured").read(0).mask is not None


def test_shares_are_of_what_counts() -> None:
    recording_camera = lateral_cameras(1, 64, 48)[0]
    rgb, depth_m = Room().photographed(recording_camera)

    scene = Reconstruction(OPTIONS)
    scene.add_view(Frame("a", rgb, recording_camera, depth_m))
    live = rgb.copy()
    live[:24] = 255 - live[:24]
    errors = scene.compare(live, recording_camera).errors
    upper = np.zeros((48, 64), np.bool_)
    upper[:24] = True
    assert errors.within(None) is errors
    for mask in (upper, ~upper):
        within = errors.within(mask)
        assert within.peaked_share == errors.peaked[mask].mean()
        assert within.mean_error == pytest.approx(errors.error[mask].mean(), rel=1e-5)
    assert errors.within(np.zeros_like(upper)).peaked_share == 0.0


def too_pink(folder: Path) -> float:
    """Train on all other frames; return how much pinker than the first that nobody is in it got."""
    recording = open_recording(folder)
    frames = [recording.read(i) for i in range(1, 6)]
    options = SplatOptions(iterations=60, max_init_points=1500)
    rendered = render(train(frames, options), recording.cameras[0]).rgb

    def pinkness(rgb: np.ndarray) -> np.ndarray:
        return np.clip(np.minimum(rgb[..., 0], rgb[..., 2]) - rgb[..., 1], 0, 1)

    photo = recording.read(0).rgb / 255.0
    return float(np.clip(pinkness(rendered) - pinkness(photo), 0, 1).mean())


def test_splats_learn_nothing_of_what_is_left_out(tmp_path: Path) -> None:
    masked = too_pink(with_person(tmp_path / "r"))
    assert masked < 0.4 * too_pink(with_person(tmp_path / "n", masked=False))


def test_a_mask_of_another_aspect_is_refused_at_once(tmp_path: Path) -> None:
    folder = with_person(tmp_path / "r")
    (folder / "masks/2.png").write_bytes(encode_png(np.ones((48, 48), np.uint8)))
    with pytest.raises(RecordingError, match="48x48, not of the aspect"):
        open_recording(folder)
