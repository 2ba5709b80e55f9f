from __future__ import annotations

import contextlib
import json
import math
import os
import pickle
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking import limits
from peaking.datasets import transforms_json
from peaking.datasets.nerfstudio import NerfstudioRecording, open_recording
from peaking.datasets.point_cloud import encode_points
from peaking.errors import OutputError, RecordingError
from peaking.geometry import Pinhole
from peaking.output import encode_jpeg, encode_png
from recordings import Room, lateral_cameras, write_recording

POSE_TOLERANCE = 1e-12
"""Metres and entries of rotations, through JSON and axes and back; measured 4e-18."""

DEPTH_TOLERANCE_M = 0.00051
"""Half a millimetre of the file and float32; measured 0.0005."""

STRAIGHT_TOLERANCE = 0.7
"""Levels of a ramp of 7 levels per pixel; measured 0.50, the rounding to 8 bits. OpenCV 4 samples
at 1/32 pixel, 0.11 more. Half a pixel of error in the centre makes 1.74."""

SEEN_STRAIGHT_TOLERANCE = 3.0
"""Levels, 99th percentile, of a distorted picture of the room made straight; measured 2.0, and 4.0
with half a pixel of error in the centre."""

DESK = Path(__file__).parent.parent / "scenes/desk"

Edit = Callable[[dict[str, Any]], object]


def edit_json(folder: Path, edit: Edit) -> None:
    path = folder / "transforms.json"
    top = json.loads(path.read_text())
    edit(top)
    path.write_text(json.dumps(top))


def complaint(act: Callable[[], object]) -> RecordingError:
    with pytest.raises(RecordingError) as caught:
        act()
    error = caught.value
    assert str(error).startswith(str(error.path))
    assert len(str(error).splitlines()) == 1
    assert str(error).endswith(error.remedy)
    return error


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "recording")


# --- worked by hand ------------------------------------------------------------------------------


def test_a_recording_comes_back_as_it_was_taken(folder: Path) -> None:
    recording = open_recording(folder)
    assert len(recording) == 4
    assert recording.names == ("frame_00000", "frame_00001", "frame_00002", "frame_00003")
    assert recording.timestamps_s == (0.0, 1 / 30, 2 / 30, 3 / 30)
    for i, camera in enumerate(lateral_cameras(4, 64, 48)):
        rgb, depth_m = Room().photographed(camera)
        frame = recording.read(i)
        assert frame.camera is recording.cameras[i]
        assert frame.camera.pinhole == camera.pinhole
        np.testing.assert_allclose(
            frame.camera.world_from_cam.matrix(),
            camera.world_from_cam.matrix(),
            atol=POSE_TOLERANCE,
        )
        np.testing.assert_array_equal(frame.rgb, rgb)
        assert frame.depth_m is not None
        np.testing.assert_allclose(frame.depth_m, depth_m, atol=DEPTH_TOLERANCE_M)


def test_opengl_axes_are_turned(folder: Path) -> None:
    # x right, y up, z back; the camera looks along the world's -y, its top towards the world's z.
    matrix = [[1, 0, 0, 5], [0, 0, -1, 6], [0, 1, 0, 7], [0, 0, 0, 1]]
    edit_json(folder, lambda top: top["frames"][0].update(transform_matrix=matrix))
    camera = open_recording(folder).cameras[0]
    np.testing.assert_array_equal(camera.position_m, [5, 6, 7])
    np.testing.assert_allclose(camera.forward, [0, 1, 0], atol=POSE_TOLERANCE)
    np.testing.assert_allclose(camera.world_from_cam.rotation[:, 1], [0, 0, -1], atol=1e-12)


def test_a_straight_picture_is_sampled_where_the_lens_put_it(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=1, width_px=32, height_px=24)
    ramp = np.zeros((24, 32, 3), dtype=np.uint8)
    ramp[..., 0] = 7 * np.arange(32)
    ramp[..., 1] = 7 * np.arange(24)[:, None]
    (folder / "images/frame_00000.png").write_bytes(encode_png(ramp))
    lens = {"fl_x": 40.0, "fl_y": 44.0, "cx": 15.0, "cy": 13.0}
    bends = {"k1": -0.6, "k2": 0.2, "p1": 0.03, "p2": -0.02, "k3": 0.1}
    edit_json(folder, lambda top: top.update(camera_model="OPENCV", **lens, **bends))
    frame = open_recording(folder).read(0)
    # OpenCV's formula, written out, in corner-origin pixels.
    columns, rows = np.meshgrid(np.arange(32), np.arange(24))
    x, y = (columns + 0.5 - 15.0) / 40.0, (rows + 0.5 - 13.0) / 44.0
    r2 = x * x + y * y
    radial = 1 - 0.6 * r2 + 0.2 * r2**2 + 0.1 * r2**3
    x_bent = x * radial + 2 * 0.03 * x * y - 0.02 * (r2 + 2 * x * x)
    y_bent = y * radial + 0.03 * (r2 + 2 * y * y) - 2 * 0.02 * x * y
    bent_columns, bent_rows = 40.0 * x_bent + 15.0 - 0.5, 44.0 * y_bent + 13.0 - 0.5
    inside = (bent_columns >= 0) & (bent_columns <= 31) & (bent_rows >= 0) & (bent_rows <= 23)
    assert inside.mean() > 0.9
    expected = np.dstack([7 * bent_columns, 7 * bent_rows, 0 * rows])[inside]
    np.testing.assert_allclose(frame.rgb[inside].astype(float), expected, atol=STRAIGHT_TOLERANCE)


