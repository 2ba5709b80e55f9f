"""Links and paths in a recording: read where they are, handed on only from inside."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foreign_pictures import GPS, telling_png
from peaking.cli import main
from peaking.datasets import open_recording
from peaking.datasets.foreign_files import read_bytes
from peaking.errors import RecordingError
from peaking.output import encode_png
from peaking.server.recordings import PlayedRecording
from recordings import write_recording

SECRET = encode_png(np.full((48, 64, 3), 7, np.uint8))


def edit_json(folder: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    path = folder / "transforms.json"
    top = json.loads(path.read_text())
    edit(top)
    path.write_text(json.dumps(top))


def cloud(path: Path) -> Path:
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    path.write_text(head + "property float z\nend_header\n0 0 1\n")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = write_recording(tmp_path / "home" / "recording")
    (folder / "masks").mkdir()
    for number in range(4):
        (folder / f"masks/{number}.png").write_bytes(encode_png(np.ones((48, 64), np.uint8)))
    cloud(folder / "cloud.ply")
    edit_json(folder, lambda top: top.update(ply_file_path="cloud.ply"))
    edit_json(
        folder,
        lambda top: [f.update(mask_path=f"masks/{n}.png") for n, f in enumerate(top["frames"])],
    )
    return folder


LINKED = ["images/frame_00001.png", "depths/frame_00001.png", "masks/1.png", "cloud.ply"]


def moved_out(folder: Path, name: str, *, whole_folder: bool = False) -> None:
    """Put a file (or its folder) beside the recording, and a link in its place."""
    inside = folder / (name.split("/")[0] if whole_folder else name)
    outside = folder.parent / f"outside-{inside.name}"
    inside.rename(outside)
    inside.symlink_to(outside)


@pytest.mark.parametrize("name", LINKED)
@pytest.mark.parametrize("whole_folder", [False, True])
def test_a_link_that_leaves_is_read_but_not_copied(
    folder: Path, tmp_path: Path, name: str, whole_folder: bool
) -> None:
    moved_out(folder, name, whole_folder=whole_folder)
    recording = open_recording(folder)
    recording.read(1)
    for act in (
        lambda: recording.check_subset(range(4)),
        lambda: recording.write_subset([0, 1], tmp_path / "out"),
    ):
        with pytest.raises(RecordingError, match=r"link that leaves the recording.*--follow-links"):
            act()
    assert not (tmp_path / "out").exists()
    subset = recording.write_subset([0, 1], tmp_path / "out", follow_links=True)
    np.testing.assert_array_equal(subset.read(1).rgb, recording.read(1).rgb)
    assert not any(path.is_symlink() for path in (tmp_path / "out").rglob("*"))


@pytest.mark.parametrize("name", [*LINKED[:2], "transforms.json"])
@pytest.mark.parametrize("whole_folder", [False, True])
def test_a_link_that_leaves_is_not_served(folder: Path, name: str, whole_folder: bool) -> None:
    moved_out(folder, name, whole_folder=whole_folder and "/" in name)
    with pytest.raises(RecordingError, match="link that leaves") as caught:
        open_recording(folder, confined=True)
    assert caught.value.path.parent == (folder / name).parent


@pytest.mark.parametrize("name", LINKED[:2])
def test_a_link_that_comes_later_is_not_served(folder: Path, name: str) -> None:
    played = PlayedRecording("r", open_recording(folder, confined=True))
    assert played.photo(1)
    moved_out(folder, name)
    for act in (played.photo, played.depth):
        with pytest.raises(RecordingError, match="link that leaves"):
            act(1)
    assert played.photo(0)


def test_links_inside_are_no_matter(folder: Path, tmp_path: Path) -> None:
    (folder / "images/frame_00001.png").rename(folder / "kept.png")
    (folder / "images/frame_00001.png").symlink_to("../kept.png")
    (tmp_path / "shortcut").symlink_to(folder)
    for root in (folder, tmp_path / "shortcut"):
        recording = open_recording(root, confined=True)
        assert PlayedRecording("r", recording).photo(1)
        recording.write_subset([1], tmp_path / f"out of {root.name}")


def test_a_folder_of_a_similar_name_is_outside(folder: Path) -> None:
    beside = folder.with_name("recording2")
    beside.mkdir()
    (beside / "a.png").write_bytes(SECRET)
    (folder / "a.png").symlink_to(beside / "a.png")
    with pytest.raises(RecordingError, match="link that leaves"):
        read_bytes(folder / "a.png", within=folder)


def test_what_is_no_file_is_not_waited_for(folder: Path) -> None:
    os.mkfifo(folder / "pipe")
    with pytest.raises(RecordingError, match="is not a file"):
        read_bytes(folder / "pipe")


OUTSIDE = [
    *("/etc/passwd", "../secret.png", "images/../../secret.png", "..", "images/../..", "./../x"),
    *("C:\\secret.png", "c:secret.png", "..\\secret.png", "images\\..\\..\\x", "\\\\host\\x"),
    *("a\0b", "images/frame_00000.png\0", "//host/x"),
]
PATHS = [
    *("file_path", "depth_file_path", "depth_path", "mask_path", "ply_file_path"),
    *("exact_depth_file_path", "materials_file_path", "colmap_im_path", "anything_path"),
]


@pytest.mark.parametrize(
    "field",
    [
        {"train_filenames": ["images/frame_00000.png", "../x"]},
        {"other": {"deep": [{"depth_path": "/etc/passwd"}]}},
        {"mask_paths": {"left": "../x"}},
    ],
)
def test_no_path_leaves_the_recording_however_deep(folder: Path, field: dict[str, Any]) -> None:
    edit_json(folder, lambda top: top.update(field))
    with pytest.raises(RecordingError, match="points outside") as caught:
        open_recording(folder)
    assert caught.value.field in field


@pytest.mark.parametrize("key", PATHS)
@pytest.mark.parametrize("at_top", [False, True])
def test_no_path_leaves_the_recording(folder: Path, key: str, at_top: bool) -> None:
    (folder.parent / "secret.png").write_bytes(SECRET)
    whole = (folder / "transforms.json").read_text()
    for path in OUTSIDE:
        top = json.loads(whole)
        (top if at_top else top["frames"][1])[key] = path
        (folder / "transforms.json").write_text(json.dumps(top))
        with pytest.raises(RecordingError, match="points outside") as caught:
            open_recording(folder)
        assert str(caught.value.field).endswith(key)


@pytest.mark.parametrize("command", ["replay", "demo"])
def test_commands_say_how_links_are_allowed(
    folder: Path, tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    moved_out(folder, "images/frame_00002.png")
    more = {
        "replay": ["--out", str(tmp_path / "out"), "--no-video"],
        "demo": ["--no-open", "--sessions", str(tmp_path / "sessions"), "--port", "0"],
    }
    with pytest.raises(SystemExit) as caught:
        main([command, str(folder), *more[command]])
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert "frame_00002.png: is reached by a link that leaves the recording" in said
    assert "--follow-links" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["home"]


def test_a_replay_keeps_metadata_and_follows_links_when_it_is_told_so(
    folder: Path, tmp_path: Path
) -> None:
    path = folder / "images/frame_00000.png"
    told = telling_png(path.read_bytes())
    path.write_bytes(told)
    moved_out(folder, "images/frame_00000.png")
    out = tmp_path / "out"
    command = ["replay", str(folder), "--out", str(out), "--no-video", "--max-frames", "1"]
    main([*command, "--follow-links", "--keep-exif"])
    assert (out / "captured/images/frame_00000.png").read_bytes() == told
    main([*command[:3], str(tmp_path / "bare"), *command[4:], "--follow-links"])
    assert GPS not in (tmp_path / "bare/captured/images/frame_00000.png").read_bytes()
