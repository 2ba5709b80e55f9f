"""These need the program ffmpeg and fail without it: `make install` brings it."""

import json
import os
import re
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from replay_factories import plain

from patience import PATIENCE_S
from peaking.errors import OutputError, ToolMissing
from peaking.replay.video import VideoWriter, find_h264_encoder

# Of 0…255. Worst after coding red, green, blue and grey in YUV 4:2:0: 1 (libx264, crf 20).
COLOR_TOLERANCE = 4


def probe(path: Path) -> dict[str, object]:
    command = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(path)]
    streams = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)["streams"]
    assert len(streams) == 1
    return streams[0]


def decode(path: Path, size_px: tuple[int, int]) -> np.ndarray:
    command = ["ffmpeg", "-v", "error", "-i", str(path), "-vf", "scale=in_color_matrix=bt709"]
    raw = subprocess.run(
        [*command, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    )
    return np.frombuffer(raw.stdout, dtype=np.uint8).reshape(-1, size_px[1], size_px[0], 3)


def fake_ffmpeg(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    program = folder / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


def process_of(video: VideoWriter) -> subprocess.Popen[bytes]:
    assert video._running is not None
    return video._running.process


def kill(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()


def write_frames(path: Path, count: int) -> None:
    with VideoWriter(path, (640, 480), fps=30.0) as video:
        for _ in range(count):
            video.write(plain((640, 480), (1, 2, 3)))


LISTS_X264 = 'case "$*" in *-encoders*) echo " V....D libx264 H.264"; exit 0;; esac'


def test_the_file_is_h264_of_that_size_rate_and_length(tmp_path: Path) -> None:
    path = tmp_path / "odd name: 100%d.mp4"
    with VideoWriter(path, (64, 48), fps=12.5) as video:
        for level in range(20):
            video.write(plain((64, 48), (level * 10, 0, 0)))
    found = probe(path)
    assert found["codec_name"] == "h264"
    assert (found["width"], found["height"]) == (64, 48)
    assert found["nb_read_frames"] == "20"
    assert found["r_frame_rate"] == "25/2"
    assert (found["pix_fmt"], found["color_space"]) == ("yuv420p", "bt709")


def test_colors_survive(tmp_path: Path) -> None:
    colors = [(255, 0, 0), (0, 200, 0), (0, 0, 255), (128, 128, 128)]
    with VideoWriter(tmp_path / "a.mp4", (32, 32), fps=10.0) as video:
        for color in colors:
            video.write(plain((32, 32), color))
    decoded = decode(tmp_path / "a.mp4", (32, 32))
    away = np.abs(decoded.astype(int) - np.array(colors)[:, None, None]).max()
    assert away <= COLOR_TOLERANCE


def test_odd_sizes_are_padded(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "a.mp4", (33, 21), fps=30.0) as video:
        video.write(plain((33, 21), (9, 9, 9)))
    found = probe(tmp_path / "a.mp4")
    assert (found["width"], found["height"]) == (34, 22)


def test_the_index_stands_before_the_pictures(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "a.mp4", (32, 32), fps=30.0) as video:
        video.write(plain((32, 32), (9, 9, 9)))
    data = (tmp_path / "a.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_views_that_are_not_contiguous_are_written_as_they_look(tmp_path: Path) -> None:
    wide = np.zeros((32, 64, 3), dtype=np.uint8)
    wide[:, ::2] = (0, 0, 255)
    with VideoWriter(tmp_path / "a.mp4", (32, 32), fps=30.0) as video:
        video.write(wide[:, ::2, ::-1])
    decoded = decode(tmp_path / "a.mp4", (32, 32))
    assert np.abs(decoded[0].astype(int) - (255, 0, 0)).max() <= COLOR_TOLERANCE


def test_an_interrupted_replay_leaves_a_playable_file_and_no_process(tmp_path: Path) -> None:
    processes: list[subprocess.Popen[bytes]] = []

    def write() -> None:
        with VideoWriter(tmp_path / "a.mp4", (640, 480), fps=30.0) as video:
            processes.append(process_of(video))
            for _ in range(7):
                video.write(plain((640, 480), (200, 10, 10)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert processes[0].returncode == 0
    assert probe(tmp_path / "a.mp4")["nb_read_frames"] == "7"


def test_an_interrupt_in_the_middle_of_a_frame_leaves_the_frames_before_it(tmp_path: Path) -> None:
    def write() -> None:
        with VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0) as video:
            for _ in range(5):
                video.write(plain((64, 48), (200, 10, 10)))
            stdin = process_of(video).stdin
            assert stdin is not None
            stdin.write(b"\0" * 1000)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert probe(tmp_path / "a.mp4")["nb_read_frames"] == "5"


def test_ctrl_c_in_the_terminal_does_not_reach_ffmpeg(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0) as video:
        assert os.getpgid(process_of(video).pid) != os.getpgid(0)
        video.write(plain((64, 48), (1, 2, 3)))


def test_without_a_frame_there_is_no_file(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_failure_of_ffmpeg_is_told_with_what_it_said(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").mkdir()
    with pytest.raises(OutputError, match=r"^a\.mp4: ffmpeg stopped after \d+ frames: .*irectory"):
        write_frames(tmp_path / "a.mp4", 100)


def test_ffmpeg_dying_in_between_is_told(tmp_path: Path) -> None:
    def write() -> None:
        with VideoWriter(tmp_path / "a.mp4", (640, 480), fps=30.0) as video:
            video.write(plain((640, 480), (1, 2, 3)))
            kill(process_of(video))
            video.write(plain((640, 480), (1, 2, 3)))

    with pytest.raises(OutputError, match="ffmpeg stopped after 1 frames: exit code -9"):
        write()


def test_an_error_in_the_block_is_not_hidden_by_one_of_ffmpeg(tmp_path: Path) -> None:
    def write() -> None:
        with VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0) as video:
            video.write(plain((64, 48), (1, 2, 3)))
            kill(process_of(video))
            raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        write()


def test_a_talkative_ffmpeg_does_not_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    talk = "head -c 3000000 /dev/zero | tr '\\0' 'x' >&2; echo >&2; echo 'the reason' >&2"
    fake_ffmpeg(tmp_path, f"{LISTS_X264}\n{talk}\ncat > /dev/null\nexit 3", monkeypatch)
    told: list[OutputError] = []

    def write() -> None:
        try:
            write_frames(tmp_path / "a.mp4", 30)
        except OutputError as error:
            told.append(error)

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert re.search(r"stopped after 30 frames: x+ / the reason$", str(told[0]))
    assert len(str(told[0])) < 2200


def test_without_ffmpeg_the_remedy_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolMissing, match=r"apt install ffmpeg\) or run with --no-video"):
        VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0)


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ('echo " V..... mpeg4  MPEG-4 part 2"', "has no H.264 encoder"),
        ('case "$*" in *-encoders*) echo " V....D h264_nvenc";; *) exit 1;; esac', "has no H.264"),
        ("echo 'libx.so: not found' >&2; exit 127", "does not run .*libx.so: not found"),
    ],
)
def test_an_ffmpeg_that_cannot_do_it_is_told(
    script: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_ffmpeg(tmp_path, script, monkeypatch)
    with pytest.raises(ToolMissing, match=message):
        find_h264_encoder()


@pytest.mark.parametrize(
    ("listed", "chosen"),
    [
        ("libopenh264 libx264", "libx264"),
        ("h264_nvenc libopenh264", "libopenh264"),
        ("h264_nvenc", "h264_nvenc"),
    ],
)
def test_encoders_are_chosen_in_order(
    listed: str, chosen: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_ffmpeg(tmp_path, f'for e in {listed}; do echo " V....D $e words"; done', monkeypatch)
    assert find_h264_encoder().name == chosen


def test_wrong_arguments_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="need a size"):
        VideoWriter(tmp_path / "a.mp4", (0, 48), fps=30.0)
    with pytest.raises(ValueError, match="need fps > 0"):
        VideoWriter(tmp_path / "a.mp4", (64, 48), fps=float("nan"))
    with pytest.raises(OutputError, match="its folder does not exist"):
        VideoWriter(tmp_path / "none" / "a.mp4", (64, 48), fps=30.0)
    video = VideoWriter(tmp_path / "a.mp4", (64, 48), fps=30.0)
    with pytest.raises(ValueError, match="outside of the with block"):
        video.write(plain((64, 48), (1, 2, 3)))
    with pytest.raises(ValueError, match=r"need uint8 of shape \(48, 64, 3\)"), video:
        video.write(plain((48, 64), (1, 2, 3)))
