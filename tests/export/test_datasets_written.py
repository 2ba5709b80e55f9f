"""What holds of data sets in every format."""

from __future__ import annotations

import contextlib
import gc
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import peaking.export.datasets
from exported import SIZE_PX, export, jpeg_room, masked_room, room
from peaking.datasets import open_recording
from peaking.datasets.nerfstudio import NerfstudioRecording
from peaking.errors import OutputError, RecordingError
from peaking.export.chosen_frames import frames_of_text
from peaking.export.material import Material
from peaking.export.names import DATASET_FORMATS, DatasetFormat
from peaking.export.writing import Written
from peaking.frame import Frame
from peaking.geometry import Camera, Rigid

DESK = Path(__file__).parents[2] / "scenes/desk"
ALL = pytest.mark.parametrize("to", DATASET_FORMATS)


@ALL
def test_a_room_is_written_and_read_back(to: DatasetFormat, tmp_path: Path) -> None:
    exported = export(room(tmp_path / "room"), tmp_path / "out", to)
    assert exported.frames == 6
    assert exported.checked_points > 1000


@ALL
def test_stored_pictures_are_copied_byte_for_byte(to: DatasetFormat, tmp_path: Path) -> None:
    def centred(content: dict[str, Any]) -> None:
        content.update(cx=SIZE_PX[0] / 2, cy=SIZE_PX[1] / 2)

    source = jpeg_room(tmp_path / "jpeg")
    if to == "llff":  # it has no principal point: any other picture is drawn again
        source = room(tmp_path / "centred", change=centred)
    export(source, tmp_path / "out", to)
    stored = sorted(path.read_bytes() for path in (source / "images").iterdir() if _used(path))
    folder = tmp_path / "out" / ("rgb" if to == "tum" else "images")
    assert sorted(path.read_bytes() for path in folder.iterdir()) == stored


def _used(path: Path) -> bool:
    return path.suffix == ".jpg" or not path.with_suffix(".jpg").exists()


@dataclass
class Counted:
    """Counts frames that are alive when another is read."""

    recording: NerfstudioRecording
    most: int = 0

    def __post_init__(self) -> None:
        self.pictures: list[weakref.ref[Any]] = []

    def read(self, index: int) -> Frame:
        gc.collect()
        self.most = max(self.most, sum(one() is not None for one in self.pictures))
        frame = self.recording.read(index)
        self.pictures.append(weakref.ref(frame))
        return frame

    def __len__(self) -> int:
        return len(self.recording)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.recording, name)


