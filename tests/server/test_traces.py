"""Traces of phones: read whole, or refused in one sentence."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from capture_uploads import photo
from peaking import limits
from peaking.errors import RecordingError
from peaking.server import wire
from peaking.server.recordings import PlayedRecording
from peaking.server.traces import PlayedTrace
from server.test_app import client_of
from traced import DEPTH_MM, IDENTITY, frame, index, write_trace

PEAKING = "from peaking.cli import main; main()"


def test_a_trace_is_served_as_it_was_recorded(tmp_path: Path) -> None:
    played = PlayedTrace(write_trace(tmp_path / "a.zip"))
    with client_of(tmp_path, recordings={"a.zip": played}) as client:
        assert client.get("/api/v1/server").json()["recordings"] == ["a.zip"]
        path = "/api/v1/recordings/a.zip"
        told = client.get(path).json()
        assert (told["name"], told["frames"]) == ("a.zip", [])
        assert told["trace"] == json.loads(json.dumps(index()))
        assert client.get(f"{path}/frames/0/photo").content == photo(0)
        assert client.get(f"{path}/frames/0/depth").content == DEPTH_MM.tobytes()
        assert client.get(f"{path}/frames/3/photo").content == photo(3)
        for missing in ("1/photo", "2/photo", "3/depth", "4/photo"):
            assert client.get(f"{path}/frames/{missing}").status_code == 404


def refusal(path: Path) -> str:
    with pytest.raises(RecordingError) as raised:
        PlayedTrace(path)
    return str(raised.value)


def test_what_is_cut_off_is_refused_wherever_it_is(tmp_path: Path) -> None:
    whole = write_trace(tmp_path / "a.zip").read_bytes()
    cut = tmp_path / "cut.zip"
    for length in {0, 1, 4, 30, len(whole) - 1, *range(0, len(whole), len(whole) // 40)}:
        cut.write_bytes(whole[:length])
        assert "is cut off, or is no trace" in refusal(cut)


def test_what_is_garbled_is_refused_or_the_same(tmp_path: Path) -> None:
    path = write_trace(tmp_path / "a.zip")
    whole, sound = path.read_bytes(), PlayedTrace(path)
    generator = random.Random(1)
    for _ in range(200):
        garbled = bytearray(whole)
        garbled[generator.randrange(len(whole))] ^= 1 << generator.randrange(8)
        path.write_bytes(garbled)
        try:
            read = PlayedTrace(path)
        except RecordingError:
            continue
        assert (read.index, read.photo(0), read.depth(0), read.photo(3)) == (
            sound.index, sound.photo(0), sound.depth(0), sound.photo(3),
        )  # fmt: skip


@pytest.mark.parametrize(
    ("files", "changes", "says"),
    [
        ({"trace.json": None}, {}, "trace.json is not in it"),
        ({"trace.json": b"{}"}, {}, "version"),
        ({"trace.json": b'{"a":' + b"[" * 100_000}, {}, "nested too deep"),
        ({}, {"version": 2}, "is of version 2, and 1 can be read"),
        ({}, {"frames": []}, "frames"),
        ({}, {"frames": [frame(0, picture=None)]}, "has no picture"),
        ({}, {"frames": [frame(0, world_from_view=None)]}, "without a camera"),
        ({}, {"frames": [frame(0, world_from_view=[2.0, *IDENTITY[1:]])]}, "rotation"),
        ({}, {"frames": [frame(0, picture={"width_px": 9, "height_px": 9})]}, "another size"),
        ({"pictures/000003.jpg": None}, {}, "pictures/000003.jpg is not in it"),
        ({"pictures/000003.jpg": b"no picture"}, {}, "JPEG"),
        ({"depth/000000.bin": bytes(287)}, {}, "has 287 of 288 bytes"),
        ({"depth/000000.bin": bytes(10**8)}, {}, "depth/000000.bin is too large"),
        ({"trace.json": b" " * (limits.MAX_TRACE_INDEX_BYTES + 1)}, {}, "trace.json is too large"),
    ],
)
def test_what_is_foreign_is_refused_in_a_sentence(
    tmp_path: Path, files: dict[str, bytes | None], changes: dict[str, Any], says: str
) -> None:
    said = refusal(write_trace(tmp_path / "a.zip", files, **changes))
    assert says in said
    assert "/check" in said
    assert "\n" not in said


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "photo.zip"
    path.write_bytes(photo(0))
    assert "is cut off, or is no trace" in refusal(path)
    path.write_bytes(bytes(wire.MAX_TRACE_BYTES + 1))
    assert "has more than 25,000,000 bytes" in refusal(path)


def test_a_trace_unpacks_to_no_more_than_it_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MAX_TRACE_UNPACKED_BYTES", 1000)
    assert "is too large" in refusal(write_trace(tmp_path / "a.zip"))


def test_the_demo_refuses_in_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "peaking-trace.zip"
    path.write_bytes(write_trace(tmp_path / "a.zip").read_bytes()[:-9])
    done = subprocess.run(
        [sys.executable, "-c", PEAKING, "demo", str(path), "--no-open", "--port", "0"],
        capture_output=True, text=True, cwd=tmp_path, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "peaking-trace.zip: is cut off, or is no trace" in done.stderr


def test_a_recording_has_no_trace(tmp_path: Path) -> None:
    from peaking.datasets import open_recording

    desk = open_recording(Path(__file__).parents[2] / "scenes" / "desk")
    assert PlayedRecording("desk", desk).index.trace is None
