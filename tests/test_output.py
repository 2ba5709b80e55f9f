from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.errors import OutputError, RecordingError
from peaking.output import complete_or_absent, encode_jpeg, encode_png, write_atomically

JPEG_TOLERANCE = 1.0
"""Mean absolute levels of a smooth picture at quality 95; measured 0.57."""


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*"))


def test_a_finished_folder_appears_whole(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    with complete_or_absent(out) as folder:
        (folder / "images").mkdir()
        (folder / "images/a.txt").write_bytes(b"a")
        assert folder.parent == out.parent
        assert folder.name.startswith(".out.partial-")
        assert not out.exists()
    assert (out / "images/a.txt").read_bytes() == b"a"
    assert left_in(tmp_path / "new") == ["a.txt", "images", "out"]


def test_an_empty_folder_is_taken_over(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with complete_or_absent(tmp_path / "out") as folder:
        (folder / "a").write_bytes(b"a")
    assert left_in(tmp_path) == ["a", "out"]


def test_a_link_to_an_empty_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with complete_or_absent(tmp_path / "link") as folder:
        (folder / "a").write_bytes(b"a")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real/a").read_bytes() == b"a"


@pytest.mark.parametrize(
    "fault",
    [
        KeyboardInterrupt(),
        SystemExit(1),
        RuntimeError("x"),
        RecordingError(Path("r"), "p", remedy="m"),
        FileNotFoundError(errno.ENOENT, "gone", "/elsewhere/a.png"),
        PermissionError(errno.EACCES, "denied", "/elsewhere/a.png"),
    ],
    ids=lambda fault: type(fault).__name__,
)
def test_nothing_is_left_when_the_block_fails(tmp_path: Path, fault: BaseException) -> None:
    out = tmp_path / "made" / "too" / "out"

    def fill() -> None:
        with complete_or_absent(out) as folder:
            (folder / "a").write_bytes(b"a")
            raise fault

    with pytest.raises(type(fault)) as caught:
        fill()
    assert caught.value is fault
    assert left_in(tmp_path) == []


def test_parents_that_others_use_stay(tmp_path: Path) -> None:
    def fill() -> None:
        with complete_or_absent(tmp_path / "made" / "out"):
            (tmp_path / "made" / "theirs").write_bytes(b"")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fill()
    assert left_in(tmp_path) == ["made", "theirs"]


def test_taken_places_are_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full/a").write_bytes(b"theirs")
    (tmp_path / "file").write_bytes(b"theirs")
    cases = {
        "full": "not empty",
        "file": "is a file",
        "file/below": "below something",
        "/": "empty",
    }
    cases["x" * 300] = "too long"
    before = left_in(tmp_path)
    for name, problem in cases.items():
        with pytest.raises(OutputError, match=problem), complete_or_absent(tmp_path / name):
            pytest.fail("the block must not run")
    assert left_in(tmp_path) == before


def test_a_folder_that_fills_up_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    def fill() -> None:
        with complete_or_absent(tmp_path / "out"):
            (tmp_path / "out").mkdir()
            (tmp_path / "out/theirs").write_bytes(b"theirs")

    with pytest.raises(OutputError, match="meanwhile"):
        fill()
    assert left_in(tmp_path) == ["out", "theirs"]


def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    def fill() -> None:
        with complete_or_absent(tmp_path / "made" / "out") as folder:
            (folder / "a").write_bytes(b"a")
            (folder / "b").symlink_to("/dev/full")  # answers every write with ENOSPC
            (folder / "b").write_bytes(b"b")

    with pytest.raises(OutputError, match=r"out: no room: .* MB free\).*free some space"):
        fill()
    assert left_in(tmp_path) == []


def test_a_disk_that_is_full_only_when_flushed_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def fill() -> None:
        with complete_or_absent(tmp_path / "out") as folder:
            (folder / "a").write_bytes(b"a")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="no room"):
        fill()
    with pytest.raises(OutputError, match="no room"):
        write_atomically(tmp_path / "file", b"a")
    assert left_in(tmp_path) == []


def test_the_system_refusing_more_bytes_leaves_nothing(tmp_path: Path) -> None:
    program = """
import resource, sys
from pathlib import Path
from peaking.errors import OutputError
from peaking.output import complete_or_absent, write_atomically
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
def fill():
    with complete_or_absent(Path(sys.argv[1]) / "folder") as folder:
        (folder / "small").write_bytes(bytes(900))
        (folder / "large").write_bytes(bytes(9000))
for write in (fill, lambda: write_atomically(Path(sys.argv[1]) / "file", bytes(9000))):
    try:
        write()
    except OutputError as error:
        print(error)
"""
    command = [sys.executable, "-c", program, str(tmp_path)]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout.count("no room") == 2
    assert left_in(tmp_path) == []


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.EPERM])
def test_places_that_may_not_be_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refuse(path: Path, *_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number), str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    monkeypatch.setattr(Path, "write_bytes", refuse)
    monkeypatch.setattr(Path, "unlink", refuse)  # so does a disk that is mounted read-only
    for out in (tmp_path / "out", tmp_path / "made" / "out"):
        with pytest.raises(OutputError, match="not writable"), complete_or_absent(out):
            pytest.fail("the block must not run")
    with pytest.raises(OutputError, match="not writable"):
        write_atomically(tmp_path / "file", b"a")
    assert left_in(tmp_path) == []


def test_folders_are_for_their_owner_only(tmp_path: Path) -> None:
    with complete_or_absent(tmp_path / "out") as folder:
        (folder / "photo.jpg").write_bytes(b"a")
    assert (tmp_path / "out").stat().st_mode & 0o077 == 0


def test_a_file_is_replaced_in_one_step(tmp_path: Path) -> None:
    path = tmp_path / "made" / "a.json"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert left_in(tmp_path) == ["a.json", "made"]


def test_the_old_file_stays_when_writing_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    write_atomically(tmp_path / "a", b"old")
    monkeypatch.setattr(Path, "replace", stop)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "a", b"new")
    assert (tmp_path / "a").read_bytes() == b"old"
    assert left_in(tmp_path) == ["a"]
    with pytest.raises(OutputError, match="is a folder"):
        write_atomically(tmp_path, b"")


def test_encoded_pictures_decode_to_themselves() -> None:
    rows, columns = np.mgrid[0:32, 0:48]
    rgb = np.stack([5 * columns, 7 * rows, 255 - 4 * columns], axis=-1).astype(np.uint8)
    depth_mm = (100 * rows + columns).astype(np.uint16)
    png = cv2.imdecode(np.frombuffer(encode_png(rgb), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.asarray(png)[..., ::-1], rgb)
    png = cv2.imdecode(np.frombuffer(encode_png(depth_mm), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(np.asarray(png), depth_mm)
    jpeg = cv2.imdecode(np.frombuffer(encode_jpeg(rgb), np.uint8), cv2.IMREAD_COLOR)
    difference = np.abs(np.asarray(jpeg)[..., ::-1].astype(float) - rgb)
    assert difference.mean() < JPEG_TOLERANCE
