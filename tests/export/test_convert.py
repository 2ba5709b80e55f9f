"""`peaking convert` as people run it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import peaking.commands.scenes
from exported import export, jpeg_room, room
from foreign_pictures import telling_jpeg
from peaking.cli import main
from peaking.datasets import open_recording
from peaking.errors import RecordingError
from peaking.export.names import DATASET_FORMATS, DatasetFormat
from peaking.pictures.metadata import has_metadata
from peaking.splat.gaussians import Gaussians
from peaking.splat.ply import read_ply, write_ply


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must end with code 2; return its last line."""
    with pytest.raises(SystemExit) as ended:
        main(["convert", *arguments])
    assert ended.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


def test_a_recording_is_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = room(tmp_path / "room")
    arguments = ["--to", "nerfstudio", "--frames", "0:6:2", "--pixels", "768", "--up", "auto"]
    main(["convert", str(source), str(tmp_path / "new/out"), *arguments])
    said = capsys.readouterr().out
    assert "up is -y" in said
    assert "3 of 6 frames; pictures, poses, intrinsics and 1,998 points were read back" in said
    written = open_recording(tmp_path / "new/out")
    assert [camera.pinhole.size_px for camera in written.cameras] == [(32, 24)] * 3
    assert list(written.names) == ["frame_00000", "frame_00002", "frame_00004"]
    ups = [-camera.world_from_cam.rotation[:, 1] for camera in written.cameras]
    np.testing.assert_allclose(ups, [[0, 0, 1]] * 3, atol=1e-9)
    assert (tmp_path / "new/out").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("to", ("nerfstudio", "instant-ngp", "tum"))
def test_what_is_converted_twice_stays_the_same(to: DatasetFormat, tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    export(recording, tmp_path / "out", to)
    again = open_recording(tmp_path / "out")
    assert len(again) == 6
    for number in range(6):
        before, after = recording.read(number), again.read(number)
        off = before.camera.world_from_cam.matrix() - after.camera.world_from_cam.matrix()
        assert np.abs(off).max() < (1e-6 if to == "tum" else 1e-12)
        assert after.camera.pinhole == before.camera.pinhole
        np.testing.assert_array_equal(after.rgb, before.rgb)
        assert before.depth_m is not None
        assert after.depth_m is not None
        assert np.abs(after.depth_m - before.depth_m).max() < 0.00051


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["room", "out"], "need --to, one of nerfstudio, colmap, "),
        (["room", "out", "--to", "tum", "--pixels", "12"], "--pixels of at least 256"),
        (["room", "out", "--to", "llff", "--up", "+y"], "--up is for nerfstudio and instant-ngp"),
        (["room", "out", "--to", "tum", "--frames", "7"], "has no frames '7' among its 6"),
        (["nowhere", "out", "--to", "tum"], "does not exist"),
        (["a.ply", "b.spz", "--to", "tum"], "take no --to"),
        (["a.ply", "b.spz", "--up", "auto"], "need --up as an axis"),
        (["a.ply", "b.obj"], "ends in one of .ply, .compressed.ply, .spz, .glb, .gltf"),
    ],
)
def test_wrong_arguments_are_named_and_nothing_is_written(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    room(tmp_path / "room")
    write_ply(tmp_path / "a.ply", _three())
    monkeypatch.chdir(tmp_path)
    assert message in fails(arguments, capsys)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ply", "room"]


def _three() -> Gaussians:
    rng = np.random.default_rng(0)

    def drawn(*size: int) -> np.ndarray:
        return rng.normal(size=size).astype(np.float32)

    return Gaussians(drawn(3, 3), drawn(3, 3), drawn(3, 4), drawn(3), drawn(3, 4, 3) / 5)


def test_a_taken_folder_is_refused_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def not_yet(*_: Any, **__: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(peaking.commands.scenes.SceneOptions, "open", not_yet)
    source = room(tmp_path / "room")
    assert "is not empty" in fails([str(source), str(source), "--to", "colmap"], capsys)


def test_gaussians_are_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ply(tmp_path / "a.ply", _three())
    for ending in (".glb", ".spz", ".gltf", ".compressed.ply"):
        main(["convert", str(tmp_path / "a.ply"), str(tmp_path / f"b{ending}")])
        main(["convert", str(tmp_path / f"b{ending}"), str(tmp_path / f"c{ending}.ply")])
        got = read_ply(tmp_path / f"c{ending}.ply").means_m
        order = np.abs(got[:, None] - _three().means_m[None]).sum(axis=2).argmin(axis=0)
        np.testing.assert_allclose(got[order], _three().means_m, atol=2e-3)
    assert "3 Gaussians" in capsys.readouterr().out
    main(["convert", str(tmp_path / "a.ply"), str(tmp_path / "z.glb"), "--up", "+y"])
    main(["convert", str(tmp_path / "z.glb"), str(tmp_path / "z.ply"), "--up", "-y"])
    np.testing.assert_array_equal(read_ply(tmp_path / "z.ply").means_m, _three().means_m)


@pytest.mark.parametrize("keep", (False, True))
def test_metadata_of_pictures_stays_here_unless_kept(*, keep: bool, tmp_path: Path) -> None:
    source = jpeg_room(tmp_path / "room")
    for path in (source / "images").glob("*.jpg"):
        path.write_bytes(telling_jpeg(path.read_bytes()))
    out = tmp_path / "out"
    main(["convert", str(source), str(out), "--to", "colmap", *(["--keep-exif"] if keep else [])])
    pictures = list((out / "images").iterdir())
    assert len(pictures) == 6
    assert {has_metadata(path.read_bytes()) for path in pictures} == {keep}


def test_links_that_leave_the_recording_are_followed_when_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = room(tmp_path / "room")
    picture = source / "images/frame_00001.png"
    picture.rename(tmp_path / "elsewhere.png")
    picture.symlink_to(tmp_path / "elsewhere.png")
    said = fails([str(source), str(tmp_path / "out"), "--to", "tum"], capsys)
    assert "link that leaves the recording" in said
    assert not (tmp_path / "out").exists()
    main(["convert", str(source), str(tmp_path / "out"), "--to", "tum", "--follow-links"])


BESIDE = Path(__file__).parent.parent.parent.parent / "shared/data"
RECORDINGS = sorted(path.parent for path in BESIDE.glob("*/transforms.json"))


@pytest.mark.parametrize("to", DATASET_FORMATS)
@pytest.mark.parametrize("folder", RECORDINGS, ids=lambda path: path.name)
def test_real_recordings_are_written_as_they_are(
    folder: Path, to: DatasetFormat, tmp_path: Path
) -> None:
    """The check on writing compares poses, intrinsics, pictures, depth and points."""
    recording = open_recording(folder)
    indices = range(0, len(recording), max(1, len(recording) // 12))
    if to == "llff" and folder.name == "ngp_fox_rgb":  # it has neither depth nor points
        with pytest.raises(RecordingError, match="how far away"):
            export(recording, tmp_path / "out", to, indices=indices)
        return
    exported = export(recording, tmp_path / "out", to, indices=indices)
    assert exported.frames == len(indices)
    assert exported.checked_points >= (300 if folder.name == "ngp_fox_rgb" else 1000)
