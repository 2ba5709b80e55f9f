"""Pictures of a video, one after the other or any of them, decoded when they are asked for."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking.datasets.foreign_files import real_path
from peaking.datasets.video_choice import Shown
from peaking.errors import RecordingError
from peaking.pictures.too_costly import TooCostly, check_pixels

_AGAIN = "copy it again from the phone, or convert it: ffmpeg -i FILE -c:v libx264 -crf 12 OTHER"


class VideoFile:
    """A video that is read from where it was left; going back starts it anew.

    Pictures are as they are stored, or upright where the file notes a turn.
    """

    def __init__(self, path: Path, *, within: Path | None = None, upright: bool = False) -> None:
        """Open it, and read its size.

        Args:
            path: The file.
            within: A folder; links that lead out of it are refused.
            upright: Apply the turn that the file notes.

        Raises:
            RecordingError: It cannot be read, or is no video.
        """
        self.path, self._within, self._upright = path, within, upright
        self._lock = threading.Lock()
        self._capture, self._next = self._opened(), 0
        width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        try:
            check_pixels(width, height)
        except TooCostly as error:
            raise RecordingError(path, str(error), remedy=error.remedy) from error
        self.size_px = (width, height)
        self.stated_frames = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        """As the file states, which may be more than there are."""

    def read(self, index: int) -> UInt8[np.ndarray, "h w 3"]:
        """Decode a picture.

        Raises:
            RecordingError: It is damaged, or the video ends before it.
        """
        with self._lock:
            if index < self._next:
                self._capture.release()
                self._capture, self._next = self._opened(), 0
            while self._next < index and self._capture.grab():
                self._next += 1
            done, bgr = self._capture.read() if self._next == index else (False, None)
            if not done or bgr is None:
                raise RecordingError(
                    self.path, f"ends at, or is damaged in, picture {self._next}", remedy=_AGAIN
                )
            self._next += 1
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)

    def in_order(self, told: Callable[[int], None] = lambda index: None) -> Iterator[Shown]:
        """Decode all pictures from the first on, with their own times, up to where it is damaged.

        Args:
            told: Told the index of each.

        Raises:
            RecordingError: There is none, or a picture is too large.
        """
        capture, index = self._opened(), 0
        try:
            while True:
                done, bgr = capture.read()
                if not done:
                    break
                time_s = float(capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000
                rgb = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
                yield Shown(index, time_s, rgb)
                told(index)
                index += 1
        finally:
            capture.release()
        if index == 0:
            raise RecordingError(self.path, "holds no picture that can be decoded", remedy=_AGAIN)

    def _opened(self) -> cv2.VideoCapture:
        with real_path(self.path, within=self._within) as name, _hushed():
            capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG)
            opened = capture.isOpened() and capture.set(
                cv2.CAP_PROP_ORIENTATION_AUTO, float(self._upright)
            )
        if not opened or capture.get(cv2.CAP_PROP_FRAME_WIDTH) < 1:
            raise RecordingError(self.path, "is no video that can be decoded", remedy=_AGAIN)
        return capture


@contextlib.contextmanager
def _hushed() -> Generator[None]:
    """Let OpenCV and FFmpeg print nothing of a file that they cannot open."""
    before = cv2.utils.logging.setLogLevel(0)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read when the first video is opened
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


@dataclass(frozen=True)
class VideoPicture:
    """A picture of a video (`posed_frames.PictureSource`)."""

    video: VideoFile
    index: int

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.video.size_px

    @property
    def token(self) -> str:
        """Name and length of the video, and which picture."""
        path = self.video.path
        return f"{path.name}:{path.stat().st_size}:{self.index}"

    def read(self) -> UInt8[np.ndarray, "h w 3"]:
        """Decode it."""
        return self.video.read(self.index)

    def stored(self) -> bytes | None:
        """Return None: it has no file of its own."""
        return None
