"""nerfstudio, instant-ngp, LLFF and TUM, by what their documents say, without our readers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from exported import SIZE_PX, export, masked_room, room
from peaking.datasets import open_recording
from peaking.datasets.point_cloud import read_points
from peaking.errors import RecordingError
from peaking.export.names import DatasetFormat
from peaking.export.up import AXES, Axis, guess_up, turn, vector_of
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from recordings import Room, lateral_cameras

GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])


def transforms(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "transforms.json").read_text())


def grey(path: Path) -> np.ndarray:
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


def test_nerfstudio_has_what_its_conventions_ask_for(tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    export(recording, tmp_path / "out", "nerfstudio")
    written = transforms(tmp_path / "out")
    assert written["camera_model"] == "OPENCV"
    assert written["fl_x"] == recording.cameras[0].pinhole.fx_px
    assert written["depth_unit_scale_factor"] == 0.001
    for number, entry in enumerate(written["frames"]):
        k = recording.cameras[number].pinhole
        sizes = [entry[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")]
        assert sizes == [k.width_px, k.height_px, k.fx_px, k.fy_px, k.cx_px, k.cy_px]
        assert not {"k1", "k2", "p1", "p2"} & entry.keys()
        matrix = np.array(entry["transform_matrix"])
        meant = recording.cameras[number].world_from_cam.matrix() @ GL_FROM_CV
        assert np.abs(matrix - meant).max() < 1e-12
        depth_m = grey(tmp_path / "out" / entry["depth_file_path"]) / 1000
        recorded_m = recording.read(number).depth_m
        assert recorded_m is not None
        assert np.abs(depth_m - recorded_m).max() < 0.00051
    points = tmp_path / "out" / written["ply_file_path"]
    assert len(read_points(points)) > 5000
    assert b"property uchar red" in points.read_bytes()[:400]


def test_nerfstudio_takes_depth_and_masks_for_all_frames_or_none(tmp_path: Path) -> None:
    def without_one(content: dict[str, Any]) -> None:
        del content["frames"][2]["depth_file_path"]

    source = room(tmp_path / "room", change=without_one)
    export(source, tmp_path / "out", "nerfstudio")
    entries = transforms(tmp_path / "out")["frames"]
    assert all("depth_file_path" in entry for entry in entries)
    depths = [grey(tmp_path / "out" / entry["depth_file_path"]) for entry in entries]
    assert [depth.any() for depth in depths] == [True, True, False, True, True, True]
    export(masked_room(tmp_path / "masked"), tmp_path / "masks", "nerfstudio")
    entries = transforms(tmp_path / "masks")["frames"]
    shares = [(grey(tmp_path / "masks" / entry["mask_path"]) > 0).mean() for entry in entries]
    assert shares == [1.0, 0.5, 1.0, 0.5, 1.0, 1.0]
    export(room(tmp_path / "bare", with_depth=False), tmp_path / "none", "nerfstudio")
    assert not any(
        {"depth_file_path", "mask_path"} & entry.keys()
        for entry in transforms(tmp_path / "none")["frames"]
    )


@pytest.mark.parametrize("to", ("nerfstudio", "instant-ngp"))
def test_different_intrinsics_are_those_of_each_frame(to: DatasetFormat, tmp_path: Path) -> None:
    def zoomed(content: dict[str, Any]) -> None:
        content["frames"][2]["fl_x"] = content["frames"][2]["fl_y"] = 70.0

    export(room(tmp_path / "room", change=zoomed), tmp_path / "out", to)
    written = transforms(tmp_path / "out")
    assert "fl_x" not in written
    assert [entry["fl_x"] for entry in written["frames"]] == [57.6, 57.6, 70.0, 57.6, 57.6, 57.6]


def test_an_applied_transform_says_how_the_world_was_turned(tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    placing = Rigid[World, World](turn("-y", "+z"), np.array([1.0, 2.0, 3.0]))
    export(recording, tmp_path / "out", "nerfstudio", out_from_world=placing)
    written = transforms(tmp_path / "out")
    applied = np.vstack([written["applied_transform"], [0, 0, 0, 1]])
    for number, entry in enumerate(written["frames"]):
        back = np.linalg.inv(applied) @ entry["transform_matrix"] @ GL_FROM_CV
        meant = recording.cameras[number].world_from_cam.matrix()
        assert np.abs(back - meant).max() < 1e-12
        up = np.array(entry["transform_matrix"])[:3, 1]
        assert up @ [0, 0, 1] > 0.99
    wall_y = read_points(tmp_path / "out" / written["ply_file_path"])[:, 1]
    assert wall_y.max() == pytest.approx(2.0 + 2.0, abs=0.002)


def test_instant_ngp_has_depth_of_the_size_of_the_picture(tmp_path: Path) -> None:
    source = room(tmp_path / "room")
    for path in (source / "depths").iterdir():
        path.write_bytes(cv2.imencode(".png", grey(path)[::2, ::2])[1].tobytes())
    export(source, tmp_path / "out", "instant-ngp")
    written = transforms(tmp_path / "out")
    assert written["integer_depth_scale"] == 0.001
    side = written["aabb_scale"]
    assert side & (side - 1) == 0
    assert side / written["scale"] / 2 >= 2.0  # the wall is in the box
    for entry in written["frames"]:
        depth = grey(tmp_path / "out" / entry["depth_path"])
        assert depth.shape == SIZE_PX[::-1]
        assert set(np.unique(depth)) <= set(range(1, 3000))
        assert "depth_file_path" not in entry


def llff_row(camera: Camera) -> np.ndarray:
    """What LLFF's README says: columns [-y, x, z] of OpenGL's axes, position, height, width, f."""
    gl = camera.world_from_cam.matrix() @ GL_FROM_CV
    x, y, z, at = gl[:3].T
    k = camera.pinhole
    return np.column_stack([-y, x, z, at, [k.height_px, k.width_px, k.fx_px]]).ravel()


def test_llff_has_the_axes_of_its_readme(tmp_path: Path) -> None:
    def centred(content: dict[str, Any]) -> None:
        content.update(cx=SIZE_PX[0] / 2, cy=SIZE_PX[1] / 2)

    recording = open_recording(room(tmp_path / "room", change=centred))
    exported = export(recording, tmp_path / "out", "llff")
    assert exported.notes == ()
    rows = np.load(tmp_path / "out/poses_bounds.npy")
    assert rows.shape == (6, 17)
    for row, camera in zip(rows, recording.cameras, strict=True):
        np.testing.assert_allclose(row[:15], llff_row(camera), atol=1e-12)
        assert 0.9 < row[15] < 1.2
        assert 1.9 < row[16] < 2.2


def test_llff_pictures_are_those_of_a_camera_without_principal_point(tmp_path: Path) -> None:
    """They are what that camera would have taken of the room."""

    def stretched(content: dict[str, Any]) -> None:
        content["fl_y"] = 62.0

    camera = lateral_cameras(6, *SIZE_PX)[2]
    k = camera.pinhole
    own = Pinhole(*SIZE_PX, k.fx_px, 62.0, k.cx_px, k.cy_px)
    source = room(tmp_path / "room", change=stretched)
    plain = Room(box_m=None)
    for number, one in enumerate(lateral_cameras(6, *SIZE_PX)):
        rgb, _ = plain.photographed(Camera(own, one.world_from_cam))
        path = source / f"images/frame_{number:05d}.png"
        path.write_bytes(cv2.imencode(".png", rgb[..., ::-1])[1].tobytes())
    exported = export(source, tmp_path / "out", "llff")
    assert "no principal point" in exported.notes[0]
    row = np.load(tmp_path / "out/poses_bounds.npy")[2]
    height, width, focal = row[[4, 9, 14]]
    assert focal == k.fx_px
    there = Pinhole(int(width), int(height), focal, focal, width / 2, height / 2)
    seen, _ = plain.photographed(Camera(there, camera.world_from_cam))
    written = cv2.imread(str(tmp_path / "out/images/frame_00002.jpg"))
    assert written is not None
    off = np.abs(written[..., ::-1].astype(int) - seen.astype(int))
    assert off.mean() < 3.0  # measured 2.1, of which JPEG 0.9; half a pixel aside 8.8 (2026-12-01)


def test_llff_needs_to_know_how_far_things_are(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nearest and the farthest"):
        export(room(tmp_path / "room", with_depth=False), tmp_path / "out", "llff")
    assert not (tmp_path / "out").exists()


def quaternion_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_tum_has_what_its_page_says(tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    exported = export(recording, tmp_path / "out", "tum")
    k = recording.cameras[0].pinhole
    assert str(k.fx_px) in exported.notes[0]
    out = tmp_path / "out"

    def rows(name: str) -> list[list[str]]:
        lines = (out / name).read_text().splitlines()
        return [line.split() for line in lines if not line.startswith("#")]

    numbers = list(map(float, (out / "calibration.txt").read_text().split()))
    assert numbers == [k.fx_px, k.fy_px, k.cx_px - 0.5, k.cy_px - 0.5]
    poses = {row[0]: list(map(float, row[1:])) for row in rows("groundtruth.txt")}
    depths = dict(rows("depth.txt"))
    for number, (stamp, name) in enumerate(rows("rgb.txt")):
        assert (out / name).is_file()
        assert float(stamp) == pytest.approx(number / 30, abs=1e-6)
        meant = recording.cameras[number].world_from_cam
        assert np.abs(np.array(poses[stamp][:3]) - meant.translation_m).max() < 1e-6
        assert np.abs(quaternion_matrix(*poses[stamp][3:]) - meant.rotation).max() < 1e-6
        depth_m = grey(out / depths[stamp]) / 5000
        recorded_m = recording.read(number).depth_m
        assert recorded_m is not None
        assert np.abs(depth_m - recorded_m).max() < 0.00011


def test_depth_beyond_the_room_of_a_format_is_unknown_and_said(tmp_path: Path) -> None:
    def far(content: dict[str, Any]) -> None:
        content["depth_unit_scale_factor"] = 0.01  # the wall is at 20 m

    recording = open_recording(room(tmp_path / "room", change=far))
    said = export(recording, tmp_path / "out", "tum").notes[-1]
    assert "beyond 13.1 m" in said
    assert not export(recording, tmp_path / "mm", "nerfstudio").notes


def test_up_is_what_most_pictures_say() -> None:
    cameras = lateral_cameras(5, *SIZE_PX)
    assert guess_up(cameras) == "-y"
    for axis in AXES:
        rotation = turn("-y", axis)
        moved = [
            Camera(
                one.pinhole,
                Rigid[World, Cam](rotation @ one.world_from_cam.rotation, one.position_m),
            )
            for one in cameras
        ]
        assert guess_up(moved) == axis
    around = [
        Camera(cameras[0].pinhole, Rigid[World, Cam](turn("-y", axis), np.zeros(3)))
        for axis in AXES
    ]
    assert guess_up(around) is None


@pytest.mark.parametrize("to", AXES)
@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("half_turn", ("x", "z"))
def test_turns_are_rotations_that_take_up_up(up: Axis, to: Axis, half_turn: Any) -> None:
    rotation = turn(up, to, half_turn=half_turn)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ vector_of(up), vector_of(to), atol=1e-15)
