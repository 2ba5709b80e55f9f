"""Point clouds: files worked by hand, what hides what, and recordings that bring one."""

from __future__ import annotations

import contextlib
import json
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peaking.datasets import open_recording, point_cloud
from peaking.datasets.point_cloud import (
    MAX_POINTS,
    check_points,
    encode_points,
    read_points,
)
from peaking.errors import RecordingError
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.limits import MAX_ASCII_POINTS_BYTES, MAX_POINTS_BYTES, POINTS_MEMORY_BYTES
from peaking.point_cloud import visible_points
from recordings import lateral_cameras, write_recording

POINTS = np.array([[1.0, -2.5, 3.0], [0.25, 0.0, 4.0]])
ASCII = """ply
format ascii 1.0
comment made by hand
element vertex 2
property float x
property float y
property float z
property uchar red
element face 1
property list uchar int vertex_indices
end_header
1 -2.5 3.0 255
0.25 0 4e0 0
3 0 1 1
"""


def binary(order: str) -> bytes:
    """Return `POINTS` with a colour before them and doubles."""
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\r\nformat {kind} 1.0\r\nelement vertex 2\r\nproperty uchar red\r\n"
    head += "".join(f"property double {name}\r\n" for name in "zyx") + "end_header\r\n"
    rows = [struct.pack(f"{order}B3d", 7, *point[::-1]) for point in POINTS]
    return head.encode() + b"".join(rows)


