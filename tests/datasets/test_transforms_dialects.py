"""Lenses and paths of transforms.json as other programs write them, and NeRFCapture's files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.datasets.transforms_paths import make_relative
from peaking.errors import RecordingError
from peaking.output import encode_png
from recordings import Room, lateral_cameras, write_recording

SEEN_STRAIGHT_TOLERANCE = 3.0
"""Levels, 99th percentile, of a bent picture of the room made straight; measured 2.0."""

FISHEYE = (0.08, -0.03, 0.01, -0.004)
RATIONAL = (-0.2, 0.05, 0.004, -0.003, 0.01, 0.1, 0.02, 0.005)


def edit(folder: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    top = json.loads((folder / "transforms.json").read_text())
    change(top)
    (folder / "transforms.json").write_text(json.dumps(top))
    return folder


def bent_rays(matrix: np.ndarray, px: np.ndarray, model: str) -> np.ndarray:
    """Return where, at z = 1, each pixel of a bent picture looks, by OpenCV's own code."""
    if model == "OPENCV_FISHEYE":
        return np.asarray(cv2.fisheye.undistortPoints(px, matrix, np.array(FISHEYE)))
    steps = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    found = cv2.undistortPoints(px, matrix, np.array(RATIONAL), None, None, None, steps)
    return np.asarray(found)


@pytest.mark.parametrize("model", ["OPENCV_FISHEYE", "FULL_OPENCV"])
@pytest.mark.parametrize("in_frame", [False, True])
def test_a_bent_picture_is_seen_straight(model: str, in_frame: bool, tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=2, width_px=128, height_px=96)
    camera = lateral_cameras(2, 128, 96)[1]
    px = camera.pinhole.pixel_centers().reshape(-1, 1, 2)
    flat = bent_rays(camera.pinhole.px_from_cam, px, model).reshape(96, 128, 2)
    rgb, depth_m = Room().seen(np.dstack([flat, np.ones((96, 128))]), camera.world_from_cam)
    (folder / "images/frame_00001.png").write_bytes(encode_png(rgb))
    depth_mm = np.round(1000 * depth_m).astype(np.uint16)
    (folder / "depths/frame_00001.png").write_bytes(encode_png(depth_mm))
    keys = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    bends = dict(zip(keys, RATIONAL, strict=True))
    if model == "OPENCV_FISHEYE":
        bends = dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True))
    lens: dict[str, Any] = {"camera_model": model} | bends
    edit(folder, lambda top: (top["frames"][1] if in_frame else top).update(lens))
    recording = open_recording(folder)
    frame, straight = recording.read(1), Room().photographed(camera)[0]
    assert frame.depth_m is not None
    same = np.abs(frame.depth_m - Room().photographed(camera)[1]) < 0.001
    assert same.mean() > 0.95
    away = np.abs(frame.rgb[same].astype(float) - straight[same])
    assert np.percentile(away, 99) < SEEN_STRAIGHT_TOLERANCE
    assert np.percentile(np.abs(rgb[same].astype(float) - straight[same]), 99) > 5, "it is bent"
    if in_frame:
        other = Room().photographed(lateral_cameras(2, 128, 96)[0])[0]
        assert np.array_equal(recording.read(0).rgb, other)


def test_instant_ngps_fisheye_is_opencvs(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=1)
    bends = dict(zip(("k1", "k2", "k3", "k4"), FISHEYE, strict=True))
    edit(folder, lambda top: top.update(camera_model="OPENCV_FISHEYE", **bends))
    expected = open_recording(folder).read(0).rgb
    edit(folder, lambda top: (top.pop("camera_model"), top.update(is_fisheye=True)))
    assert np.array_equal(open_recording(folder).read(0).rgb, expected)


WAYS: dict[str, Callable[[Path, str], str]] = {
    "backslashes": lambda root, name: name.replace("/", "\\"),
    "its own place": lambda root, name: f"{root}/{name}",
    "another machine's": lambda root, name: f"/home/somebody/captures/{name}",
    "Windows": lambda root, name: "D:\\captures\\garden\\" + name.replace("/", "\\"),
    "network": lambda root, name: "\\\\nas\\share\\" + name.replace("/", "\\"),
    "without an ending": lambda root, name: f"/home/somebody/{name.removesuffix('.png')}",
}


