"""Writes pictures into an H.264 file by the program ffmpeg.

A program of its own rather than a library: the wheels that carry an H.264 encoder carry GPL code.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, cast

import numpy as np
from jaxtyping import UInt8

from peaking.errors import OutputError, ToolMissing

REMEDY = "install one (Debian and Ubuntu: apt install ffmpeg) or run with --no-video"

ENCODERS: dict[str, tuple[str, ...]] = {
    "libx264": ("-preset", "veryfast", "-crf", "20"),
    "libopenh264": ("-b:v", "6M"),
    "h264_videotoolbox": ("-b:v", "6M"),
    "h264_nvenc": ("-preset", "p4", "-cq", "22"),
}
"""H.264 encoders of ffmpeg in the order we want them, with settings of about the same quality.
Every ffmpeg lists the hardware ones; whether there is such hardware shows when they are tried."""

HARDWARE = frozenset({"h264_videotoolbox", "h264_nvenc"})

# ffmpeg guesses by size how RGB was turned into YUV, and players guess back, not always the same:
# so the matrix is chosen and written into the file. Odd sizes have no 4:2:0, hence the padding.
FILTERS = (
    "scale=out_color_matrix=bt709:out_range=tv,"
    "pad=width=ceil(iw/2)*2:height=ceil(ih/2)*2,"
    "format=yuv420p"
)
COLOR_TAGS = ("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709")

ENCODER_NICENESS = 15
"""Added to ffmpeg's, so that encoding waits for the work whose result it encodes."""

FINISH_TIMEOUT_S = 60.0
"""How long ffmpeg may take, after the last frame, to move the index to the front of the file."""


@dataclass(frozen=True)
class H264Encoder:
    """A program that encodes, and the name it has for its encoder."""

    program: str
    name: str

    @property
    def arguments(self) -> tuple[str, ...]:
        """Codec and quality, for ffmpeg's command line."""
        return ("-c:v", self.name, *ENCODERS[self.name])


