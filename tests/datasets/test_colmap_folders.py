"""COLMAP models: those that its own code writes, and what is wrong with those that it does not."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colmap_models import points_of, reconstruction, write_colmap
from peaking.datasets import Reading, colmap, open_recording
from peaking.datasets.colmap import lens_of
from peaking.datasets.colmap_model import ModelCamera, read_model
from peaking.errors import RecordingError
from peaking.geometry import Camera, Pinhole, Rigid
from written_formats import assert_only_these_axes_fit, misfit, png, shots

BENT = {
    "SIMPLE_PINHOLE": (140.0, 81.5, 58.0),
    "PINHOLE": (140.0, 142.0, 81.5, 58.0),
    "SIMPLE_RADIAL": (140.0, 81.5, 58.0, -0.08),
    "RADIAL": (140.0, 81.5, 58.0, -0.08, 0.02),
    "OPENCV": (140.0, 142.0, 81.5, 58.0, -0.08, 0.02, 0.003, -0.002),
    "FULL_OPENCV": (140.0, 142.0, 81.5, 58.0, 0.1, 0.02, 0.003, -0.002, 0.01, 0.2, 0.05, 0.01),
    "OPENCV_FISHEYE": (140.0, 142.0, 81.5, 58.0, 0.02, -0.01, 0.004, -0.001),
    "SIMPLE_RADIAL_FISHEYE": (140.0, 81.5, 58.0, 0.02),
    "RADIAL_FISHEYE": (140.0, 81.5, 58.0, 0.02, -0.01),
    "SIMPLE_FISHEYE": (140.0, 81.5, 58.0),
    "FISHEYE": (140.0, 142.0, 81.5, 58.0),
}
REFUSED = sorted(set(pycolmap.CameraModelId.__members__) - set(BENT) - {"INVALID"})


@pytest.mark.parametrize("text", [False, True], ids=["binary", "text"])
@pytest.mark.parametrize("place", ["sparse/0", "sparse", "colmap/sparse/0", ""])
def test_a_model_of_colmap_opens(tmp_path: Path, text: bool, place: str) -> None:
    taken = shots()
    recording = open_recording(write_colmap(tmp_path / "room", taken, text=text, place=place))
    assert recording.format == "colmap"
    assert recording.names == tuple(f"frame_{i}" for i in range(4))
    for index, shot in enumerate(taken):
        frame = recording.read(index)
        np.testing.assert_array_equal(frame.rgb, shot.rgb)
        matrix = frame.camera.world_from_cam.matrix()
        np.testing.assert_allclose(matrix, shot.world_from_cam, atol=1e-12)
        assert frame.camera.pinhole == shot.camera.pinhole
        assert frame.points_m is not None
        np.testing.assert_allclose(frame.points_m, points_of(shot), atol=1e-12)
        assert misfit(replace(frame, depth_m=shot.depth_m), recording.read(index ^ 1)) < 5


def test_a_folder_that_is_the_model_finds_its_pictures_above(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots())
    recording = open_recording(root / "sparse/0")
    assert recording.read(0).rgb.shape == (120, 160, 3)
    confined = open_recording(root / "sparse/0", confined=True)
    with pytest.raises(RecordingError, match="--images"):
        confined.read(0)


def test_pictures_elsewhere_are_named(tmp_path: Path) -> None:
    root = write_colmap(tmp_path / "model", shots(), pictures=None)
    alone = open_recording(root)
    assert len(alone) == 4
    assert any("--images" in note for note in alone.notes)
    with pytest.raises(RecordingError, match=r"frame_2\.png.*--images"):
        alone.read(2)
    for index, shot in enumerate(shots()):
        png(tmp_path / f"elsewhere/frame_{index}.png", shot.rgb)
    for confined in (False, True):
        reading = Reading(images=tmp_path / "elsewhere")
        recording = open_recording(root, reading, confined=confined)
        np.testing.assert_array_equal(recording.read(2).rgb, shots()[2].rgb)
    subset = recording.write_subset([0, 2], tmp_path / "out")
    assert subset.read(1).points_m is not None
    with pytest.raises(RecordingError, match="not a folder"):
        open_recording(root, Reading(images=tmp_path / "nowhere"))


def test_some_pictures_missing_are_counted(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots())
    (root / "images/frame_1.png").unlink()
    recording = open_recording(root)
    assert recording.names == ("frame_0", "frame_2", "frame_3")
    assert any(note.startswith("1 frame whose picture is not in") for note in recording.notes)


def test_smaller_pictures_take_scaled_intrinsics(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots(), pictures=None)
    for index, shot in enumerate(shots()):
        half = cv2.resize(shot.rgb, (80, 60), interpolation=cv2.INTER_AREA)
        png(root / f"images_2/frame_{index}.png", half)
    assert open_recording(root).cameras[0].pinhole == Pinhole(80, 60, 70.0, 71.0, 40.75, 29.0)
    png(root / "images_2/frame_0.png", np.zeros((80, 60, 3), np.uint8))
    with pytest.raises(RecordingError, match=r"cameras\.bin: camera 7: is for 160x120"):
        open_recording(root)


def test_names_are_in_the_order_of_their_numbers_and_keep_their_folders(tmp_path: Path) -> None:
    names = ["left/10.png", "right/9.png", "left/9.png", "right/10.png"]
    recording = open_recording(write_colmap(tmp_path, shots(), names=names))
    assert recording.names == ("00000_9", "00001_10", "00002_9", "00003_10")
    for index, source in enumerate((2, 0, 1, 3)):
        np.testing.assert_array_equal(recording.read(index).rgb, shots()[source].rgb)


def test_a_name_that_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    root = write_colmap(tmp_path / "a", shots(1), text=True)
    path = root / "sparse/0/images.txt"
    path.write_text(path.read_text().replace("frame_0.png", "../images/frame_0.png"))
    with pytest.raises(RecordingError, match="outside its folder"):
        open_recording(root)


def test_masks_beside_the_pictures_are_honoured(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots())
    mask = np.full((120, 160), 255, np.uint8)
    mask[:, :40] = 0
    png(root / "masks/frame_1.png.png", mask)
    png(root / "masks/frame_2.png", mask)
    recording = open_recording(root)
    masks = [recording.read(index).mask for index in range(4)]
    assert masks[0] is None
    assert masks[3] is None
    for found in masks[1:3]:
        assert found is not None
        np.testing.assert_array_equal(found, mask > 0)
    png(root / "masks/frame_3.png.png", np.full((160, 120), 255, np.uint8))
    with pytest.raises(RecordingError, match="120x160"):
        open_recording(root)


@pytest.mark.parametrize("dense", ["", "dense"])
def test_depth_of_a_dense_reconstruction_fits_with_no_other_axes(
    tmp_path: Path, dense: str
) -> None:
    place = "dense/sparse" if dense else "sparse"
    pictures = "dense/images" if dense else "images"
    taken = shots()
    root = write_colmap(tmp_path, taken, place=place, pictures=pictures)
    folder = root / dense / "stereo/depth_maps"
    folder.mkdir(parents=True)
    for index, shot in enumerate(taken):
        head = f"{shot.depth_m.shape[1]}&{shot.depth_m.shape[0]}&1&".encode()
        path = folder / f"frame_{index}.png.geometric.bin"
        path.write_bytes(head + shot.depth_m.astype("<f4").tobytes())
    recording = open_recording(root)
    assert all(recording.has_depth)
    assert_only_these_axes_fit(recording)
    path = folder / "frame_0.png.geometric.bin"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(RecordingError, match="cut off"):
        colmap.open_recording(root).read(0)
    path.write_bytes(b"999999&999999&1&")
    with pytest.raises(RecordingError, match="geometric"):
        open_recording(root)
    path.write_bytes(b"no depth")
    with pytest.raises(RecordingError, match="no depth map"):
        open_recording(root)


@pytest.mark.parametrize("model", BENT)
def test_a_lens_is_the_one_that_colmap_has(model: str) -> None:
    """A pixel of the straight picture shows what COLMAP's lens sees in the same direction."""
    lens = lens_of(ModelCamera(model, 160, 120, BENT[model]))
    theirs = pycolmap.Camera(model=model, width=160, height=120, params=list(BENT[model]))
    columns, rows = np.meshgrid(np.arange(160), np.arange(120))
    gradient = np.stack([columns, rows, np.zeros_like(rows)], axis=-1).astype(np.uint8)
    straight = lens.undistorted(gradient)
    rays = lens.pinhole.rays()
    wanted = np.asarray(theirs.img_from_cam(rays.reshape(-1, 3))).reshape(120, 160, 2) - 0.5
    inside = ((wanted > 1) & (wanted < np.array([158, 118]))).all(axis=-1)
    assert inside.mean() > 0.7
    np.testing.assert_allclose(straight[inside][:, :2], wanted[inside], atol=0.52)


