"""A file where a folder is wanted: every command names it as it was given, and says what to do."""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path

import pytest

from peaking.cli import main
from recordings import write_recording

COMMANDS = (
    "serve {} --adb --port 0",
    "demo --sessions {} --no-open --port 0",
    "demo {} --no-open --port 0",
    "devices {}",
    "study init {}",
    "study serve {} --local --port 0",
    "study serve {} --adb --port 0",
    "study analyse {} --out new",
    "study simulate --participants 2 --out {}",
    "study export {} P01 --out new.zip",
    "study erase {} P01 --yes",
    "replay {} --out new",
    "replay room --no-video --out {}",
    "select {} --out new",
    "select room --views 2 --out {}",
    "evaluate {} --out new",
    "evaluate room --out {}",
    "generate room --out {}/view.mpi",
    "splat {} --out new.ply",
    "splat room --out {}/new.ply",
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Generator[None, None, None]:
    """A folder with a recording and a file, where every command is run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    write_recording(tmp_path / "room", num_frames=6, width_px=64, height_px=48)
    Path("file").write_text("hello\n")
    before = os.umask(0o022)
    yield
    os.umask(before)


@pytest.mark.parametrize("place", ["file", "file/below"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_is_no_folder(
    here: None, command: str, place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(command.format(place).split())
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    last = said.strip().splitlines()[-1]
    assert last.startswith(f"peaking: {place}")
    assert "; " in last  # and what to do
    assert "devices.json" not in last
    assert Path("file").read_text() == "hello\n"
