"""Faults put into the frames of a recording, to see whether `peaking doctor` finds them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking.audit.examination import Examination, examine
from peaking.datasets import Recording
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid

BLUR_PX = 4.0 / 640
"""Half the length of a motion blur, over the longer side of the picture."""
DARKER, BRIGHTER, UNEVEN = 0.12, 3.0, 1.5
MOVED_M, TURNED_DEG = 0.03, 2.0
MOVED_SHARE = 0.22
"""Sides of what is moved, over those of the picture."""
FOCAL = 1.1
EVERY = 25
"""Of so many frames, one has each fault."""

SINGLE = (
    *("blurred", "dark", "clipped", "exposure", "moved by 3 cm", "turned by 2°"),
    *("swapped", "moved", "duplicate"),
)
WHOLE = ("intrinsics", "axes")
FOUND_AS: Mapping[str, tuple[str, ...]] = {
    "blurred": ("blurred",),
    "dark": ("dark",),
    "clipped": ("clipped", "exposure"),
    "exposure": ("exposure",),
    "moved by 3 cm": ("pose", "lost"),
    "turned by 2°": ("pose", "lost"),
    "swapped": ("swapped", "pose", "lost"),
    "moved": ("moved",),
    "duplicate": ("duplicate",),
}


@dataclass(frozen=True)
class Planted:
    """What was put where: a fault by the number of its frame; of swapped ones, both."""

    faults: Mapping[int, str]


class SpoiltRecording:
    """A recording, some frames of which, or all, have a fault; else as the one it is made of."""

    def __init__(
        self,
        recording: Recording,
        numbers: Sequence[int],
        faults: Mapping[int, str],
        seed: int,
        whole: str | None = None,
    ) -> None:
        """Take some frames of a recording and spoil them.

        Args:
            recording: The recording.
            numbers: Which of its frames there are.
            faults: What is wrong with which of these, by place in `numbers`.
            seed: Of directions and places.
            whole: What is wrong with all.
        """
        self._recording, self._numbers, self._faults = recording, list(numbers), dict(faults)
        self._seed = seed
        cameras = [recording.cameras[number] for number in numbers]
        swapped = [i for i, fault in self._faults.items() if fault == "swapped"]
        self._shown = list(range(len(numbers)))
        for one, other in zip(swapped[::2], swapped[1::2], strict=True):
            self._shown[one], self._shown[other] = other, one
        for i, fault in self._faults.items():
            if fault == "duplicate":
                self._shown[i] = i - 1
                cameras[i] = cameras[i - 1]
            elif fault in ("moved by 3 cm", "turned by 2°"):
                cameras[i] = _off(cameras[i], fault, np.random.default_rng((seed, i)))
        if whole is not None:
            cameras = [_WHOLE[whole](camera) for camera in cameras]
        self.cameras: Sequence[Camera] = cameras
        self.has_depth: Sequence[bool] = [recording.has_depth[number] for number in numbers]

    def __getattr__(self, name: str) -> object:
        return getattr(self._recording, name)

    def __len__(self) -> int:
        return len(self._numbers)

    @property
    def names(self) -> Sequence[str]:
        """Names of the frames."""
        return [self._recording.names[number] for number in self._numbers]

    @property
    def timestamps_s(self) -> Sequence[float | None]:
        """Times, as recorded."""
        return [self._recording.timestamps_s[number] for number in self._numbers]

    def read(self, index: int) -> Frame:
        """Return a frame with its fault."""
        frame = self._recording.read(self._numbers[self._shown[index]])
        rng = np.random.default_rng((self._seed, index, 1))
        spoilt = _PICTURES.get(self._faults.get(index, ""), lambda rgb, _: rgb)(frame.rgb, rng)
        return replace(frame, name=self.names[index], rgb=spoilt, camera=self.cameras[index])


def _off(camera: Camera, fault: str, rng: np.random.Generator) -> Camera:
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    pose = camera.world_from_cam
    if fault == "moved by 3 cm":
        place_m = pose.translation_m + MOVED_M * direction
        return replace(camera, world_from_cam=Rigid(pose.rotation, place_m))
    turn = np.asarray(cv2.Rodrigues(np.radians(TURNED_DEG) * direction)[0])  # pyright: ignore
    turned = pose.rotation @ turn
    return replace(camera, world_from_cam=Rigid(turned, pose.translation_m))


def _blurred(rgb: UInt8[np.ndarray, "h w 3"], rng: np.random.Generator) -> np.ndarray:
    half = max(2, round(BLUR_PX * max(rgb.shape[:2])))
    angle = rng.uniform(0, np.pi)
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for t in np.linspace(-half, half, 8 * half):
        row, column = round(half + t * np.sin(angle)), round(half + t * np.cos(angle))
        kernel[row, column] = 1.0
    return np.asarray(cv2.filter2D(rgb, -1, kernel / kernel.sum()), dtype=np.uint8)


def _times(factor: float) -> Callable[[np.ndarray, np.random.Generator], np.ndarray]:
    def scaled(rgb: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        by = factor if factor != UNEVEN or rng.random() < 0.5 else 1 / factor
        return np.clip(np.round(rgb.astype(np.float32) * by), 0, 255).astype(np.uint8)

    return scaled


def _moved(rgb: UInt8[np.ndarray, "h w 3"], rng: np.random.Generator) -> np.ndarray:
    """Copy a part of the picture to another place, as if it had been carried there."""
    height, width = rgb.shape[:2]
    h, w = round(MOVED_SHARE * height), round(MOVED_SHARE * width)
    tried: list[tuple[float, tuple[slice, slice], np.ndarray]] = []
    for _ in range(20):
        (top, to_top), (left, to_left) = (
            rng.integers(0, height - h, 2),
            rng.integers(0, width - w, 2),
        )
        part = rgb[top : top + h, left : left + w]
        there = slice(to_top, to_top + h), slice(to_left, to_left + w)
        tried.append((float(np.abs(part.astype(np.float64) - rgb[there]).mean()), there, part))
    _, there, part = max(tried, key=lambda one: one[0])  # what is seen to have moved
    spoilt = rgb.copy()
    spoilt[there] = part
    return spoilt


def _noisy(rgb: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    noise = rng.normal(0, 2, rgb.shape)
    return np.clip(np.round(rgb + noise), 0, 255).astype(np.uint8)


def _longer(camera: Camera) -> Camera:
    k = camera.pinhole
    longer = Pinhole(*k.size_px, FOCAL * k.fx_px, FOCAL * k.fy_px, k.cx_px, k.cy_px)
    return replace(camera, pinhole=longer)


def _mirrored(camera: Camera) -> Camera:
    mirror = np.diag([-1.0, 1.0, 1.0])
    pose = camera.world_from_cam
    return replace(
        camera, world_from_cam=Rigid(mirror @ pose.rotation @ mirror, mirror @ pose.translation_m)
    )


_PICTURES: Mapping[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "blurred": _blurred,
    "dark": _times(DARKER),
    "clipped": _times(BRIGHTER),
    "exposure": _times(UNEVEN),
    "moved": _moved,
    "duplicate": _noisy,
}
_WHOLE: Mapping[str, Callable[[Camera], Camera]] = {"intrinsics": _longer, "axes": _mirrored}


@dataclass(frozen=True)
class Found:
    """How many of the faults put in were found, by kind, and how much else was called wrong.

    Attributes:
        planted: How many pictures got each fault.
        found: How many of them were found as what they are.
        others: Pictures without a fault.
        flagged: How many of them something is said of.
        flagged_before: Pictures of the recording as it is that something is said of.
        frames: Of the recording.
        whole: Whether faults of the whole were found, by kind.
    """

    planted: dict[str, int]
    found: dict[str, int]
    others: int
    flagged: int
    flagged_before: int
    frames: int
    whole: dict[str, bool]


def plant(count: int, seed: int, kinds: Sequence[str]) -> dict[int, str]:
    """Return which of so many frames get which fault; none of two neighbours have one."""
    rng = np.random.default_rng((seed, 7))
    each = max(1, count // EVERY)
    free = [int(i) for i in 1 + 2 * rng.permutation((count - 1) // 2)]
    faults: dict[int, str] = {}
    for kind in kinds:
        for _ in range(2 * each if kind == "swapped" else each):
            if free:
                faults[free.pop()] = kind
    swapped = [i for i, kind in faults.items() if kind == "swapped"]
    if len(swapped) % 2:
        del faults[swapped[-1]]
    return faults


def found_faults(recording: Recording, *, most: int, seed: int) -> Found:
    """Spoil a recording in every way, and count what is found.

    Args:
        recording: The recording.
        most: Frames of it that are taken, at even steps.
        seed: Of what is put where.
    """
    numbers = np.unique(np.linspace(0, len(recording) - 1, min(most, len(recording))).round())
    some = [int(number) for number in numbers]
    kinds = [kind for kind in SINGLE if kind != "moved" or any(recording.has_depth)]
    faults = plant(len(some), seed, kinds)
    before = examine(SpoiltRecording(recording, some, {}, seed))  # type: ignore[arg-type]
    after = examine(SpoiltRecording(recording, some, faults, seed))  # type: ignore[arg-type]
    planted: dict[str, int] = {}
    found: dict[str, int] = {}
    for i, kind in faults.items():
        planted[kind] = planted.get(kind, 0) + 1
        found[kind] = found.get(kind, 0) + _is_found(after, i, kind)
    # Of two that show the same, either may be named.
    others = [i for i in range(len(some)) if i not in faults and faults.get(i + 1) != "duplicate"]
    whole = {
        kind: _whole_kind(examine(SpoiltRecording(recording, some, {}, seed, kind))) == kind  # type: ignore[arg-type]
        for kind in WHOLE
    }
    return Found(
        planted,
        found,
        len(others),
        sum(bool(after.of(i)) for i in others),
        len({finding.frame for finding in before.findings}),
        len(some),
        whole,
    )


def _is_found(after: Examination, frame: int, kind: str) -> bool:
    said = {finding.kind for finding in after.of(frame)}
    if kind == "duplicate":
        said |= {f.kind for f in after.of(frame - 1)}
    return bool(said & set(FOUND_AS[kind]))


def _whole_kind(examination: Examination) -> str | None:
    return None if examination.whole is None else examination.whole.kind