@ALL
def test_one_frame_at_a_time_is_in_memory(to: DatasetFormat, tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    assert isinstance(recording, NerfstudioRecording)
    counted: Any = Counted(recording)
    export(counted, tmp_path / "out", to)
    assert len(counted.pictures) >= 6
    assert counted.most <= 1


@ALL
def test_what_is_interrupted_leaves_nothing(to: DatasetFormat, tmp_path: Path) -> None:
    recording: Any = open_recording(room(tmp_path / "room"))

    class Interrupted(Counted):
        def read(self, index: int) -> Frame:
            if index == 3:
                raise KeyboardInterrupt
            return super().read(index)

    interrupted: Any = Interrupted(recording)
    with pytest.raises(KeyboardInterrupt):
        export(interrupted, tmp_path / "out", to)
    assert [path.name for path in tmp_path.iterdir()] == ["room"]


def _other_picture(folder: Path) -> None:
    pictures = sorted((folder / "images").iterdir())
    pictures[0].write_bytes(pictures[1].read_bytes())


def _other_depth(folder: Path) -> None:
    depths = sorted((folder / "depths").iterdir())
    depth = cv2.imread(str(depths[0]), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    depth[20, 20] += 1
    cv2.imwrite(str(depths[0]), depth)


SPOILT: list[tuple[Callable[[Path], None], str]] = [
    (_other_picture, "another picture"),
    (_other_depth, "other depth"),
]


@pytest.mark.parametrize(("spoil", "problem"), SPOILT, ids=lambda value: str(value)[:20])
def test_what_says_something_else_is_not_kept(
    spoil: Callable[[Path], None],
    problem: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    writer, most_off = peaking.export.datasets._WRITERS["nerfstudio"]

    def spoilt(material: Material, folder: Path) -> Written:
        written = writer(material, folder)
        spoil(folder)
        return written

    writers: Any = {"nerfstudio": (spoilt, most_off)}
    monkeypatch.setattr(peaking.export.datasets, "_WRITERS", writers)
    with pytest.raises(OutputError, match=problem):
        export(room(tmp_path / "room"), tmp_path / "out", "nerfstudio")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("by_m", "by_rad", "left_px", "problem"),
    [
        (2e-9, 0.0, 0, "a pose that is 2e-09 off"),
        (0.0, 1e-8, 0, "a pose that is 1e-08 off"),
        (0.0, 0.0, 1, "intrinsics"),
    ],
    ids=["moved", "turned", "other intrinsics"],
)
def test_cameras_that_are_off_are_found(
    by_m: float,
    by_rad: float,
    left_px: int,
    problem: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    writer, most_off = peaking.export.datasets._WRITERS["colmap"]

    def spoilt(material: Material, folder: Path) -> Written:
        written = writer(material, folder)
        name, camera = written.read[2]
        pinhole = camera.pinhole.cropped(left_px, 0, *SIZE_PX)
        turn = np.array([[1, -by_rad, 0], [by_rad, 1, 0], [0, 0, 1]])
        here = camera.world_from_cam
        moved = Rigid(here.rotation @ turn, here.translation_m + np.array([0, 0, by_m]))
        written.read[2] = name, Camera(pinhole, moved)
        return written

    writers: Any = {"colmap": (spoilt, most_off)}
    monkeypatch.setattr(peaking.export.datasets, "_WRITERS", writers)
    with pytest.raises(OutputError, match=problem):
        export(room(tmp_path / "room"), tmp_path / "out", "colmap")


@ALL
def test_pictures_intrinsics_and_depth_shrink_together(to: DatasetFormat, tmp_path: Path) -> None:
    source = room(tmp_path / "room")
    exported = export(source, tmp_path / "out", to, pixels=32 * 24, indices=[4, 0, 2])
    assert exported.frames == 3
    folder = tmp_path / "out" / ("rgb" if to == "tum" else "images")
    shapes = {cv2.imread(str(path)).shape for path in folder.iterdir()}  # type: ignore[union-attr]
    assert shapes == ({(23, 30, 3)} if to == "llff" else {(24, 32, 3)})
    for path in (tmp_path / "out").glob("depth*/*.png"):
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert depth is not None
        assert depth.shape == (24, 32)


def test_a_far_world_keeps_its_poses(tmp_path: Path) -> None:
    """UTM: 64 bits have a nanometre there, and half of that is not a fault."""

    def far(content: dict[str, Any]) -> None:
        for frame in content["frames"]:
            frame["transform_matrix"][0][3] += 500_000.0
            frame["transform_matrix"][1][3] += 5_400_000.0

    source = room(tmp_path / "room", change=far)
    for to in DATASET_FORMATS:
        assert export(source, tmp_path / to, to).frames == 6


@pytest.mark.parametrize("to", ("colmap", "nerfstudio", "instant-ngp", "llff"))
def test_masks_are_carried(to: DatasetFormat, tmp_path: Path) -> None:
    export(masked_room(tmp_path / "room"), tmp_path / "out", to)
    pattern = "images/dynamic_mask_*.png" if to == "instant-ngp" else "masks/*.png"
    found = sorted((tmp_path / "out").glob(pattern))
    assert len(found) == (6 if to == "nerfstudio" else 2)
    mask = cv2.imread(str(found[0 if to != "nerfstudio" else 1]), cv2.IMREAD_UNCHANGED)
    assert mask is not None
    left, right = mask[:, :24], mask[:, 40:]
    counts, not_counted = (right, left) if to != "instant-ngp" else (left, right)
    assert counts.all()
    assert not not_counted.any()
    if to in ("colmap", "llff"):
        pictures = {path.name for path in (tmp_path / "out/images").iterdir()}
        assert {path.name.removesuffix(".png") for path in found} <= pictures


def test_frames_are_named_as_people_would(tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    assert frames_of_text("1:5:2", recording) == [1, 3]
    assert frames_of_text(":", recording) == [0, 1, 2, 3, 4, 5]
    assert frames_of_text("5, 0,-1", recording) == [5, 0]
    for text in ("6", "9:", "a:b", "", "1:2:3:4", "::0", "1.5"):
        with pytest.raises(RecordingError, match="has no frames"):
            frames_of_text(text, recording)


@given(text=st.text(st.sampled_from("0123456789,:- ax"), max_size=12))
def test_any_text_means_frames_or_is_refused(text: str) -> None:
    recording = open_recording(DESK)
    with contextlib.suppress(RecordingError):
        chosen = frames_of_text(text, recording)
        assert chosen
        assert len(set(chosen)) == len(chosen)
        assert all(0 <= index < len(recording) for index in chosen)


def test_a_selection_is_read(tmp_path: Path) -> None:
    recording = open_recording(room(tmp_path / "room"))
    chosen = tmp_path / "selection.csv"
    head = "index,name,kept,reason,sharpness,worth_db\n"
    chosen.write_text(head + "0,frame_00000,0,blur,,\n3,frame_00003,1,chosen,1.0,2.0\n")
    assert frames_of_text(str(chosen), recording) == [3]
    chosen.write_text(head + "3,frame_00004,1,chosen,1.0,2.0\n")
    with pytest.raises(RecordingError, match="select from this recording"):
        frames_of_text(str(chosen), recording)
    for content in ("", head, "a,b\n1,2\n", head + "x,y,1\n"):
        chosen.write_text(content)
        with pytest.raises(RecordingError):
            frames_of_text(str(chosen), recording)
