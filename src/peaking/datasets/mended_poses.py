"""A recording whose poses were mended; how, is found once and kept in the user's cache."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from jaxtyping import Float32, UInt8

from peaking.datasets import nerfstudio
from peaking.datasets.cache import made_once
from peaking.datasets.found_poses import read_kept, shown_progress
from peaking.datasets.nerfstudio_writer import WrittenFrame, write_frames
from peaking.datasets.recording import Recording
from peaking.errors import CamerasNotFound, RecordingError
from peaking.frame import Frame
from peaking.geometry import Cam, Camera, Rigid, World
from peaking.poses.colmap import shrunk_for_features
from peaking.poses.refine import refine_cameras

_REFINED = "refined.json"
_NAMED = 3


@dataclass(frozen=True)
class Residual:
    """How far matches of a picture lie from epipolar lines, in pixels, in the median.

    Attributes:
        name: Of the frame.
        before_px: With the recorded poses, None: nothing tells.
        after_px: With those that are used.
    """

    name: str
    before_px: float | None
    after_px: float | None

    def words(self) -> str:
        """Say both."""
        if self.before_px is None or self.before_px == self.after_px:
            return f"{self.after_px:.2f} px"
        return f"{self.before_px:.2f} → {self.after_px:.2f} px"


class Mended(msgspec.Struct, frozen=True):
    """What was found, as it is kept."""

    is_better: bool
    poses: list[list[list[float]]]
    """World from camera, of every frame."""
    words: str
    before_px: list[float]
    after_px: list[float]
    """Residual of each frame, -1 where none is known."""


def refined(recording: Recording) -> RefinedRecording:
    """Return a recording with mended poses, or as it is, with a note, where that does not help.

    Raises:
        BackendUnavailable: pycolmap is not installed.
        RecordingError: Its pictures cannot be used, or too little can be matched.
    """

    def make(folder: Path) -> None:
        frames = [shrunk_for_features(recording.read(i)) for i in range(len(recording))]
        try:
            with shown_progress() as progress:
                found = refine_cameras(frames, progress=progress)
        except CamerasNotFound as error:
            remedy = "give it without --refine"
            raise RecordingError(recording.path, str(error), remedy=remedy) from error
        poses = [camera.world_from_cam.matrix().tolist() for camera in found.cameras]
        before, after = (
            np.nan_to_num(px, nan=-1.0).tolist() for px in (found.before_px, found.after_px)
        )
        mended = Mended(found.is_better, poses, found.words(), before, after)
        (folder / _REFINED).write_bytes(msgspec.json.encode(mended))

    folder = made_once(recording.path, "refined", make, options=recording.fingerprint())
    return RefinedRecording(recording, read_kept(folder / _REFINED, Mended))


@dataclass(frozen=True, eq=False)
class RefinedRecording:
    """A recording seen from other poses (`datasets.recording.Recording`)."""

    recorded: Recording
    """As it was."""
    mended: Mended
    """The poses, where they are better."""

    def __len__(self) -> int:
        return len(self.recorded)

    @property
    def name(self) -> str:
        """As it was."""
        return self.recorded.name

    @property
    def path(self) -> Path:
        """As it was."""
        return self.recorded.path

    @property
    def format(self) -> str:
        """As it was."""
        return self.recorded.format

    @property
    def notes(self) -> Sequence[str]:
        """Those that there were, what became of the poses, and which fit least."""
        known = [one for one in self.residuals if one.after_px is not None]
        worst = sorted(known, key=lambda one: -(one.after_px or 0.0))[:_NAMED]
        named = ", ".join(f"{one.name} {one.words()}" for one in worst)
        least = [f"farthest off: {named}"] if worst else []
        return (*self.recorded.notes, self.mended.words, *least)

    @property
    def residuals(self) -> Sequence[Residual]:
        """How far matches that took no part lie off, of each frame."""
        mended = self.mended
        return tuple(
            Residual(name, before if before >= 0 else None, after if after >= 0 else None)
            for name, before, after in zip(
                self.names, mended.before_px, mended.after_px, strict=True
            )
        )

    @property
    def names(self) -> Sequence[str]:
        """As they were."""
        return self.recorded.names

    @property
    def cameras(self) -> Sequence[Camera]:
        """At the mended poses."""
        return self._cameras

    @cached_property
    def _cameras(self) -> tuple[Camera, ...]:
        if not self.mended.is_better:
            return tuple(self.recorded.cameras)
        return tuple(
            replace(camera, world_from_cam=Rigid[World, Cam].from_matrix(np.array(pose)))
            for camera, pose in zip(self.recorded.cameras, self.mended.poses, strict=True)
        )

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """As they were."""
        return self.recorded.timestamps_s

    @property
    def has_depth(self) -> Sequence[bool]:
        """As it was."""
        return self.recorded.has_depth

    def read(self, index: int) -> Frame:
        """Decode one frame, as it was but for its pose."""
        return replace(self.recorded.read(index), camera=self.cameras[index])

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return it as it was."""
        return self.recorded.depth_size_px(index)

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return it as it was."""
        return self.recorded.true_depth_m(index)

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return them as they were."""
        return self.recorded.materials(index)

    def group(self, index: int) -> str | None:
        """Return it as it was."""
        return self.recorded.group(index)

    def fingerprint(self) -> str:
        """Return another one than before, where poses were mended."""
        was = self.recorded.fingerprint()
        if not self.mended.is_better:
            return was
        return hashlib.sha256(f"{was}:{self.mended.poses}".encode()).hexdigest()[:24]

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse what would be refused before."""
        self.recorded.check_subset(indices, follow_links=follow_links, keep_exif=keep_exif)

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> Recording:
        """Write some frames as a data set in nerfstudio's format, at the mended poses.

        Pictures are encoded anew, straight, and without metadata.

        Raises:
            ValueError: No indices, one twice, or one that is no frame.
            RecordingError: A file cannot be read, or is reached by a link that leaves the
                recording.
            OutputError: `out` is taken, full or not writable.
        """
        if not self.mended.is_better:
            return self.recorded.write_subset(
                indices, out, follow_links=follow_links, keep_exif=keep_exif
            )
        if len(indices) == 0 or len(set(indices)) != len(indices):
            raise ValueError(f"need at least one index and none twice, got {list(indices)}")
        if min(indices) < 0 or max(indices) >= len(self):
            raise ValueError(f"need indices in 0..{len(self) - 1}, got {list(indices)}")
        self.check_subset(indices, follow_links=follow_links, keep_exif=keep_exif)
        write_frames((WrittenFrame(self.read(i), None, int(i)) for i in indices), out)
        return nerfstudio.open_recording(out)