def test_the_pinhole_sees_what_the_bent_lens_saw(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=1, width_px=128, height_px=96)
    camera = lateral_cameras(1, 128, 96)[0]
    k, bends = camera.pinhole, (-0.2, 0.05, 0.004, -0.003)
    matrix = k.px_from_cam
    bent_px = k.pixel_centers().reshape(-1, 1, 2)
    steps = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    rays = cv2.undistortPoints(bent_px, matrix, np.array(bends), None, None, None, steps)
    rays = np.dstack([np.asarray(rays).reshape(96, 128, 2), np.ones((96, 128))])
    rgb, depth_m = Room().seen(rays, camera.world_from_cam)
    (folder / "images/frame_00000.png").write_bytes(encode_png(rgb))
    depth_mm = np.round(1000 * depth_m).astype(np.uint16)
    (folder / "depths/frame_00000.png").write_bytes(encode_png(depth_mm))
    lens = dict(zip(("k1", "k2", "p1", "p2"), bends, strict=True))
    edit_json(folder, lambda top: top.update(camera_model="OPENCV", **lens))
    frame = open_recording(folder).read(0)
    straight, straight_m = Room().photographed(camera)
    assert frame.depth_m is not None
    same = np.abs(frame.depth_m - straight_m) < DEPTH_TOLERANCE_M
    assert same.mean() > 0.97, "only the outline of the box may be a pixel off"
    away = np.abs(frame.rgb[same].astype(float) - straight[same])
    assert np.percentile(away, 99) < SEEN_STRAIGHT_TOLERANCE


