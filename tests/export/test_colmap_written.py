"""COLMAP's models, read by pycolmap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest

from exported import export, masked_room, room
from peaking.datasets import Recording, open_recording
from peaking.export.material import Material, points_seen_m
from peaking.export.names import DatasetFormat

KINDS = pytest.mark.parametrize("to", ("colmap", "colmap-text"))
MOST_OFF = {"colmap": 1e-9, "colmap-text": 1e-6}
REPROJECTED_PX = 1e-6
"""Measured on the rooms here: 3e-13 px, 2026-12-01."""


def compare(recording: Recording, folder: Path, most_off: float) -> pycolmap.Reconstruction:
    """Compare a model, as pycolmap reads it, with the recording that it was made of."""
    model = pycolmap.Reconstruction(folder / "sparse/0")
    by_name = {Path(image.name).stem: image for image in model.images.values()}
    assert set(by_name) == set(recording.names)
    material = Material(recording, range(len(recording)))
    projected = 0
    for number, name in enumerate(recording.names):
        image, meant = by_name[name], recording.cameras[number]
        camera: Any = model.cameras[image.camera_id]
        k = meant.pinhole
        assert camera.model.name == "PINHOLE"
        assert (camera.width, camera.height) == k.size_px
        assert camera.params.tolist() == [k.fx_px, k.fy_px, k.cx_px, k.cy_px]
        cam_from_world = np.eye(4)
        cam_from_world[:3] = image.cam_from_world().matrix()
        off = np.abs(cam_from_world - meant.world_from_cam.inverse().matrix()).max()
        assert off <= most_off
        seen = material.seen_m(recording.read(number))[::50]
        for (x_px, y_px, _), point in zip(seen, points_seen_m(meant, seen), strict=True):
            xy_px: Any = image.project_point(point)
            assert np.abs(xy_px - [x_px, y_px]).max() < REPROJECTED_PX
        projected += len(seen)
    assert projected > 300
    return model


@KINDS
def test_pycolmap_reads_what_was_recorded(to: DatasetFormat, tmp_path: Path) -> None:
    source = room(tmp_path / "room")
    export(source, tmp_path / "out", to)
    model = compare(open_recording(source), tmp_path / "out", MOST_OFF[to])
    assert len(model.cameras) == 1


@KINDS
def test_points_know_who_sees_them(to: DatasetFormat, tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    export(recording, tmp_path / "out", to)
    model = pycolmap.Reconstruction(tmp_path / "out/sparse/0")
    assert len(model.points3D) > 5000
    lengths = [point.track.length() for point in model.points3D.values()]
    assert min(lengths) >= 1
    first = [point.track.length() for number, point in model.points3D.items() if number <= 1500]
    assert np.mean(first) > 4
    worst_px = worst_share = 0.0
    for image in model.images.values():
        number = list(recording.names).index(Path(image.name).stem)
        frame = recording.read(number)
        assert frame.depth_m is not None
        for point2d in list(image.points2D)[::40]:
            point: Any = model.points3D[point2d.point3D_id]
            xy_px: Any = image.project_point(point.xyz)
            worst_px = max(worst_px, float(np.abs(xy_px - point2d.xy).max()))
            x, y = point2d.xy.astype(int)
            depth_m = (image.cam_from_world() * point.xyz)[2]
            worst_share = max(worst_share, abs(frame.depth_m[y, x] / depth_m - 1))
            elements = {(one.image_id, one.point2D_idx) for one in point.track.elements}
            assert image.image_id in {image_id for image_id, _ in elements}
    assert worst_px < REPROJECTED_PX
    assert worst_share < 0.02


def test_what_hides_a_point_does_not_see_it(tmp_path: Path) -> None:
    """The wall behind the box: no track leads through the box."""
    recording = open_recording(room(tmp_path / "room"))
    export(recording, tmp_path / "out", "colmap")
    model = pycolmap.Reconstruction(tmp_path / "out/sparse/0")
    image = next(one for one in model.images.values() if one.name.startswith("frame_00002"))
    k = recording.cameras[2].pinhole
    behind = [
        point2d
        for point2d in image.points2D
        if np.abs((point2d.xy - [k.cx_px, k.cy_px]) / [k.fx_px, k.fy_px]).max() < 0.1
        and model.points3D[point2d.point3D_id].xyz[2] > 1.5
    ]
    assert behind == []


@KINDS
def test_points_that_are_known_without_depth_are_tracked(to: DatasetFormat, tmp_path: Path) -> None:
    points_m = np.array([[0.1 * i, 0.05 * j, 2.0] for i in range(-4, 5) for j in range(-4, 5)])
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points_m)}\n"
    head += "property float x\nproperty float y\nproperty float z\nend_header\n"

    def with_points(content: dict[str, Any]) -> None:
        content["ply_file_path"] = "cloud.ply"

    source = room(tmp_path / "room", change=with_points, with_depth=False)
    (source / "cloud.ply").write_text(head + "\n".join(" ".join(map(str, p)) for p in points_m))
    export(source, tmp_path / "out", to)
    model = pycolmap.Reconstruction(tmp_path / "out/sparse/0")
    assert len(model.points3D) == len(points_m)
    found = np.array(sorted(point.xyz.tolist() for point in model.points3D.values()))
    np.testing.assert_allclose(found, sorted(points_m.tolist()), atol=1e-7)
    assert np.mean([point.track.length() for point in model.points3D.values()]) > 5


def test_several_cameras_are_kept_apart(tmp_path: Path) -> None:
    def zoomed(content: dict[str, Any]) -> None:
        content["frames"][2]["fl_x"] = content["frames"][2]["fl_y"] = 70.0

    source = room(tmp_path / "room", change=zoomed)
    export(source, tmp_path / "out", "colmap")
    assert len(compare(open_recording(source), tmp_path / "out", 1e-9).cameras) == 2


def test_what_does_not_count_is_no_point(tmp_path: Path) -> None:
    export(masked_room(tmp_path / "room", frames=(0, 1, 2, 3, 4, 5)), tmp_path / "out", "colmap")
    model = pycolmap.Reconstruction(tmp_path / "out/sparse/0")
    for image in model.images.values():
        assert min(point2d.xy[0] for point2d in image.points2D) >= 32
