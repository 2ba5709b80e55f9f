"""Recordings of phones' apps and of known data sets, as these write them."""

from __future__ import annotations

import contextlib
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peaking.datasets import Reading, Recording, open_recording
from peaking.datasets.lzfse_blocks import stated_bytes
from peaking.datasets.registry import FORMATS
from peaking.datasets.scannet import _COLOUR_FROM_DEPTH
from peaking.errors import PeakingError, RecordingError
from peaking.geometry import Pinhole
from written_formats import (
    Shot,
    assert_only_these_axes_fit,
    shots,
    write_arkitscenes,
    write_polycam,
    write_record3d,
    write_scannet,
    write_seven_scenes,
    write_stray,
    write_tum,
)

DEPTH = Pinhole(80, 60, 75.0, 76.0, 41.0, 29.0)
KINECT = Pinhole(640, 480, 525.0, 525.0, 320.0, 240.0)
KINECT_DEPTH = Pinhole(320, 240, 292.5, 292.5, 160.0, 120.0)
SMALL_DEPTH = Pinhole(80, 60, 70.0, 71.0, 40.75, 29.0)


def kinect_shots() -> list[Shot]:
    return shots(2, pinhole=KINECT, depth=KINECT_DEPTH, color_from_depth=_COLOUR_FROM_DEPTH)


