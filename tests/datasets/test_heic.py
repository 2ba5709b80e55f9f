"""HEIC pictures: read upright, with EXIF's focal length. The files were written by libheif.

Both show the room from the first of four cameras, one of them stored lying on its side, with the
turn in EXIF and in the file's own transformation, as phones have it.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.datasets import open_recording
from peaking.datasets.photo_folder import _unplaced
from peaking.datasets.stored_images import picture_size_px, read_picture
from peaking.errors import RecordingError, ToolMissing
from peaking.pictures import decoding
from peaking.pictures.other_kinds import MISSING
from recordings import Room, lateral_cameras, write_recording

FILES = Path(__file__).parent / "heic"
ENCODED_TOLERANCE = 8.0
"""Levels, mean, of halved colours and quality 90; measured 5.4. A mirrored picture is 40 away."""


@pytest.mark.parametrize("name", ["upright", "turned"])
def test_it_is_read_upright(name: str) -> None:
    path = FILES / f"{name}.heic"
    expected = Room().photographed(lateral_cameras(4, 128, 96)[0])[0]
    assert picture_size_px(path) == (128, 96)
    rgb = read_picture(path)
    assert np.abs(rgb.astype(float) - expected).mean() < ENCODED_TOLERANCE
    photo = _unplaced(FILES, path.name, None)
    assert (photo.photograph.size_px, photo.orientation) == ((128, 96), 1)
    # 26 mm on a diagonal of 43.27 mm; the picture's is 160 px.
    assert photo.photograph.focal_px == pytest.approx(26 / 43.2666 * 160, rel=1e-4)


def test_a_recording_has_such_pictures(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "r", num_frames=4, width_px=128, height_px=96)
    top = json.loads((folder / "transforms.json").read_text())
    top["frames"][0]["file_path"] = "images/photo"
    (folder / "transforms.json").write_text(json.dumps(top))
    shutil.copy(FILES / "turned.heic", folder / "images/photo.heic")
    recording = open_recording(folder)
    expected = Room().photographed(lateral_cameras(4, 128, 96)[0])[0]
    assert np.abs(recording.read(0).rgb.astype(float) - expected).mean() < ENCODED_TOLERANCE


def test_without_the_extra_the_command_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    command = f"import sys; sys.exit({MISSING})"
    real = decoding.subprocess.run

    def without(_: object, **options: object) -> object:
        return real([sys.executable, "-c", command], **options)  # pyright: ignore

    monkeypatch.setattr(decoding.subprocess, "run", without)
    with pytest.raises(ToolMissing, match=r"pip install 'peaking\[heic\]'"):
        picture_size_px(FILES / "upright.heic")


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 5000), st.binary(min_size=1, max_size=40))
def test_damage_is_named(at: int, junk: bytes) -> None:
    whole = (FILES / "upright.heic").read_bytes()
    data = whole[:12] + (whole[:at] + junk + whole[at + len(junk) :])[12:]
    with contextlib.suppress(ValueError):
        decoding.heif_head(data)
        decoding.decode_elsewhere(data)


def test_a_cut_off_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "photo.heic"
    path.write_bytes((FILES / "upright.heic").read_bytes()[:3000])
    with pytest.raises(RecordingError, match=r"photo\.heic"):
        read_picture(path)
