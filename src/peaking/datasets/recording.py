"""What a recording is to everybody who uses one: posed frames in the order they were taken.

A format is one file beside this one, with a class that has these members and a line in
`datasets/registry.py`. Nothing outside that file knows how the format looks on disk.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.frame import Frame
from peaking.geometry import Camera

MIRROR, GLASS, MOVING, OVEREXPOSED = 1, 2, 3, 4
"""Labels of `Recording.materials`; 0 is everything else."""


@runtime_checkable
class Recording(Protocol):
    """Posed pictures, some with depth, opened and checked; pixels are read when asked for."""

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    @property
    def path(self) -> Path:
        """The file or folder that errors about the whole recording name."""
        ...

    @property
    def format(self) -> str:
        """What people call its format."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """Sentences about what was left out, or guessed, when it was opened."""
        ...

    @property
    def names(self) -> Sequence[str]:
        """Unique names of the frames that are good as file names."""
        ...

    @property
    def cameras(self) -> Sequence[Camera]:
        """Full-size cameras in metres, without distortion."""
        ...

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """Times in seconds, None where the recording has none."""
        ...

    @property
    def has_depth(self) -> Sequence[bool]:
        """Which frames have depth: a map in which anything is known."""
        ...

    def __len__(self) -> int:
        """Return how many frames there are."""
        ...

    def read(self, index: int) -> Frame:
        """Decode one frame: picture, camera, and depth or tracked points where there are any.

        Raises:
            IndexError: There is no such frame.
            RecordingError: One of its files cannot be used.
        """
        ...

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return width and height of a frame's depth map, without decoding it; None without one."""
        ...

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return the exact depth of a drawn scene, 0 where it does not count; else None.

        It has any size of the picture's aspect.
        """
        ...

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return what each pixel of a drawn scene shows: `MIRROR`, `GLASS`, …; else None."""
        ...

    def group(self, index: int) -> str | None:
        """Return what a frame of a drawn scene is for ("view", "beside", …); else None."""
        ...

    def fingerprint(self) -> str:
        """Return a short name that changes with what the recording holds."""
        ...

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse beforehand what `write_subset` would refuse to copy.

        Raises:
            RecordingError: One of the frames' files is reached by a link that leaves the recording,
                or is of a kind whose metadata cannot be removed.
        """
        ...

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> Recording:
        """Write some frames as a data set in nerfstudio's format, and return it opened.

        Every frame says which one of this recording it was. What was written is read back and
        compared; `out` appears only when it is complete.

        Args:
            indices: Of the frames, in the order in which they are written.
            out: The folder, new or empty.
            follow_links: Copy also what links lead to from outside the recording.
            keep_exif: Keep metadata of the pictures: when, where and with what they were taken.

        Raises:
            ValueError: No indices, one twice, or one that is no frame.
            RecordingError: A file of the recording cannot be read or is reached by a link that
                leaves it, or its metadata cannot be removed.
            OutputError: `out` is taken, full or not writable.
        """
        ...