@pytest.mark.parametrize(
    "data",
    [ASCII.encode(), binary("<"), binary(">"), encode_points(POINTS)],
    ids=["ascii", "little", "big", "ours"],
)
def test_points_are_read_from_every_kind_of_file(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(data)
    check_points(path)
    np.testing.assert_array_equal(read_points(path), POINTS)


def test_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(encode_points(np.array([[np.nan, 0, 0], [1, 2, 3], [0, np.inf, 0]])))
    np.testing.assert_array_equal(read_points(path), [[1, 2, 3]])
    path.write_bytes(encode_points(np.zeros((0, 3))))
    assert read_points(path).shape == (0, 3)


def test_of_a_large_cloud_some_are_taken_from_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    along = np.arange(2.0 * MAX_POINTS + 1)
    path.write_bytes(encode_points(np.stack([along, along, along], axis=1)))
    np.testing.assert_array_equal(read_points(path)[:, 1], along[::3])


def small_points(format_: str, count: int) -> bytes:
    """Return the header of points that take as few bytes as points can."""
    properties = "".join(f"property char {name}\n" for name in "xyz")
    return f"ply\nformat {format_} 1.0\nelement vertex {count}\n{properties}end_header\n".encode()


@pytest.mark.parametrize("is_text", [False, True])
def test_reading_takes_little_memory_however_many_points_there_are(
    tmp_path: Path, is_text: bool
) -> None:
    path = tmp_path / "a.ply"
    count = 2**21 if is_text else 2**26
    with path.open("wb") as file:
        file.write(small_points("ascii" if is_text else "binary_big_endian", count))
        if is_text:
            file.write(b"0 " * 3 * count)
        else:
            file.truncate(file.tell() + 3 * count)  # one hole: nothing on the disk
    tracemalloc.start()
    try:
        points = read_points(path)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert MAX_POINTS * 0.9 < len(points) <= MAX_POINTS
    assert most < POINTS_MEMORY_BYTES


def test_clouds_that_are_too_large_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    for head, at_most in (
        (small_points("ascii", 1), MAX_ASCII_POINTS_BYTES),
        (small_points("binary_little_endian", 1), MAX_POINTS_BYTES),
    ):
        with path.open("wb") as file:
            file.write(head)
            file.truncate(len(head) + at_most + 1)
        with pytest.raises(RecordingError, match=f"at most {at_most:,}"):
            read_points(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.integers(1, 40), st.integers(1, 9), st.integers(8, 64), st.sampled_from(["<", ""]))
def test_blocks_leave_no_seams(
    tmp_path: Path, count: int, most: int, block_bytes: int, order: str
) -> None:
    points = np.arange(3.0 * count).reshape(count, 3)
    data = encode_points(points)
    if not order:
        rows = "\n".join(" ".join(map(str, row)) for row in points)
        data = data[: data.index(b"end_header")].replace(b"binary_little_endian", b"ascii")
        data += b"element face 1\nproperty list uchar int i\nend_header\n" + rows.encode()
        data += b"\n3 0 1 and words\n"
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(point_cloud, "MAX_POINTS", most)
        patch.setattr(point_cloud, "_BLOCK_BYTES", block_bytes)
        np.testing.assert_array_equal(read_points(tmp_path / "a.ply"), points[:: -(-count // most)])


def test_what_is_behind_the_nearest_point_of_its_part_is_hidden() -> None:
    # 320 px are 32 parts of 10 px; at 1 m a pixel is 1 cm.
    camera = Camera(Pinhole(320, 160, 100.0, 100.0, 160.0, 80.0), Rigid.identity())

    def at(x_px: float, y_px: float, depth_m: float) -> list[float]:
        return [(x_px - 160) / 100 * depth_m, (y_px - 80) / 100 * depth_m, depth_m]

    near, slanted, hidden = at(11, 11, 1.0), at(19, 19, 1.09), at(15, 15, 1.11)
    beside, below = at(21, 15, 3.0), at(15, 21, 3.0)
    outside, behind = at(320.5, 15, 1.0), [0.0, 0.0, -1.0]
    cloud = np.array([hidden, near, slanted, beside, below, outside, behind])
    np.testing.assert_array_equal(visible_points(cloud, camera), [near, slanted, beside, below])
    assert len(visible_points(np.zeros((0, 3)), camera)) == 0


# --- recordings ----------------------------------------------------------------------------------


def with_cloud(folder: Path, *, in_frame: bool = False, **top_fields: Any) -> Path:
    """Add `cloud.ply`, of two points before the second camera and one that the first hides."""
    camera = lateral_cameras(4, 64, 48)[1]
    in_camera_m = np.array([[0.0, 0, 1], [0.0, 0, 2], [0.3, 0.2, 2]])
    points_m = camera.world_from_cam.apply(in_camera_m)
    scale = top_fields.get("applied_scale", 1.0)
    (folder / "cloud.ply").write_bytes(encode_points(points_m * scale))
    path = folder / "transforms.json"
    top = json.loads(path.read_text()) | top_fields
    (top["frames"][1] if in_frame else top)["ply_file_path"] = "./cloud.ply"
    for frame in top["frames"]:
        matrix = np.array(frame["transform_matrix"])
        matrix[:3, 3] *= scale
        frame["transform_matrix"] = matrix.tolist()
    path.write_text(json.dumps(top))
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "recording", with_depth=False)


@pytest.mark.parametrize("applied_scale", [1.0, 0.25])
def test_a_frame_gets_what_it_sees_of_the_recordings_cloud(
    folder: Path, applied_scale: float
) -> None:
    frame = open_recording(with_cloud(folder, applied_scale=applied_scale)).read(1)
    seen_m = frame.camera.world_from_cam.inverse().apply(np.asarray(frame.points_m))
    np.testing.assert_allclose(seen_m, [[0.0, 0, 1], [0.3, 0.2, 2]], atol=1e-6)


def test_a_cloud_of_its_own_is_taken_as_it_is(folder: Path) -> None:
    recording = open_recording(with_cloud(folder, in_frame=True))
    assert np.asarray(recording.read(1).points_m).shape == (3, 3)
    assert recording.read(0).points_m is None


def test_where_there_is_a_depth_map_no_cloud_is_read(tmp_path: Path) -> None:
    folder = with_cloud(write_recording(tmp_path / "recording"))
    (folder / "cloud.ply").write_bytes(b"ply")
    assert open_recording(folder).read(1).points_m is None


def test_a_subset_keeps_the_clouds(folder: Path, tmp_path: Path) -> None:
    recording = open_recording(with_cloud(folder, in_frame=True))
    subset = recording.write_subset([1, 2], tmp_path / "out")
    np.testing.assert_array_equal(
        np.asarray(subset.read(0).points_m), np.asarray(recording.read(1).points_m)
    )


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "no .ply"),
        (b"end_header\n", "no .ply"),
        (b"\x89PNG\r\n\x1a\n", "no .ply"),
        (ASCII.replace("ascii 1.0", "ascii 2.0").encode(), "'format ascii 2.0'"),
        (ASCII.replace("float y", "half y").encode(), "'property half y'"),
        (ASCII.replace("float y", "float x").encode(), "does not begin with vertices"),
        (ASCII.replace("vertex 2", "vertex -2").encode(), "'element vertex -2'"),
        (ASCII.replace("vertex 2", "vertex " + "9" * 5000).encode(), "'element vertex 999"),
        (ASCII.replace("vertex 2", "camera 2").encode(), "does not begin with vertices"),
        (ASCII.replace("float z", "float depth").encode(), "without x, y and z"),
        (ASCII.replace("vertex 2", "vertex 20").encode(), "cut off: need 20"),
        (ASCII.replace("0.25 0 4e0 0\n3 0 1 1", "0.25                ").encode(), "need 2"),
        (ASCII.replace("-2.5", "9" * 3_000_000).encode(), "no numbers"),
        (ASCII.replace("-2.5", "far").encode(), "no numbers"),
        (binary("<")[:-1], "cut off: need 2"),
    ],
)
def test_what_is_no_cloud_is_said(tmp_path: Path, data: bytes, problem: str) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(data)
    with pytest.raises(RecordingError) as caught:
        read_points(path)
    assert caught.value.path == path
    assert problem in str(caught.value)


def test_a_cloud_that_is_none_is_found_when_the_recording_is_opened(folder: Path) -> None:
    with_cloud(folder)
    (folder / "cloud.ply").write_bytes(b"ply\n")
    with pytest.raises(RecordingError, match=r"cloud\.ply: is no \.ply file"):
        open_recording(folder)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.sampled_from("<>a"), st.integers(0, 400), st.binary(min_size=1, max_size=8))
def test_any_damage_is_points_or_a_sentence(
    tmp_path: Path, order: str, at: int, damage: bytes
) -> None:
    good = ASCII.encode() if order == "a" else binary(order)
    path = tmp_path / "a.ply"
    path.write_bytes(good[:at] + damage + good[at + len(damage) :])
    with contextlib.suppress(RecordingError):  # anything else is a fault
        assert np.isfinite(read_points(path)).all()