@pytest.mark.parametrize("width_px", [16, 128])
def test_pictures_at_another_size_scale_the_intrinsics(folder: Path, width_px: int) -> None:
    for path in (folder / "images").iterdir():
        picture = np.zeros((width_px * 3 // 4, width_px, 3), dtype=np.uint8)
        path.write_bytes(encode_png(picture))
    by = width_px / 64
    expected = Pinhole(width_px, width_px * 3 // 4, 57.6 * by, 57.6 * by, 33.25 * by, 23.5 * by)
    recording = open_recording(folder)
    assert recording.cameras[0].pinhole == expected
    assert recording.read(0).rgb.shape == (width_px * 3 // 4, width_px, 3)


def test_intrinsics_may_stand_in_the_frame(folder: Path) -> None:
    edit_json(folder, lambda top: top["frames"][1].update(fl_x=99.0))
    cameras = open_recording(folder).cameras
    assert [camera.pinhole.fx_px for camera in cameras] == [57.6, 99.0, 57.6, 57.6]


def test_blenders_dialect(folder: Path) -> None:
    def blender(top: dict[str, Any]) -> None:
        for key in ("camera_model", "fl_x", "fl_y", "cx", "cy", "w", "h"):
            del top[key]
        top["camera_angle_x"] = math.pi / 2
        for frame in top["frames"]:
            frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")

    edit_json(folder, blender)
    recording = open_recording(folder)
    assert recording.names[0] == "frame_00000"
    k = recording.cameras[0].pinhole
    assert (k.width_px, k.height_px, k.cx_px, k.cy_px) == (64, 48, 32.0, 24.0)
    assert (k.fx_px, k.fy_px) == (pytest.approx(32.0), pytest.approx(32.0))


def test_instant_ngps_depth(folder: Path) -> None:
    def ngp(top: dict[str, Any]) -> None:
        top["integer_depth_scale"] = 0.0005
        for frame in top["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")

    whole = open_recording(folder).read(0).depth_m
    edit_json(folder, ngp)
    half = open_recording(folder).read(0).depth_m
    assert whole is not None
    assert half is not None
    np.testing.assert_allclose(2 * half, whole, rtol=1e-6)
    edit_json(folder, lambda top: top.pop("integer_depth_scale"))
    error = complaint(lambda: open_recording(folder))
    assert (error.field, "is missing" in str(error)) == ("frames[0].integer_depth_scale", True)


def test_nerfcaptures_key_is_named(folder: Path) -> None:
    def capture(top: dict[str, Any]) -> None:
        top["depth_integer_scale"] = 1.0
        for frame in top["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")

    edit_json(folder, capture)
    error = complaint(lambda: open_recording(folder))
    assert error.field == "depth_integer_scale"
    assert "integer_depth_scale, 0.001" in error.remedy
    edit_json(folder, at_top(integer_depth_scale=0.001))
    assert open_recording(folder).read(0).depth_m is not None


@pytest.mark.parametrize("kind", ["float16", "float32", "float64"])
def test_floating_point_depth_has_no_unit_by_default(folder: Path, kind: str) -> None:
    np.save(folder / "depths/a.npy", np.full((48, 64), 1.5, kind))
    edit_json(folder, frame(depth_file_path="depths/a.npy"))
    error = complaint(lambda: open_recording(folder))
    assert error.field == "frames[3].depth_unit_scale_factor"
    assert "1 for metres" in error.remedy
    edit_json(folder, at_top(depth_unit_scale_factor=1))
    np.testing.assert_array_equal(np.asarray(open_recording(folder).read(3).depth_m), 1.5)


@pytest.mark.parametrize("times", [1, 5, 0.1])
def test_whole_numbers_are_millimetres_unless_pictures_and_poses_say_otherwise(
    tmp_path: Path, times: float
) -> None:
    """5000 in a metre, as TUM's data sets have it; 10 mm."""
    indices = range(0, 40, 8)
    folder = open_recording(DESK).write_subset(indices, tmp_path / "desk").root
    for path in (folder / "depths").iterdir():
        mm = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        path.write_bytes(encode_png(np.round(times * np.asarray(mm)).astype(np.uint16)))
    edit_json(folder, without("depth_unit_scale_factor"))
    if times == 1:
        assert len(open_recording(folder)) == 5
        return
    error = complaint(lambda: open_recording(folder))
    assert error.field == "depth_unit_scale_factor"
    assert f"perhaps {0.001 / times:.1g}"[:-1] in error.remedy
    edit_json(folder, at_top(depth_unit_scale_factor=0.001 / times))
    assert len(open_recording(folder)) == 5


def test_depth_at_another_size_and_as_array(folder: Path) -> None:
    depth_mm = np.array([[0, 1500, np.nan, np.inf], [-1, 2000, 2500, 0], [1, 1, 1, 1]])
    np.save(folder / "depths/small.npy", depth_mm)
    fields = {"depth_file_path": "depths/small.npy", "depth_unit_scale_factor": 0.001}
    edit_json(folder, lambda top: top["frames"][0].update(fields))
    depth_m = open_recording(folder).read(0).depth_m
    expected = [[0, 1.5, 0, 0], [0, 2, 2.5, 0], [0.001] * 4]
    np.testing.assert_allclose(np.asarray(depth_m), expected, rtol=1e-6)


def test_depth_may_be_missing_and_in_other_units(folder: Path) -> None:
    whole_m = open_recording(folder).read(1).depth_m
    assert whole_m is not None
    edit_json(folder, lambda top: top["frames"][0].pop("depth_file_path"))
    edit_json(folder, lambda top: top.update(depth_unit_scale_factor=0.002))
    recording = open_recording(folder)
    assert recording.read(0).depth_m is None
    np.testing.assert_allclose(np.asarray(recording.read(1).depth_m), 2 * whole_m, rtol=1e-6)


@pytest.mark.parametrize("value", [0, 65535])
def test_a_depth_map_without_any_depth_is_none(folder: Path, value: int) -> None:
    unknown = np.full((48, 64), value, np.uint16)
    (folder / "depths/frame_00002.png").write_bytes(encode_png(unknown))
    recording = read_all(folder)
    assert recording.read(2).depth_m is None
    assert recording.has_depth == (True, True, False, True)
    assert recording.depth_size_px(2) == (64, 48)


@pytest.mark.parametrize(
    ("kind", "unknown"),
    [
        ("uint16", [0, 65535]),
        ("int16", [0, -1, -32768, 32767]),
        ("uint8", [0, 255]),
        ("int32", [0, -1, 2**31 - 1]),
        ("float16", [0, np.nan, np.inf, 65504]),
        ("float32", [0, -1, np.nan, np.inf, -np.inf, 3.4028235e38]),
        ("float64", [0, np.nan, 1e300]),
    ],
)
def test_what_stands_for_no_depth(folder: Path, kind: str, unknown: list[float]) -> None:
    depth = np.full((12, 16), 7, kind)
    depth[0, : len(unknown)] = unknown
    np.save(folder / "depths/a.npy", depth)
    fields = {"depth_file_path": "depths/a.npy", "depth_unit_scale_factor": 2.0}
    edit_json(folder, lambda top: top["frames"][0].update(fields))
    depth_m = np.asarray(open_recording(folder).read(0).depth_m)
    assert not depth_m[0, : len(unknown)].any()
    assert (depth_m == 14.0).sum() == 12 * 16 - len(unknown)


def test_an_applied_scale_is_taken_back(folder: Path) -> None:
    metres = open_recording(folder).cameras
    edit_json(folder, lambda top: top.update(applied_scale=0.5))
    for got, meant in zip(open_recording(folder).cameras, metres, strict=True):
        np.testing.assert_allclose(got.position_m, 2 * meant.position_m)
        np.testing.assert_array_equal(got.world_from_cam.rotation, meant.world_from_cam.rotation)


def test_names_are_unique_where_stems_are_not(folder: Path) -> None:
    (folder / "more").mkdir()
    os.replace(folder / "images/frame_00001.png", folder / "more/frame_00000.png")  # noqa: PTH105
    edit_json(folder, lambda top: top["frames"][1].update(file_path="more/frame_00000.png"))
    names = open_recording(folder).names
    assert names[:2] == ("00000_frame_00000", "00001_frame_00000")


@pytest.mark.parametrize("ending", [".jpg", ".png", ".webp", "grey.jpg", "grey.png", "16.png"])
def test_kinds_of_pictures(folder: Path, ending: str) -> None:
    level = np.full((48, 64, 3), 200, dtype=np.uint8)
    level[:, :32] = 60
    stored = level[..., 0] if "grey" in ending else level
    stored = stored.astype(np.uint16) * 257 if "16" in ending else stored
    done, data = cv2.imencode("." + ending.split(".")[-1], stored)
    assert done
    (folder / f"images/a{ending}").write_bytes(data.tobytes())
    edit_json(folder, lambda top: top["frames"][0].update(file_path=f"images/a{ending}"))
    rgb = open_recording(folder).read(0).rgb
    np.testing.assert_allclose(rgb.astype(float), level, atol=2.0)


def test_transparent_becomes_white(folder: Path) -> None:
    rgba = np.full((48, 64, 4), 100, dtype=np.uint8)
    rgba[0, :3, 3] = [0, 255, 51]
    (folder / "images/frame_00000.png").write_bytes(cv2.imencode(".png", rgba)[1].tobytes())
    rgb = open_recording(folder).read(0).rgb
    assert rgb[0, :3, 0].tolist() == [255, 100, 224]  # 0.2 * 100 + 0.8 * 255


# --- subsets -------------------------------------------------------------------------------------


def test_a_subset_opens_again_and_is_the_same(folder: Path, tmp_path: Path) -> None:
    (folder / "cloud.ply").write_bytes(encode_points(np.eye(3)))
    (folder / "masks").mkdir()
    (folder / "masks/2.png").write_bytes(encode_png(np.eye(48, 64, dtype=np.uint8)))
    names = [f"images/frame_{i:05d}.png" for i in range(4)]

    def more(top: dict[str, Any]) -> None:
        top.update(ply_file_path="cloud.ply", mine={"a": [1]}, train_filenames=names[:3])
        top["frames"][2].update(mask_path="masks/2.png", sharpness=3.5)

    edit_json(folder, more)
    recording = open_recording(folder)
    out = tmp_path / "made" / "subset"
    subset = recording.write_subset([2, 0], out)
    assert subset.root == out
    assert subset.names == open_recording(out).names == ("frame_00002", "frame_00000")
    for got, index in enumerate([2, 0]):
        mine, theirs = subset.read(got), recording.read(index)
        np.testing.assert_array_equal(mine.rgb, theirs.rgb)
        np.testing.assert_array_equal(np.asarray(mine.depth_m), np.asarray(theirs.depth_m))
        assert mine.timestamp_s == theirs.timestamp_s
    written = sorted(str(p.relative_to(out)) for p in out.rglob("*") if p.is_file())
    assert written == [
        "cloud.ply",
        "depths/frame_00000.png",
        "depths/frame_00002.png",
        "images/frame_00000.png",
        "images/frame_00002.png",
        "masks/2.png",
        "transforms.json",
    ]
    for name in written[:-1]:
        assert (out / name).read_bytes() == (folder / name).read_bytes()
    top, source = (json.loads((p / "transforms.json").read_text()) for p in (out, folder))
    assert [frame["source_index"] for frame in top["frames"]] == [2, 0]
    assert top["frames"][0] == {**source["frames"][2], "source_index": 2}
    assert top["train_filenames"] == [names[0], names[2]]
    assert top["mine"] == {"a": [1]}


def test_a_subset_keeps_the_lens_and_endings_as_they_are(folder: Path, tmp_path: Path) -> None:
    edit_json(folder, lambda top: top.update(camera_model="OPENCV", k1=0.1, applied_scale=2.0))
    edit_json(folder, lambda top: top["frames"][0].update(file_path="images/frame_00000"))
    recording = open_recording(folder)
    subset = recording.write_subset([0], tmp_path / "out")
    assert subset.cameras[0].pinhole == recording.cameras[0].pinhole
    np.testing.assert_array_equal(subset.read(0).rgb, recording.read(0).rgb)


ASIDES = ["mask_path", "ply_file_path", "exact_depth_file_path", "materials_file_path"]


@pytest.mark.parametrize("key", ASIDES)
@pytest.mark.parametrize("at_top", [False, True])
def test_what_is_beside_the_pictures_is_looked_for_at_once(
    folder: Path, key: str, at_top: bool
) -> None:
    """Also where nothing needs it yet: all frames have depth."""
    edit_json(folder, lambda top: (top if at_top else top["frames"][2]).update({key: "no.png"}))
    error = complaint(lambda: open_recording(folder))
    assert error.field == (key if at_top else f"frames[2].{key}")
    assert "no file" in str(error)


def test_a_cut_off_cloud_is_found_at_once(folder: Path) -> None:
    (folder / "cloud.ply").write_bytes(encode_points(np.eye(3))[:-1])
    edit_json(folder, at_top(ply_file_path="cloud.ply"))
    edit_json(folder, lambda top: top["frames"][3].pop("depth_file_path"))
    assert "cut off" in str(complaint(lambda: open_recording(folder)))


def test_what_a_subset_needs_is_copied(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r")
    labels = encode_png(np.zeros((48, 64), np.uint8))
    for key in ASIDES[2:]:
        (folder / f"{key}.png").write_bytes(labels)
        edit_json(folder, lambda top, key=key: top["frames"][1].update({key: f"{key}.png"}))
    subset = open_recording(folder).write_subset([1, 2], tmp_path / "out")
    assert subset.materials(0) is not None
    assert subset.true_depth_m(0) is not None
    assert subset.materials(1) is None


def test_a_subset_that_cannot_be_written_is_refused_beforehand(
    folder: Path, tmp_path: Path
) -> None:
    tiff = cv2.imencode(".tiff", np.zeros((48, 64, 3), np.uint8))[1].tobytes()
    (folder / "images/frame_00002.png").write_bytes(tiff)
    recording = open_recording(folder)
    for act in (
        lambda: recording.check_subset(range(4)),
        lambda: recording.write_subset([2], tmp_path / "out"),
    ):
        assert "--keep-exif" in complaint(act).remedy
    recording.check_subset([0, 1, 3])
    recording.check_subset(range(4), keep_exif=True)
    recording.write_subset([2], tmp_path / "out", keep_exif=True)


@pytest.mark.parametrize("indices", [[], [0, 0], [4], [-1]])
def test_wrong_indices(folder: Path, tmp_path: Path, indices: list[int]) -> None:
    with pytest.raises(ValueError, match="need"):
        open_recording(folder).write_subset(indices, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_subset_is_complete_or_absent(folder: Path, tmp_path: Path) -> None:
    recording = open_recording(folder)
    (folder / "images/frame_00003.png").unlink()
    out = tmp_path / "out"
    error = complaint(lambda: recording.write_subset([0, 3], out))
    assert error.path == folder / "images/frame_00003.png"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recording"]
    with pytest.raises(OutputError, match="not empty"):
        recording.write_subset([0], folder)


# --- bad input -----------------------------------------------------------------------------------


def set_entry(row: int, column: int, value: object) -> Edit:
    def edit(top: dict[str, Any]) -> None:
        top["frames"][3]["transform_matrix"][row][column] = value

    return edit


def mirrored(top: dict[str, Any]) -> None:
    for row in top["frames"][3]["transform_matrix"][:3]:
        row[0] = -row[0]


def frame(**fields: object) -> Edit:
    return lambda top: top["frames"][3].update(fields)


def at_top(**fields: object) -> Edit:
    return lambda top: top.update(fields)


def without(key: str) -> Edit:
    return lambda top: top.pop(key)


BAD_FIELDS: dict[str, tuple[Edit, str, str]] = {
    "no frames": (without("frames"), "frames", "is missing"),
    "frames no list": (at_top(frames={}), "frames", "need a list"),
    "empty": (at_top(frames=[]), "frames", "is empty"),
    "frame no object": (lambda top: top["frames"].append(7), "frames[4]", "need an object"),
    "no picture": (
        lambda top: top["frames"][3].pop("file_path"),
        "frames[3].file_path",
        "is missing",
    ),
    "picture no text": (frame(file_path=3), "frames[3].file_path", "need a text"),
    "picture gone": (frame(file_path="images/x.png"), "frames[3].file_path", "no file"),
    "picture a folder": (frame(file_path="images"), "frames[3].file_path", "no file"),
    "picture name too long": (frame(file_path="x" * 300), "frames[3].file_path", "no file"),
    "picture name with 0": (frame(file_path="a\0b"), "frames[3].file_path", "outside"),
    "picture absolute": (frame(file_path="/etc/passwd"), "frames[3].file_path", "outside"),
    "picture above": (frame(file_path="images/../../a"), "frames[3].file_path", "outside"),
    "picture twice": (
        frame(file_path="images/frame_00001.png"),
        "frames[3].file_path",
        "frames[1]",
    ),
    "depth gone": (frame(depth_file_path="depths/x.png"), "frames[3].depth_file_path", "no file"),
    "depth above": (frame(depth_file_path="../x.png"), "frames[3].depth_file_path", "outside"),
    "depth no text": (frame(depth_file_path=[]), "frames[3].depth_file_path", "need a text"),
    "depth unit 0": (at_top(depth_unit_scale_factor=0), "depth_unit_scale_factor", "> 0"),
    "no pose": (
        lambda top: top["frames"][3].pop("transform_matrix"),
        "frames[3].transform_matrix",
        "is missing",
    ),
    "pose NaN": (set_entry(0, 1, math.nan), "frames[3].transform_matrix", "finite"),
    "pose infinite": (set_entry(0, 3, math.inf), "frames[3].transform_matrix", "finite"),
    "pose huge": (set_entry(0, 1, 1e200), "frames[3].transform_matrix", "rotation"),
    "pose text": (set_entry(0, 1, "1"), "frames[3].transform_matrix", "4 rows of 4"),
    "pose ragged": (frame(transform_matrix=[[1], [1, 2]]), "frames[3].transform_matrix", "4 rows"),
    "pose 3x4": (
        frame(transform_matrix=[[1, 0, 0, 0]] * 3),
        "frames[3].transform_matrix",
        "4 rows",
    ),
    "pose scaled": (set_entry(1, 1, 2.0), "frames[3].transform_matrix", "rotation"),
    "pose mirrored": (mirrored, "frames[3].transform_matrix", "mirroring"),
    "pose last row": (set_entry(3, 0, 1.0), "frames[3].transform_matrix", "last row"),
    "no focal length": (without("fl_x"), "frames[0].fl_x", "is missing"),
    "focal length 0": (at_top(fl_x=0), "fl_x", "> 0"),
    "focal length negative": (at_top(fl_y=-3.5), "fl_y", "> 0"),
    "focal length NaN": (at_top(fl_x=math.nan), "fl_x", "finite"),
    "focal length huge": (at_top(fl_x=10**400), "fl_x", "finite"),
    "focal length text": (at_top(fl_x="500"), "fl_x", "need a number"),
    "focal length bool": (at_top(fl_x=True), "fl_x", "need a number"),
    "focal length in a frame": (frame(fl_x=-1), "frames[3].fl_x", "> 0"),
    "no cx": (without("cx"), "frames[0].cx", "is missing"),
    "no w": (without("w"), "frames[0].w", "is missing"),
    "no h": (without("h"), "frames[0].h", "is missing"),
    "w 0": (at_top(w=0), "w", "> 0"),
    "h negative": (at_top(h=-48), "h", "> 0"),
    "w broken": (at_top(w=64.5), "w", "whole"),
    "w of another aspect": (at_top(w=48, h=64), "w", "48x64, but the picture is 64x48"),
    "angle": (lambda top: (top.pop("fl_x"), top.update(camera_angle_x=4)), "camera_angle_x", "pi"),
    "fisheye p1": (at_top(camera_model="OPENCV_FISHEYE", p1=0.1), "p1", "undistorted"),
    "fisheye folds": (at_top(camera_model="OPENCV_FISHEYE", k1=-3.0), "k1", "the lens would"),
    "sphere": (at_top(camera_model="EQUIRECTANGULAR"), "camera_model", "pictures all around"),
    "half a sphere": (at_top(camera_model="VR180_L"), "camera_model", "half of everything"),
    "sphere in a frame": (
        frame(camera_model="EQUIRECTANGULAR"),
        "frames[3].camera_model",
        "perspective pictures",
    ),
    "orthographic": (at_top(camera_model="ORTHOPHOTO"), "camera_model", "without perspective"),
    "another lens": (at_top(camera_model="FISHEYE624"), "camera_model", "only PINHOLE"),
    "instant-ngp's sphere": (at_top(latlong=True), "latlong", "perspective pictures"),
    "f-theta": (at_top(ftheta_p0=0.0), "ftheta_p0", "f-theta"),
    "model no text": (at_top(camera_model=5), "camera_model", "need a text"),
    "fisheye flag": (at_top(camera_model="PINHOLE", is_fisheye=True), "is_fisheye", "PINHOLE"),
    "folds": (at_top(k1=-0.9, fl_x=60.0), "k1", "fold the picture"),
    "folds by p2": (at_top(p2=-0.4), "p2", "fold the picture"),
    "smears": (
        lambda top: top.update(k1=-44.9, k2=1017.0, fl_x=260.6, fl_y=260.6, cx=32.0, cy=24.0),
        "k1",
        "stretch parts of the picture",
    ),
    "magnifies": (at_top(k1=50.0), "k1", "outside of the stored one"),
    "k1 huge": (at_top(k1=1e300), "k1", "outside of the stored one"),
    "k4": (at_top(camera_model="OPENCV", k4=0.1), "k4", "undistorted"),
    "k1 text": (at_top(k1="0"), "k1", "need a number"),
    "applied scale": (at_top(applied_scale=-1), "applied_scale", "> 0"),
    "time": (frame(timestamp="now"), "frames[3].timestamp", "need a number"),
}


@pytest.mark.parametrize("case", BAD_FIELDS)
def test_a_bad_field_is_named(folder: Path, case: str) -> None:
    edit, field, problem = BAD_FIELDS[case]
    edit_json(folder, edit)
    error = complaint(lambda: open_recording(folder))
    assert error.path == folder / "transforms.json"
    assert error.field == field
    assert problem in str(error)


@pytest.mark.parametrize(
    "item",
    [
        b"{}",
        b"[]",
        b"[" * 60 + b"]" * 60,
        b'{"":' * 60 + b"0" + b"}" * 60,
        '"\U0001f4f7é"'.encode(),
        b'"' + b"a" * 1000 + b'"',
        b"0.5",
    ],
)
def test_transforms_take_little_memory_whatever_stands_in_them(
    folder: Path, monkeypatch: pytest.MonkeyPatch, item: bytes
) -> None:
    """With limits of a hundredth, the memory stays within a hundredth of what is promised."""
    path = folder / "transforms.json"
    at_most, values = limits.MAX_TRANSFORMS_BYTES // 100, limits.MAX_TRANSFORMS_VALUES // 100
    monkeypatch.setattr(transforms_json, "MAX_TRANSFORMS_BYTES", at_most)
    monkeypatch.setattr(transforms_json, "MAX_TRANSFORMS_VALUES", values)
    per_item = 1 + item.count(b"[") + item.count(b"{")

    def write(count: int) -> None:
        path.write_bytes(b'{"frames":[' + b",".join([item] * count) + b"]}")

    count = min((values - 2) // per_item, (at_most - 20) // (len(item) + 1))
    write(count)
    tracemalloc.start()
    try:
        assert len(transforms_json.read_json(folder)["frames"]) == count
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < limits.TRANSFORMS_MEMORY_BYTES / 100
    write(count + 3)
    assert "at most" in complaint(lambda: open_recording(folder)).problem


def test_50_000_frames_are_read(folder: Path) -> None:
    path = folder / "transforms.json"
    top = json.loads(path.read_text())
    frame = top["frames"][0] | {"depth_file_path": "depths/frame_00001.png", "timestamp": 12.034567}
    for key in ("fl_x", "fl_y", "cx", "cy"):
        frame[key] = 1234.5678901
    frame |= {"w": 1920, "h": 1080}
    frame["transform_matrix"] = [[0.12345678901234567] * 4] * 3 + [[0.0, 0.0, 0.0, 1.0]]
    one = json.dumps({"frames": [frame]}, indent=4).encode()
    assert 50_000 * len(one) < limits.MAX_TRANSFORMS_BYTES
    assert 50_000 * sum(one.count(mark) for mark in b",[{") < limits.MAX_TRANSFORMS_VALUES


def test_what_is_nested_deep_is_refused(folder: Path) -> None:
    for depth in (limits.MAX_TRANSFORMS_DEPTH + 1, 500, 940, 990):
        path = folder / "transforms.json"
        path.write_bytes(b'{"frames":[],"x":' + b"[" * depth + b"]" * depth + b"}")
        problem = complaint(lambda: open_recording(folder)).problem
        assert "nested more than" in problem or "not JSON" in problem


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"", "not JSON"),
        (b'{"frames": [', "not JSON"),
        (b"\xff\xfe\x00", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b"[]", "need a JSON object"),
        (b"null", "need a JSON object"),
    ],
)
def test_what_is_no_transforms_json(folder: Path, text: bytes, problem: str) -> None:
    (folder / "transforms.json").write_bytes(text)
    error = complaint(lambda: open_recording(folder))
    assert error.path == folder / "transforms.json"
    assert problem in str(error)


def test_missing_places(folder: Path) -> None:
    assert "does not exist" in str(complaint(lambda: open_recording(folder / "no")))
    error = complaint(lambda: open_recording(folder / "transforms.json"))
    assert "is not a folder" in str(error)
    (folder / "transforms.json").unlink()
    error = complaint(lambda: open_recording(folder))
    assert (error.path, "does not exist" in str(error)) == (folder / "transforms.json", True)


def jpeg(shape: tuple[int, int] = (48, 64)) -> bytes:
    noise = np.random.default_rng(1).integers(0, 255, (*shape, 3), dtype=np.uint8)
    return encode_jpeg(noise)


def png(kind: type[np.uint8 | np.uint16], *shape: int) -> bytes:
    noise: np.ndarray = np.random.default_rng(1).integers(1, 255, shape).astype(kind)
    done, data = cv2.imencode(".png", noise.view())
    assert done
    return data.tobytes()


def cut(data: bytes, kept: float) -> bytes:
    return data[: int(len(data) * kept)] if kept < 1 else data[: -int(kept)]


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 0x55]) + data[middle + 1 :]


CUTS = [1, 2, 4, 12, 0.9, 0.5, 0.1, 0.01, 0.002]
"""Bytes cut off, or share kept."""

PICTURE = {
    **{f"jpeg {c}": cut(jpeg(), c) for c in CUTS},
    **{f"png {c}": cut(png(np.uint8, 48, 64, 3), c) for c in CUTS},
    "empty": b"",
    "text": b"no picture at all",
    "png flipped": flipped(png(np.uint8, 48, 64, 3)),
    "png start only": png(np.uint8, 48, 64, 3)[:8],
    "float": cv2.imencode(".tiff", np.ones((48, 64), np.float32))[1].tobytes(),
}


def read_all(folder: Path) -> NerfstudioRecording:
    recording = open_recording(folder)
    for index in range(len(recording)):
        recording.read(index)
    return recording


@pytest.mark.parametrize("case", PICTURE)
def test_a_damaged_picture_is_named(
    folder: Path, case: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = folder / "images/frame_00002.png"
    path.write_bytes(PICTURE[case])
    assert complaint(lambda: read_all(folder)).path == path
    assert capfd.readouterr() == ("", "")


DEPTH = {
    **{f"cut {c}": (cut(png(np.uint16, 48, 64), c), "") for c in CUTS},
    "flipped": (flipped(png(np.uint16, 48, 64)), "checksum"),
    "jpeg": (jpeg(), "not a PNG"),
    "8-bit": (png(np.uint8, 48, 64), "8-bit grey"),
    "RGB": (png(np.uint16, 48, 64, 3), "16-bit RGB"),
    "aspect": (png(np.uint16, 48, 48), "48x48"),
    "turned": (png(np.uint16, 64, 48), "48x64"),
}


@pytest.mark.parametrize("case", DEPTH)
def test_a_damaged_depth_map_is_named(
    folder: Path, case: str, capfd: pytest.CaptureFixture[str]
) -> None:
    data, problem = DEPTH[case]
    path = folder / "depths/frame_00002.png"
    path.write_bytes(data)
    error = complaint(lambda: read_all(folder))
    assert error.path == path
    assert problem in str(error)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "array",
    [
        np.ones((48, 64, 3)),
        np.ones(7),
        np.ones((48, 48)),
        np.array([["a"]]),
        np.ones((0, 0)),
        np.ones((48, 64), dtype=complex),
        np.array([[{}]]),
    ],
    ids=lambda array: f"{array.dtype}{array.shape}{array.flat[:1]}",
)
def test_a_wrong_depth_array_is_named(folder: Path, array: np.ndarray) -> None:
    path = folder / "depths/a.npy"
    np.save(path, array)
    edit_json(folder, lambda top: top["frames"][2].update(depth_file_path="depths/a.npy"))
    assert complaint(lambda: read_all(folder)).path == path


@pytest.mark.parametrize("kept", [1, 0.5, 0.01, 0.0001])
def test_a_depth_array_that_was_cut_off_is_named(folder: Path, kept: float) -> None:
    path = folder / "depths/a.npy"
    np.save(path, np.ones((48, 64)))
    path.write_bytes(cut(path.read_bytes(), kept))
    edit_json(folder, lambda top: top["frames"][2].update(depth_file_path="depths/a.npy"))
    assert complaint(lambda: read_all(folder)).path == path


@pytest.mark.parametrize("kind", ["archive", "pickle", "nothing", "text", "deep", "cut header"])
def test_what_is_called_npy_and_is_none_is_named(folder: Path, kind: str) -> None:
    path = folder / "depths/a.npy"
    header = b"\x93NUMPY\x01\x00\xff\x0f"
    match kind:
        case "archive":
            with path.open("wb") as file:
                np.savez(file, depth=np.ones((48, 64)))
        case "pickle":
            path.write_bytes(pickle.dumps(np.ones((48, 64))))
        case "deep":
            path.write_bytes(header + b"(" * 0xFFF)
        case "cut header":
            path.write_bytes(header)
        case _:
            path.write_bytes(b"" if kind == "nothing" else b"depth")
    edit_json(folder, lambda top: top["frames"][2].update(depth_file_path="depths/a.npy"))
    assert complaint(lambda: read_all(folder)).path == path


def test_files_that_change_after_opening(folder: Path) -> None:
    recording = open_recording(folder)
    (folder / "images/frame_00000.png").write_bytes(png(np.uint8, 24, 32, 3))
    (folder / "images/frame_00001.png").unlink()
    assert "changed its size" in str(complaint(lambda: recording.read(0)))
    assert "cannot be read" in str(complaint(lambda: recording.read(1)))
    with pytest.raises(IndexError):
        recording.read(4)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=4),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=2)
    ),
    max_leaves=6,
)
KEYS = [
    *("camera_model", "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k4", "p2", "camera_angle_x"),
    *("file_path", "depth_file_path", "depth_path", "transform_matrix", "timestamp", "frames"),
    *("applied_scale", "depth_unit_scale_factor", "integer_depth_scale", "is_fisheye"),
    "ply_file_path",
]


@pytest.fixture(scope="module")
def fuzzed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = write_recording(tmp_path_factory.mktemp("fuzz") / "r", num_frames=2)
    return folder, (folder / "transforms.json").read_text()


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(KEYS), JSON_VALUES, st.booleans())
def test_whatever_a_field_holds_it_opens_or_complains(
    fuzzed: tuple[Path, str], key: str, value: object, in_frame: bool
) -> None:
    folder, text = fuzzed
    top = json.loads(text)
    (top["frames"][1] if in_frame else top)[key] = value
    (folder / "transforms.json").write_text(json.dumps(top))
    with contextlib.suppress(RecordingError):
        assert 1 <= len(open_recording(folder)) <= 2