@pytest.mark.parametrize("model", REFUSED)
def test_other_lenses_are_refused_with_what_to_do(tmp_path: Path, model: str) -> None:
    params = pycolmap.Camera.create_from_model_name(7, model, 140.0, 160, 120).params
    folder = tmp_path / "sparse"
    folder.mkdir()
    found = reconstruction(shots(1), ["a.png"], model=model, params=[float(p) for p in params])
    found.write_binary(str(folder))
    with pytest.raises(RecordingError, match=f"camera 7: {model}.*image_undistorter"):
        open_recording(tmp_path)


def test_a_lens_that_folds_is_refused(tmp_path: Path) -> None:
    params = (140.0, 142.0, 81.5, 58.0, -2.0, 0.0, 0.0, 0.0)
    bent = reconstruction(shots(1), ["a.png"], model="OPENCV", params=params)
    (tmp_path / "sparse").mkdir()
    bent.write_binary(str(tmp_path / "sparse"))
    png(tmp_path / "images/a.png", shots(1)[0].rgb)
    with pytest.raises(RecordingError, match="fold the picture; undistort"):
        open_recording(tmp_path)


def test_coordinates_on_the_earth_are_counted_from_a_point(tmp_path: Path) -> None:
    there_m = np.array([412345.0, 5412345.0, 231.0])
    taken = [
        replace(
            shot,
            camera=Camera(
                shot.camera.pinhole,
                Rigid(shot.camera.world_from_cam.rotation, shot.camera.position_m + there_m),
            ),
        )
        for shot in shots()
    ]
    root = write_colmap(tmp_path, taken)
    recording = open_recording(root)
    assert "(412345, 5412345, 231)" in recording.notes[-1]
    for index, shot in enumerate(shots()):
        frame = recording.read(index)
        np.testing.assert_allclose(frame.camera.position_m, shot.camera.position_m, atol=5e-9)
        assert frame.points_m is not None
        np.testing.assert_allclose(frame.points_m, points_of(shot), atol=5e-9)


