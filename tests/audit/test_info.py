"""`peaking info`: what it says of a recording, and of ones that are not as they should be."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from peaking.audit.facts import facts_of
from peaking.audit.words import dotted_map, lines_of
from peaking.cli import main
from peaking.datasets import open_recording
from peaking.datasets.stored_images import read_picture
from peaking.geometry import Camera, Rigid
from peaking.output import encode_png
from recordings import lateral_cameras, write_recording

DESK = Path(__file__).parent.parent.parent / "scenes/desk"


def line(lines: list[str], word: str) -> str:
    return next(line for line in lines if line.split()[0] == word)


def said_of(folder: Path) -> list[str]:
    recording = open_recording(folder)
    return lines_of(recording, facts_of(recording))


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("desk") / "desk"
    open_recording(DESK).write_subset(range(0, 56, 4), out)
    return out


def cameras(count: int = 14) -> list[Camera]:
    return lateral_cameras(count, 320, 240)


def test_a_sound_recording(desk: Path) -> None:
    lines = said_of(desk)
    assert lines[0] == "desk: nerfstudio, 14 frames"
    assert "294x639, focal length 347 px (46° across)" in line(lines, "pictures")
    assert "steps 0.0" in line(lines, "path")
    assert line(lines, "jumps").endswith("none")
    assert "+z" in line(lines, "up")
    assert "14 of 14 frames, 74x160, 8" in line(lines, "depth")
    assert "right: depth is 1.0" in line(lines, "unit") or "0.9" in line(lines, "unit")
    assert "none blurred" in line(lines, "sharpness")


def test_a_jump_a_blurred_and_a_dark_picture_are_named(tmp_path: Path) -> None:
    walked = cameras()
    here = walked[9].world_from_cam
    walked[9] = replace(
        walked[9],
        world_from_cam=Rigid(here.rotation, here.translation_m + np.array([0.0, 0.9, 0.0])),
    )
    write_recording(tmp_path / "room", cameras=walked)
    blurred, dark = (tmp_path / f"room/images/frame_0000{i}.png" for i in (4, 6))
    soft = cv2.GaussianBlur(read_picture(blurred), (0, 0), 3.0)
    blurred.write_bytes(encode_png(np.asarray(soft, dtype=np.uint8)))
    dark.write_bytes(encode_png(read_picture(dark) // np.uint8(2)))
    lines = said_of(tmp_path / "room")
    assert "before frame_00009" in line(lines, "jumps")
    assert "blurred beside pictures from nearby: frame_00004" in line(lines, "sharpness")
    assert "frame_00006" in line(lines, "exposure")


def test_depth_of_another_unit_is_called_wrong(desk: Path, tmp_path: Path) -> None:
    open_recording(desk).write_subset(range(14), tmp_path / "room")
    path = tmp_path / "room/transforms.json"
    fields = json.loads(path.read_text())
    path.write_text(json.dumps({**fields, "depth_unit_scale_factor": 0.0002}))
    assert "WRONG: depth is 0.2" in line(said_of(tmp_path / "room"), "unit")


def test_without_depth_the_scale_is_not_known(tmp_path: Path) -> None:
    write_recording(tmp_path / "room", cameras=cameras(), with_depth=False)
    lines = said_of(tmp_path / "room")
    assert line(lines, "depth").endswith("none")
    assert "not known" in line(lines, "scale")


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "room", cameras=cameras())
    found = tmp_path / "found.json"
    main(["info", str(tmp_path / "room"), "--json", str(found)])
    printed = capsys.readouterr().out
    assert "the path seen from above" in printed
    assert json.loads(found.read_text())["depth"]["frames"] == 14
    main(["info", str(tmp_path / "room"), "--quick"])
    assert "sharpness" not in capsys.readouterr().out


def test_a_path_is_drawn_to_scale() -> None:
    square = dotted_map(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]))
    assert len(square) == 16
    assert {len(row) for row in square} == {32}
    assert all(ord(row[0]) > 0x2800 for row in square)
    assert dotted_map(np.zeros((3, 2))) == [chr(0x2840)]
    flat = dotted_map(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert len(flat) == 1
    assert len(flat[0]) == 60