WRITERS: dict[str, Callable[[Path], Path]] = {
    "tum": lambda root: write_tum(root, shots()),
    "scannet": lambda root: write_scannet(root, shots(depth=DEPTH), DEPTH),
    "7-scenes": lambda root: write_seven_scenes(root, kinect_shots(), _COLOUR_FROM_DEPTH),
    "polycam": lambda root: write_polycam(root, shots(depth=SMALL_DEPTH), corrected=True),
    "arkitscenes": lambda root: write_arkitscenes(root, shots()),
    "stray": lambda root: write_stray(root, shots(depth=SMALL_DEPTH), intrinsics=True),
    "record3d": lambda root: write_record3d(root, shots(depth=SMALL_DEPTH)),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_neighbour_fits_with_the_axes_read_and_no_others(name: str, tmp_path: Path) -> None:
    recording = open_recording(WRITERS[name](tmp_path / "48458663"))
    assert recording.format == name
    assert all(recording.has_depth)
    assert_only_these_axes_fit(recording)


@pytest.mark.parametrize("name", WRITERS)
def test_a_subset_is_the_same_frames_in_nerfstudios_format(name: str, tmp_path: Path) -> None:
    recording = open_recording(WRITERS[name](tmp_path / "48458663"))
    subset = recording.write_subset([1, 0], tmp_path / "out")
    for index, source in enumerate((1, 0)):
        kept, meant = subset.read(index), recording.read(source)
        assert kept.camera.pinhole == meant.camera.pinhole
        assert np.allclose(
            kept.camera.world_from_cam.matrix(), meant.camera.world_from_cam.matrix(), atol=1e-12
        )
        assert np.abs(kept.rgb.astype(int) - meant.rgb).mean() < 2.5  # JPEG
        assert kept.depth_m is not None
        assert meant.depth_m is not None
        assert np.abs(kept.depth_m - meant.depth_m).max() < 0.00051


@pytest.mark.parametrize("name", ["polycam", "stray", "record3d"])
def test_what_is_unsure_or_not_finite_is_unknown(name: str, tmp_path: Path) -> None:
    depth_m = open_recording(WRITERS[name](tmp_path / "scan")).read(0).depth_m
    assert depth_m is not None
    edge = {"polycam": depth_m[0], "stray": depth_m[:, 0], "record3d": depth_m[-1]}[name]
    assert (edge == 0).all()
    assert (depth_m[1:-1, 1:-1] > 0).mean() > 0.9


@pytest.mark.parametrize("kind", ["plain", "per frame", "wide"])
def test_record3d_as_one_file(kind: str, tmp_path: Path) -> None:
    wide = Pinhole(160, 90, 140.0, 140.0, 80.0, 45.0)
    whole = Pinhole(80, 60, 70.0, 70.0, 40.0, 30.0)
    taken = shots(pinhole=wide, depth=whole) if kind == "wide" else shots(depth=SMALL_DEPTH)
    write_record3d(tmp_path / "scan", taken, per_frame=kind == "per frame")
    path = tmp_path / "2026-11-30.r3d"
    with zipfile.ZipFile(path, "w") as archive:
        for file in (tmp_path / "scan").rglob("*"):
            archive.write(file, file.relative_to(tmp_path / "scan"))
    recording = open_recording(path)
    assert recording.name == "2026-11-30"
    assert_only_these_axes_fit(recording)
    size_px = recording.depth_size_px(0)
    depth_m = recording.read(0).depth_m
    assert depth_m is not None
    assert size_px == (depth_m.shape[1], depth_m.shape[0])
    if kind == "wide":
        assert size_px == (80, 45)


def test_strays_older_files_have_one_matrix(tmp_path: Path) -> None:
    newer = open_recording(write_stray(tmp_path / "new", shots(), intrinsics=True))
    older = open_recording(write_stray(tmp_path / "old", shots(), intrinsics=False))
    assert newer.cameras[0].pinhole == older.cameras[0].pinhole
    backwards = [older.read(i).rgb for i in (3, 0, 2)]
    assert np.array_equal(backwards[1], older.read(0).rgb)
    assert np.array_equal(backwards[2], newer.read(2).rgb)


def test_tums_poses_are_taken_between_those_before_and_after(tmp_path: Path) -> None:
    taken = shots(3)
    root = write_tum(tmp_path / "walk", taken)
    lines = (root / "groundtruth.txt").read_text().splitlines()
    (root / "groundtruth.txt").write_text("\n".join([lines[1], lines[3]]))
    recording = open_recording(root)
    between = recording.cameras[1].world_from_cam
    assert np.abs(between.translation_m - taken[1].world_from_cam[:3, 3]).max() < 1e-4
    assert np.abs(between.rotation - taken[1].world_from_cam[:3, :3]).max() < 1e-3
    assert recording.timestamps_s[1] == pytest.approx(taken[1].time_s, abs=1e-6)


def test_a_kinect_without_calibration_is_said(tmp_path: Path) -> None:
    root = write_tum(tmp_path / "rgbd_dataset_freiburg3_desk", shots(2))
    (root / "calibration.txt").unlink()
    assert "freiburg3" in open_recording(root).notes[0]
    other = write_tum(tmp_path / "walk", shots(2))
    (other / "calibration.txt").unlink()
    recording = open_recording(other)
    assert "calibration.txt" in recording.notes[0]
    assert recording.cameras[0].pinhole == Pinhole(160, 120, 131.25, 131.25, 80.0, 60.0)


def test_time_that_runs_backwards_is_put_in_order_and_said(tmp_path: Path) -> None:
    root = write_tum(tmp_path / "walk", shots(3))
    lines = (root / "rgb.txt").read_text().splitlines()
    (root / "rgb.txt").write_text("\n".join(reversed(lines)))
    recording = open_recording(root)
    assert any("backwards" in note for note in recording.notes)
    times_s = [time_s or 0.0 for time_s in recording.timestamps_s]
    assert times_s == sorted(times_s)


def replaced_line(path: Path, line: int, text: str) -> None:
    lines = path.read_text().splitlines()
    lines[line] = text
    path.write_text("\n".join(lines))


def test_infinite_poses_are_left_out_and_counted(tmp_path: Path) -> None:
    scan = write_scannet(tmp_path / "scannet", shots(depth=DEPTH), DEPTH)
    (scan / "pose/1.txt").write_text("-inf -inf -inf -inf\n" * 4)
    stray = write_stray(tmp_path / "stray", shots(), intrinsics=True)
    replaced_line(stray / "odometry.csv", 2, "100, 000001, nan, nan, nan, nan, nan, nan, nan")
    record3d = write_record3d(tmp_path / "record3d", shots())
    for root in (scan, stray):
        recording = open_recording(root)
        assert len(recording) == 3
        assert recording.notes == ("1 frame without a finite pose left out",)
    assert len(open_recording(record3d)) == 4


def test_polycams_frames_that_were_not_corrected_are_left_out(tmp_path: Path) -> None:
    root = write_polycam(tmp_path / "scan", shots(), corrected=True)
    (root / "keyframes/corrected_cameras/5692384594.json").unlink()
    recording = open_recording(root)
    assert len(recording) == 3
    assert recording.notes == ("1 frame that Polycam did not correct left out",)
    plain = open_recording(write_polycam(tmp_path / "plain", shots(), corrected=False))
    assert "not corrected" in plain.notes[0]


@pytest.mark.parametrize(
    ("name", "file", "text", "says"),
    [
        ("tum", "groundtruth.txt", "100 0 0 0 0 0 0 2", "quaternion"),
        ("tum", "groundtruth.txt", "100 0 0 0", "need 8 values"),
        ("tum", "groundtruth.txt", "100 a b c d e f g", "numbers"),
        ("tum", "rgb.txt", "100 ../../etc/passwd", "outside"),
        ("tum", "rgb.txt", "", "lists no file"),
        ("tum", "calibration.txt", "525 525 320", "fx fy cx cy"),
        ("scannet", "pose/0.txt", "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1", "mirror"),
        ("scannet", "pose/0.txt", "1 0 0 0", "4x4"),
        ("scannet", "intrinsic/intrinsic_color.txt", "0 0 0 0\n" * 4, "focal"),
        ("polycam", "keyframes/corrected_cameras/5692384593.json", "{}", "missing"),
        ("polycam", "keyframes/corrected_cameras/5692384593.json", "[1", "json"),
        ("arkitscenes", "lowres_wide.traj", "100.0 1 2", "values"),
        ("arkitscenes", "lowres_wide.traj", "500.0 0 0 0 0 0 0", "no pose"),
        ("stray", "odometry.csv", "a, b\n1, 2", "columns"),
        ("stray", "rgb.mp4", "no video", "no video"),
        ("record3d", "metadata", "{}", "missing"),
        ("record3d", "rgbd/0.depth", "bvx2", "LZFSE"),
    ],
)
def test_bad_files_get_a_sentence_that_names_them(
    name: str, file: str, text: str, says: str, tmp_path: Path
) -> None:
    root = WRITERS[name](tmp_path / "48458663")
    (root / file).write_text(text)
    with pytest.raises(RecordingError, match=f"(?i){says}") as refused:
        opened_and_read(root)
    assert Path(file).name in str(refused.value)


def opened_and_read(root: Path) -> Recording:
    # Not by open_recording: on Python 3.11 the check of its type reads all depth.
    known = next(known for known in FORMATS if known.recognises(root))
    recording = known.open(root, Reading(), False)
    for index in range(len(recording)):
        recording.read(index)
    return recording


TEXTS = [
    ("tum", "groundtruth.txt"),
    ("tum", "rgb.txt"),
    ("tum", "calibration.txt"),
    ("scannet", "pose/0.txt"),
    ("scannet", "intrinsic/intrinsic_depth.txt"),
    ("polycam", "keyframes/corrected_cameras/5692384593.json"),
    ("arkitscenes", "lowres_wide.traj"),
    ("arkitscenes", "lowres_wide_intrinsics/48458663_100.000.pincam"),
    ("stray", "odometry.csv"),
    ("stray", "rgb.mp4"),
    ("record3d", "metadata"),
    ("record3d", "rgbd/0.depth"),
    ("record3d", "rgbd/0.conf"),
]


@pytest.mark.parametrize(("name", "file"), TEXTS)
def test_arbitrary_and_damaged_bytes_never_crash(name: str, file: str, tmp_path: Path) -> None:
    root = WRITERS[name](tmp_path / "48458663")
    sound = (root / file).read_bytes()

    @settings(
        max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
    @given(
        st.one_of(
            st.binary(max_size=200),
            st.text(max_size=80).map(str.encode),
            st.integers(0, len(sound)).map(lambda end: sound[:end]),
            st.tuples(st.integers(0, len(sound) - 1), st.binary(min_size=1, max_size=4)).map(
                lambda cut: sound[: cut[0]] + cut[1] + sound[cut[0] + len(cut[1]) :]
            ),
        )
    )
    def tried(data: bytes) -> None:
        (root / file).write_bytes(data)
        with contextlib.suppress(PeakingError):  # anything else is a crash
            opened_and_read(root)

    tried()


def test_a_few_bytes_do_not_unpack_to_gigabytes(tmp_path: Path) -> None:
    import lzfse  # pyright: ignore

    root = write_record3d(tmp_path / "scan", shots())
    bomb = bytes(lzfse.compress(bytes(64_000_000)))  # pyright: ignore
    assert stated_bytes(bomb) == 64_000_000
    assert len(bomb) < 100_000
    (root / "rgbd/0.depth").write_bytes(bomb)
    with pytest.raises(RecordingError, match="64000000 bytes unpacked"):
        opened_and_read(root)
    metadata = json.loads((root / "metadata").read_text())
    (root / "metadata").write_text(json.dumps({**metadata, "dw": 1_000_000, "dh": 1_000_000}))
    with pytest.raises(RecordingError, match="dw"):
        open_recording(root)