def test_poses_that_are_not_finite_are_left_out_and_counted(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots(), text=True)
    path = root / "sparse/0/images.txt"
    lines = path.read_text().splitlines()
    heads = [n for n, line in enumerate(lines) if line.endswith(".png")]
    for n, bad in ((heads[0], "inf"), (heads[2], "nan")):
        words = lines[n].split()
        lines[n] = " ".join([*words[:5], bad, *words[6:]])
    path.write_text("\n".join(lines) + "\n")
    recording = open_recording(root)
    assert len(recording) == 2
    assert any("2 frames without a finite pose" in note for note in recording.notes)


def test_the_largest_of_several_models_is_read(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots(2), place="sparse/0")
    write_colmap(root, shots(4), place="sparse/1")
    recording = open_recording(root)
    assert len(recording) == 4
    assert any("of 2 models the largest is read, sparse/1" in note for note in recording.notes)


def test_a_model_without_points_opens(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots())
    (root / "sparse/0/points3D.bin").unlink()
    assert open_recording(root).read(0).points_m is None


@pytest.mark.parametrize("ending", ["bin", "txt"])
@pytest.mark.parametrize("name", ["cameras", "images", "points3D"])
def test_a_model_that_is_cut_off_anywhere_is_refused_or_read(
    tmp_path: Path, name: str, ending: str
) -> None:
    root = write_colmap(tmp_path, shots(2), text=ending == "txt")
    path = root / f"sparse/0/{name}.{ending}"
    data = path.read_bytes()
    steps = [*range(min(200, len(data))), *range(200, len(data), max(1, len(data) // 50))]
    for length in steps:
        path.write_bytes(data[:length])
        if ending == "bin":
            with pytest.raises(RecordingError, match=f"{name}\\.bin"):
                open_recording(root)
        else:  # whole lines may be missing there
            with contextlib.suppress(RecordingError):
                open_recording(root).read(0)


@settings(max_examples=80, deadline=None)
@given(
    name=st.sampled_from(["cameras", "images", "points3D"]),
    ending=st.sampled_from(["bin", "txt"]),
    data=st.one_of(
        st.binary(max_size=200),
        st.binary(max_size=120).map(lambda rest: b"\1\0\0\0\0\0\0\0" + rest),
        st.text("0123456789 .-\nPINHOLEa", max_size=120).map(str.encode),
    ),
)
def test_arbitrary_bytes_of_a_model_never_crash(
    tmp_path_factory: pytest.TempPathFactory, name: str, ending: str, data: bytes
) -> None:
    root = tmp_path_factory.mktemp("model")
    write_colmap(root, shots(1), text=ending == "txt")
    (root / f"sparse/0/{name}.{ending}").write_bytes(data)
    with contextlib.suppress(RecordingError):
        open_recording(root).read(0)


def test_ids_of_points_that_are_not_there_are_passed_over(tmp_path: Path) -> None:
    root = write_colmap(tmp_path, shots(2), text=True)
    path = root / "sparse/0/points3D.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:10]) + "\n")
    points_m = open_recording(root).read(0).points_m
    assert points_m is not None
    assert 0 < len(points_m) <= 10
    model = read_model(root / "sparse/0")
    assert model.points is not None
    np.testing.assert_array_equal(model.points.ids, np.sort(model.points.ids))
