"""What was photographed in a drawn scene as a recording, in memory or as a folder."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.datasets import Recording, open_recording
from peaking.datasets.nerfstudio_writer import WrittenFrame, write_frames
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.photographers.body import Body
from peaking.photographers.sensor import take_frame
from peaking.photographers.session import seed_of, temperament_of
from peaking.photographers.tasks import TASKS, SceneName, open_scene
from peaking.photographers.walks import draw_walk

FRAMES_PER_S = 5.0
DEPTH_M = 1.5
"""How far away things are, for the blur of a walk."""


class PhotoRecording:
    """Frames in memory, as a `Recording`."""

    def __init__(self, name: str, frames: Sequence[Frame]) -> None:
        """Hold frames in the order in which they were taken."""
        self._name, self._frames = name, list(frames)

    @property
    def name(self) -> str:
        """What reports call it."""
        return self._name

    @property
    def path(self) -> Path:
        """It lies nowhere; this is its name."""
        return Path(self._name)

    @property
    def format(self) -> str:
        """It has none on disk."""
        return "in memory"

    @property
    def notes(self) -> Sequence[str]:
        """Nothing is left out."""
        return ()

    @property
    def names(self) -> Sequence[str]:
        """Unique names of the frames."""
        return [frame.name for frame in self._frames]

    @property
    def cameras(self) -> Sequence[Camera]:
        """Cameras in metres."""
        return [frame.camera for frame in self._frames]

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """Times in seconds."""
        return [frame.timestamp_s for frame in self._frames]

    @property
    def has_depth(self) -> Sequence[bool]:
        """Which frames have depth."""
        return [frame.depth_m is not None for frame in self._frames]

    def __len__(self) -> int:
        return len(self._frames)

    def read(self, index: int) -> Frame:
        """Return a frame.

        Raises:
            IndexError: There is no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"need a frame below {len(self)}, got {index}")
        return self._frames[index]

    def depth_size_px(self, index: int) -> tuple[int, int] | None:
        """Return width and height of a depth map."""
        depth_m = self.read(index).depth_m
        return None if depth_m is None else (depth_m.shape[1], depth_m.shape[0])

    def true_depth_m(self, index: int) -> Float32[np.ndarray, "h w"] | None:
        """Return None: exact depth is not kept."""
        return None

    def materials(self, index: int) -> UInt8[np.ndarray, "h w"] | None:
        """Return None: materials are not kept."""
        return None

    def group(self, index: int) -> str | None:
        """Return None: frames have no groups."""
        return None

    def fingerprint(self) -> str:
        """Return a name that changes with pictures and poses."""
        digest = hashlib.sha256(self._name.encode())
        for frame in self._frames:
            digest.update(frame.rgb.tobytes())
            digest.update(frame.camera.world_from_cam.matrix().tobytes())
        return digest.hexdigest()[:24]

    def check_subset(
        self, indices: Sequence[int], *, follow_links: bool = False, keep_exif: bool = False
    ) -> None:
        """Refuse nothing: there are no files."""

    def write_subset(
        self,
        indices: Sequence[int],
        out: Path,
        *,
        follow_links: bool = False,
        keep_exif: bool = False,
    ) -> Recording:
        """Write some frames in nerfstudio's format, and return them opened.

        Raises:
            ValueError: No indices, or one twice.
            OutputError: `out` is taken, full or not writable.
        """
        if not indices or len(set(indices)) < len(indices):
            raise ValueError(f"need different indices, at least one, got {list(indices)}")
        write_frames((WrittenFrame(self.read(i)) for i in indices), out)
        return open_recording(out)


def record_walk(scene: SceneName, photographer: int, *, seconds: float) -> PhotoRecording:
    """Film a walk that dwells, turns and returns, five frames a second, with a hand that shakes.

    Args:
        scene: Where.
        photographer: Whose walk, from 0.
        seconds: How long, > 0.
    """
    seed, temperament = seed_of(scene, photographer), temperament_of(photographer)
    walk = draw_walk(
        TASKS[scene],
        np.random.default_rng((*seed, 1)),
        seconds=seconds,
        speed_m_per_s=temperament.speed_m_per_s,
    )
    body = Body(TASKS[scene], temperament, walk, seed)
    frames: list[Frame] = []
    for number in range(int(seconds * FRAMES_PER_S)):
        shot = body.shot(number, number / FRAMES_PER_S, DEPTH_M)
        frames.append(take_frame(open_scene(scene), shot, seed))
        body.go_on(1 / FRAMES_PER_S)
    return PhotoRecording(f"{scene}-walk-{photographer}", frames)
