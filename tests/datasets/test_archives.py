"""Zips of recordings: opened as what they hold, and refused where they would do harm."""

from __future__ import annotations

import functools
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.test_videos import written
from peaking.datasets import Recording, open_recording
from peaking.datasets.archive import unpacked
from peaking.datasets.cache import KEPT_DAYS, cache_folder, made_once
from peaking.errors import RecordingError
from recordings import write_recording


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKING_CACHE", str(tmp_path / "cache"))


def zipped(folder: Path, path: Path, *, below: str = "") -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, below + file.relative_to(folder).as_posix())
    return path


@pytest.mark.parametrize("below", ["", "room/", "export/of/room/"])
def test_a_zip_opens_as_the_recording_in_it(tmp_path: Path, below: str) -> None:
    folder = tmp_path / "room"
    write_recording(folder, num_frames=3)
    path = zipped(folder, tmp_path / "walk.zip", below=below)
    plain, packed = open_recording(folder), open_recording(path)
    assert [c.position_m.tolist() for c in packed.cameras] == [
        c.position_m.tolist() for c in plain.cameras
    ]
    assert (packed.read(2).rgb == plain.read(2).rgb).all()
    assert unpacked(path) == unpacked(path)
    assert packed.name == (below.split("/")[-2] if below else "walk")


def test_a_changed_zip_is_unpacked_again(tmp_path: Path) -> None:
    write_recording(tmp_path / "three", num_frames=3)
    write_recording(tmp_path / "four", num_frames=4)
    path = zipped(tmp_path / "three", tmp_path / "walk.zip")
    assert len(open_recording(path)) == 3
    zipped(tmp_path / "four", path)
    assert len(open_recording(path)) == 4


def test_what_is_wrong_in_a_zip_names_the_zip(tmp_path: Path) -> None:
    folder = tmp_path / "room"
    write_recording(folder, num_frames=3)
    (folder / "images/frame_00001.png").write_bytes(b"\x89PNG\r\n\x1a\n no picture")
    path = zipped(folder, tmp_path / "walk.zip", below="room/")
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    assert caught.value.path == path / "room/images/frame_00001.png"
    assert str(cache_folder()) not in str(caught.value)


def test_what_is_found_wrong_later_names_the_zip_too(tmp_path: Path) -> None:
    folder = tmp_path / "room"
    write_recording(folder, num_frames=3)
    data = (folder / "images/frame_00001.png").read_bytes()
    (folder / "images/frame_00001.png").write_bytes(data[:-200])
    recording = open_recording(zipped(folder, tmp_path / "walk.zip"))
    assert recording.path == tmp_path / "walk.zip"

    def written_out() -> object:
        return recording.write_subset([1], tmp_path / "out")

    for act in (functools.partial(recording.read, 1), written_out):
        with pytest.raises(RecordingError) as caught:
            act()
        assert str(caught.value).startswith(f"{tmp_path}/walk.zip/images/frame_00001.png: ")
    assert isinstance(recording, Recording)


def test_a_zip_of_a_file_that_is_a_recording(tmp_path: Path) -> None:
    """A video among other files, and a table of cameras whose pictures are elsewhere."""
    pictures = [np.full((48, 64, 3), level, np.uint8) for level in range(0, 200, 40)]
    written(tmp_path / "clip.mp4", pictures)
    path = stored(
        tmp_path / "walk.zip",
        {"a/readme.txt": b"hello", "a/clip.mp4": (tmp_path / "clip.mp4").read_bytes()},
    )
    with pytest.raises(RecordingError, match=r"walk\.zip/a/clip\.mp4: shows the same place"):
        open_recording(path)


def stored(path: Path, names: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in names.items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ({"../out.txt": b"x"}, "outside"),
        ({"a/../../out.txt": b"x"}, "outside"),
        ({"/etc/out.txt": b"x"}, "outside"),
        ({"C:/out.txt": b"x"}, "outside"),
        ({"a": b"x", "a/b": b"y"}, "twice"),
        ({"bomb": bytes(300_000_000)}, "unpacked"),
        ({"notes.txt": b"hello"}, "no recording"),
    ],
)
def test_what_should_not_be_unpacked_is_refused(
    tmp_path: Path, names: dict[str, bytes], says: str
) -> None:
    path = stored(tmp_path / "walk.zip", names)
    with pytest.raises(RecordingError, match=says):
        open_recording(path)
    assert not (tmp_path / "out.txt").exists()


def test_a_link_in_a_zip_is_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("transforms.json")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "walk.zip", "w") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(RecordingError, match="link"):
        open_recording(tmp_path / "walk.zip")


def test_what_is_cut_off_leaves_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "room"
    write_recording(folder, num_frames=3)
    path = zipped(folder, tmp_path / "walk.zip")
    data = path.read_bytes()
    for length in (10, len(data) // 2, len(data) - 30):
        path.write_bytes(data[:length])
        with pytest.raises(RecordingError, match=r"walk\.zip"):
            open_recording(path)
    damaged = bytearray(data)
    damaged[len(data) // 2] ^= 0xFF
    path.write_bytes(damaged)
    with pytest.raises(RecordingError):
        open_recording(path).read(1)
    left = [file for file in cache_folder().rglob("*") if file.is_file()]
    assert left == []


@settings(max_examples=60, deadline=None)
@given(data=st.binary(max_size=300))
def test_arbitrary_bytes_are_refused_in_a_sentence(
    data: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("bytes") / "walk.zip"
    path.write_bytes(b"PK\x03\x04" + data)
    with pytest.raises(RecordingError, match=r"walk\.zip"):
        open_recording(path)


def test_what_was_made_is_made_once_and_removed_when_nobody_used_it(tmp_path: Path) -> None:
    source = tmp_path / "clip"
    source.write_bytes(b"a")
    made: list[Path] = []

    def make(folder: Path) -> None:
        made.append(folder)
        (folder / "result").write_text("done", encoding="utf-8")

    first = made_once(source, "poses", make, now_s=lambda: 1e9)
    assert made_once(source, "poses", make, now_s=lambda: 1e9) == first
    assert len(made) == 1
    assert made_once(source, "poses", make, options="finer", now_s=lambda: 1e9) != first
    os.utime(first / ".used", (1e9, 1e9))
    later_s = 1e9 + (KEPT_DAYS + 1) * 86400
    made_once(source, "poses", make, options="coarser", now_s=lambda: later_s)
    assert not first.exists()


def test_what_was_interrupted_leaves_nothing(tmp_path: Path) -> None:
    source = tmp_path / "clip"
    source.write_bytes(b"a")

    def interrupted(folder: Path) -> None:
        (folder / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made_once(source, "poses", interrupted)
    assert [path for path in cache_folder().rglob("*") if path.is_file()] == []