def find_h264_encoder() -> H264Encoder:
    """Look for an ffmpeg on the PATH that has an H.264 encoder.

    Raises:
        ToolMissing: There is none.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        raise ToolMissing(f"the overlay video needs the program ffmpeg; {REMEDY}")
    listing = _run(program, "-encoders")
    if listing.returncode != 0:
        last = listing.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise ToolMissing(f"{program} does not run ({' '.join(last)}); {REMEDY}")
    # Lines look like " V....D libx264    libx264 H.264 / AVC (codec h264)".
    words = (line.split() for line in listing.stdout.decode(errors="replace").splitlines())
    listed = {word[1] for word in words if len(word) > 1}
    for name in ENCODERS:
        if name in listed and (name not in HARDWARE or _encodes(program, name)):
            return H264Encoder(program, name)
    raise ToolMissing(f"{program} has no H.264 encoder; {REMEDY}")


def _encodes(program: str, encoder: str) -> bool:
    source = ("-f", "lavfi", "-i", "color=size=256x256:duration=0.1")
    return _run(program, *source, "-c:v", encoder, "-f", "null", "-").returncode == 0


def _run(program: str, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    command = [program, "-hide_banner", "-nostdin", *arguments]
    try:
        return subprocess.run(command, capture_output=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolMissing(f"{program} does not run ({error}); {REMEDY}") from error


@dataclass(frozen=True)
class _Running:
    process: subprocess.Popen[bytes]
    stdin: IO[bytes]
    stderr: IO[bytes]


class VideoWriter:
    """Writes RGB pictures of one size into an MP4 file, as a context manager.

    Nothing is buffered here: `write` returns when ffmpeg has taken the frame. When the block is
    left by an exception, the frames so far are finished into a playable file. Without any frame
    there is no file.

    Example:
        with VideoWriter(Path("overlay.mp4"), (960, 740), fps=30.0) as video:
            video.write(picture)
    """

    def __init__(self, path: Path, size_px: tuple[int, int], *, fps: float) -> None:
        """Find the encoder, so that what is missing is missing before the work starts.

        Args:
            path: File to write; an old one is replaced.
            size_px: Width and height of every frame.
            fps: Frames per second.

        Raises:
            ToolMissing: There is no ffmpeg with an H.264 encoder.
            OutputError: The folder of `path` does not exist.
            ValueError: The size or the rate is not positive.
        """
        width, height = size_px
        if width < 1 or height < 1:
            raise ValueError(f"need a size of at least 1x1, got {width}x{height}")
        if not (math.isfinite(fps) and fps > 0):
            raise ValueError(f"need fps > 0, got {fps}")
        self.path = path
        self.size_px = size_px
        self.fps = fps
        self.frames = 0
        self.encoder = find_h264_encoder()
        self._running: _Running | None = None
        if not path.parent.is_dir():
            raise OutputError(f"{path}: its folder does not exist")

    def __enter__(self) -> VideoWriter:
        # A file rather than a pipe for stderr: nobody has to empty it, so nothing can block.
        stderr = tempfile.TemporaryFile()
        try:
            # A session of its own, so that Ctrl-C reaches us alone and we end the file in order.
            process = subprocess.Popen(
                self._command(),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                start_new_session=True,
            )
        except OSError as error:
            stderr.close()
            raise ToolMissing(f"{self.encoder.program} does not run ({error}); {REMEDY}") from error
        # The encoder has time; what is rendered meanwhile has not.
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, ENCODER_NICENESS)
        self._running = _Running(process, cast(IO[bytes], process.stdin), stderr)
        return self

    def _command(self) -> list[str]:
        width, height = self.size_px
        return [
            *(self.encoder.program, "-hide_banner", "-loglevel", "error", "-y"),
            *("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"),
            *("-framerate", f"{self.fps:.6g}", "-i", "pipe:0", "-an"),
            *("-vf", FILTERS, *self.encoder.arguments, *COLOR_TAGS),
            *("-threads", "2", "-movflags", "+faststart"),
            *("-f", "mp4", f"file:{self.path.resolve()}"),
        ]

    def write(self, frame: UInt8[np.ndarray, "h w 3"]) -> None:
        """Append a picture.

        Raises:
            OutputError: ffmpeg has given up (the disk is full, for example).
            ValueError: The picture has another size or type.
        """
        width, height = self.size_px
        if frame.shape != (height, width, 3) or frame.dtype != np.uint8:
            raise ValueError(
                f"need uint8 of shape {(height, width, 3)}, got {frame.dtype} of {frame.shape}"
            )
        if self._running is None:
            raise ValueError("write() outside of the with block")
        try:
            self._running.stdin.write(np.ascontiguousarray(frame).data)
        except ConnectionError as error:
            raise OutputError(self._failure(self._finish(self._running))) from error
        self.frames += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._running is None:  # write() has seen the failure and reported it
            return
        failure = self._finish(self._running)
        if self.frames == 0:
            self.path.unlink(missing_ok=True)
        elif failure is not None and error is None:
            raise OutputError(self._failure(failure))

    def _finish(self, running: _Running) -> str | None:
        """End ffmpeg; return None when the file is sound, else the last it said."""
        self._running = None
        process = running.process
        try:
            if self.frames == 0:
                process.kill()
            # Closing flushes, which fails if ffmpeg has gone; its exit code says so too.
            with contextlib.suppress(ConnectionError):
                running.stdin.close()
            try:
                code = process.wait(FINISH_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                return f"it did not finish within {FINISH_TIMEOUT_S:.0f} s"
            if code == 0:
                return None
            return _tail(running.stderr) or f"exit code {code}"
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
            running.stderr.close()

    def _failure(self, said: str | None) -> str:
        # The name alone: the folder may be one that gets its real name when all is done.
        if said and os.strerror(errno.ENOSPC) in said:
            return f"{self.path.name}: no room on the disk; free some space or write to another one"
        reason = " / ".join((said or "no reason given").splitlines())
        return f"{self.path.name}: ffmpeg stopped after {self.frames} frames: {reason}"


def _tail(stderr: IO[bytes]) -> str:
    """Return the last few lines of a file; one line may be long."""
    end = stderr.seek(0, os.SEEK_END)
    stderr.seek(max(0, end - 2000))
    lines = stderr.read().decode(errors="replace").strip().splitlines()
    return "\n".join(lines[-5:])