@pytest.mark.parametrize("way", WAYS)
def test_paths_of_other_machines_are_found_in_the_folder(way: str, tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=3)
    expected = open_recording(folder)
    keys = ("file_path",) if way == "without an ending" else ("file_path", "depth_file_path")

    def rename(top: dict[str, Any]) -> None:
        for frame in top["frames"]:
            for key in keys:
                frame[key] = WAYS[way](folder, frame[key])
        top["train_filenames"] = [top["frames"][1]["file_path"]]

    edit(folder, rename)
    recording = open_recording(folder, confined=True)
    for index in range(3):
        assert np.array_equal(recording.read(index).rgb, expected.read(index).rgb)
        assert recording.read(index).depth_m is not None
    subset = recording.write_subset([1], tmp_path / "out")
    assert np.array_equal(subset.read(0).rgb, expected.read(1).rgb)
    text = (tmp_path / "out/transforms.json").read_text()
    assert not any(word in text for word in ("somebody", "captures", str(tmp_path), "\\\\"))


def test_the_longest_end_is_taken_and_then_the_same_beginning_dropped(tmp_path: Path) -> None:
    for name in ("a/images/0.png", "images/0.png", "images/1.png", "0.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    frames = [{"file_path": f"/x/a/images/{i}.png", "name": "/x/a"} for i in range(2)]
    top: dict[str, Any] = {"frames": frames}
    make_relative(top, tmp_path)
    assert [frame["file_path"] for frame in frames] == ["a/images/0.png", "images/1.png"]
    assert frames[0]["name"] == "/x/a", "it is no path"
    more = [{"file_path": "/x/images/1.png"}, {"file_path": "/x/images/0.png"}]
    make_relative({"frames": more}, tmp_path)
    assert [frame["file_path"] for frame in more] == ["images/1.png", "images/0.png"]


def test_many_paths_that_lie_elsewhere_are_not_all_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[Path] = []
    monkeypatch.setattr(os.path, "isfile", looks.append)
    path = "/" + "/".join("abcdefghij" * 20) + ".png"
    frames = [{"file_path": path} for _ in range(1000)]
    make_relative({"frames": frames}, tmp_path)
    assert frames[-1]["file_path"] == path
    assert 0 < len(looks) < 10_000


@pytest.mark.parametrize(
    "text", ["/etc/passwd", "C:\\secret.png", "/x/../secret.png", "/x/images/", "\\\\a\\b", "/"]
)
def test_what_does_not_lie_in_the_folder_stays_refused(text: str, tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=2)
    (tmp_path / "secret.png").write_bytes(b"secret")
    edit(folder, lambda top: top["frames"][1].update(file_path=text))
    with pytest.raises(RecordingError, match="points outside") as caught:
        open_recording(folder)
    assert caught.value.field == "frames[1].file_path"


def test_an_absolute_path_is_no_way_around_links(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=2)
    (folder / "images/frame_00001.png").rename(tmp_path / "away.png")
    (folder / "images/frame_00001.png").symlink_to(tmp_path / "away.png")
    path = f"{folder}/images/frame_00001.png"
    edit(folder, lambda top: top["frames"][1].update(file_path=path))
    with pytest.raises(RecordingError, match="link that leaves"):
        open_recording(folder, confined=True)


def test_time_that_runs_backwards_is_said(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r")
    assert open_recording(folder).notes == ()
    edit(folder, lambda top: top["frames"][2].update(timestamp=-1.0))
    (note,) = open_recording(folder).notes
    assert note.startswith("time runs backwards at 1 place:")


def nerfcapture(folder: Path, *, unwritten: int) -> Path:
    """Turn a recording into what NeRFCapture writes (DatasetWriter.swift): names, and no depth."""

    def change(top: dict[str, Any]) -> None:
        top["depth_integer_scale"] = 1.0
        for number, frame in enumerate(top["frames"]):
            (folder / frame["file_path"]).rename(folder / f"images/{number}.png")
            frame["file_path"] = f"images/{number}"
            depth = folder / frame.pop("depth_file_path")
            depth.unlink()
            if number < unwritten:
                frame["depth_path"] = f"images/{number}.depth.png"

    return edit(folder, change)


def test_depth_that_nerfcapture_names_and_does_not_write_is_left_out(tmp_path: Path) -> None:
    recording = open_recording(nerfcapture(write_recording(tmp_path / "r"), unwritten=3))
    assert recording.notes == ("depth of 3 of 4 frames is named, and was never written",)
    assert recording.read(0).depth_m is None
    assert len(recording.write_subset([0, 3], tmp_path / "out")) == 2


def test_depth_of_others_has_to_be_there(tmp_path: Path) -> None:
    folder = nerfcapture(write_recording(tmp_path / "r"), unwritten=1)
    edit(folder, lambda top: top.update(integer_depth_scale=0.001))
    with pytest.raises(RecordingError, match=r"depth_path: there is no file"):
        open_recording(folder)
