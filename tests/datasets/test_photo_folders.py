"""Folders of photos as recordings: their order, EXIF, turns, and where COLMAP places them."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from datasets.test_videos import assert_cameras_agree
from peaking.datasets import open_recording
from peaking.datasets.photo_folder import _names, upright
from peaking.errors import RecordingError
from peaking.output import encode_jpeg
from peaking.pictures.exif import Exif, exif_of
from peaking.poses.structure import pairs_to_try

DESK = Path(__file__).parents[2] / "scenes" / "desk"


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKING_CACHE", str(tmp_path / "cache"))


def exif(orientation: int, focal_35mm: int, order: str = "<") -> bytes:
    """Return a block of EXIF with two directories."""
    head = (b"II" if order == "<" else b"MM") + struct.pack(f"{order}HI", 42, 8)
    first = struct.pack(f"{order}H", 2)
    first += struct.pack(f"{order}HHIHH", 0x0112, 3, 1, orientation, 0)
    first += struct.pack(f"{order}HHII", 0x8769, 4, 1, 38) + bytes(4)
    return head + first + struct.pack(f"{order}HHHIHHI", 1, 0xA405, 3, 1, focal_35mm, 0, 0)


def with_exif(data: bytes, block: bytes) -> bytes:
    body = b"Exif\0\0" + block
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]


@pytest.mark.parametrize("order", "<>")
def test_exif_tells_turn_and_focal_length(order: str) -> None:
    data = with_exif(encode_jpeg(np.zeros((30, 40, 3), np.uint8)), exif(6, 26, order))
    found = exif_of(data)
    assert found == Exif(6, 26.0)
    # 26 mm on a diagonal of 43.27 mm; the picture's is 5000 px.
    assert found.focal_px(4000, 3000) == pytest.approx(26 / 43.2666 * 5000, rel=1e-4)


def test_a_focal_length_on_the_sensor_is_used_where_film_is_not_named() -> None:
    assert Exif(1, None, 0.8).focal_px(4000, 3000) == pytest.approx(3200)
    assert Exif(1, None, 90.0).focal_px(4000, 3000) is None
    assert Exif().focal_px(4000, 3000) is None


@given(st.binary(max_size=120))
def test_any_exif_is_read_without_a_crash(block: bytes) -> None:
    exif_of(with_exif(b"\xff\xd8\xff\xd9", block))
    exif_of(with_exif(b"\xff\xd8\xff\xd9", exif(6, 26)[: len(block)] + block))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turns_are_those_of_opencvs_reader(orientation: int, tmp_path: Path) -> None:
    rgb = np.zeros((32, 48, 3), np.uint8)
    rgb[:16, :16] = 255
    rgb[16:, :16] = 120
    path = tmp_path / "photo.jpg"
    path.write_bytes(with_exif(encode_jpeg(rgb), exif(orientation, 26)))
    by_opencv = np.asarray(cv2.imread(str(path), cv2.IMREAD_COLOR))[:, :, ::-1]
    turned = upright(rgb, orientation)
    assert turned.shape == by_opencv.shape
    assert np.abs(turned.astype(int) - by_opencv).mean() < 3


def test_photos_are_in_natural_order(tmp_path: Path) -> None:
    for name in ("IMG_10.jpg", "IMG_9.jpg", "img_1.PNG", ".hidden.jpg", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    assert _names(tmp_path) == ["img_1.PNG", "IMG_9.jpg", "IMG_10.jpg"]


def test_photos_in_folders_alone_are_found(tmp_path: Path) -> None:
    for name in ("100CANON/IMG_2.JPG", "101CANON/IMG_1.JPG", "100CANON/IMG_10.JPG"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "100CANON/IMG_2.AAE").write_bytes(b"")
    expected = ["100CANON/IMG_2.JPG", "100CANON/IMG_10.JPG", "101CANON/IMG_1.JPG"]
    assert _names(tmp_path) == expected
    (tmp_path / "101CANON/poses.json").write_bytes(b"")
    assert _names(tmp_path) == [], "it holds something else"
    (tmp_path / "own.jpg").write_bytes(b"")
    assert _names(tmp_path) == ["own.jpg"]


def test_photos_of_two_sizes_and_turns_are_placed(tmp_path: Path) -> None:
    """Some are stored lying on their side, and some smaller: a camera each."""
    desk, folder = open_recording(DESK), tmp_path / "photos"
    indices = list(range(0, 48, 6))
    for place, index in enumerate(indices):
        rgb = desk.read(index).rgb
        if place >= 5:
            rgb = np.asarray(cv2.resize(rgb, (221, 480), interpolation=cv2.INTER_AREA), np.uint8)
        turned = np.ascontiguousarray(np.rot90(rgb)) if place % 2 else rgb
        data = with_exif(encode_jpeg(turned), exif(6 if place % 2 else 1, 21))
        inner = folder / f"10{place // 4}CANON"
        inner.mkdir(parents=True, exist_ok=True)
        (inner / f"p{place}.jpg").write_bytes(data)
    grey = np.full((639, 294, 3), 90, np.uint8)
    (folder / "101CANON/p9.jpg").write_bytes(encode_jpeg(grey))
    recording = open_recording(folder)
    assert recording.format == "photos"
    assert "1 of 9 pictures could not be placed: 101CANON/p9.jpg" in recording.notes[1]
    assert list(recording.names) == [f"p{place}" for place in range(len(indices))]
    assert {c.pinhole.size_px for c in recording.cameras} == {(294, 639), (221, 480)}
    assert_cameras_agree(recording, desk, indices)
    difference = recording.read(1).rgb.astype(int) - desk.read(indices[1]).rgb
    assert np.abs(difference).mean() < 20


def test_few_or_unlike_photos_say_what_to_do(tmp_path: Path) -> None:
    rng, folder = np.random.default_rng(0), tmp_path / "photos"
    folder.mkdir()
    for place in range(2):
        noise = rng.integers(0, 256, (48, 64, 3), np.uint8)
        (folder / f"{place}.jpg").write_bytes(encode_jpeg(noise))
    with pytest.raises(RecordingError, match=r"holds 2 pictures.*need at least 3"):
        open_recording(folder)
    (folder / "2.jpg").write_bytes(encode_jpeg(rng.integers(0, 256, (48, 64, 3), np.uint8)))
    with pytest.raises(RecordingError, match="could be joined"):
        open_recording(folder)
    (folder / "3.jpg").write_bytes(b"\xff\xd8 no picture")
    with pytest.raises(RecordingError, match=r"3\.jpg"):
        open_recording(folder)


def test_pictures_that_look_alike_are_paired_though_far_apart() -> None:
    """The 10th place is seen again at the end."""
    rng = np.random.default_rng(0)
    places = [rng.integers(0, 256, (60, 128)).astype(np.uint8) for _ in range(80)]
    seen = [*places, places[10]]
    pairs = pairs_to_try(seen, in_order=True, rng=rng)
    assert (10, 80) in pairs
    assert {(0, 1), (0, 8), (0, 16)} <= set(pairs)
    assert all(a < b for a, b in pairs)
    assert len(pairs) < 81 * 80 / 4
    assert len(pairs_to_try(places[:20], in_order=False, rng=rng)) == 190


def test_photos_that_links_lead_to_are_not_handed_on(tmp_path: Path) -> None:
    desk, elsewhere, folder = open_recording(DESK), tmp_path / "elsewhere", tmp_path / "photos"
    elsewhere.mkdir()
    folder.mkdir()
    for place, index in enumerate(range(0, 30, 6)):
        (folder / f"{place}.jpg").write_bytes(encode_jpeg(desk.read(index).rgb))
    (folder / "4.jpg").rename(elsewhere / "4.jpg")
    (folder / "4.jpg").symlink_to(elsewhere / "4.jpg")
    recording = open_recording(folder)
    with pytest.raises(RecordingError, match=r"4\.jpg: is reached by a link"):
        recording.check_subset([4])
    with pytest.raises(RecordingError, match=r"4\.jpg: is reached by a link"):
        open_recording(folder, confined=True).read(4)
