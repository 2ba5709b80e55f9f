"""The best N frames of a recording, as a data set, and why they are.

With depth, frames are chosen by our own policy (`peaking.selection.backward_elimination`). Without
it, only poses and sharpness are known: frames that cover best (`peaking.selection.coverage`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.datasets import Recording
from peaking.datasets.depth_unit import typical_distance
from peaking.geometry import Camera
from peaking.options import DEFAULT, Options
from peaking.output import encode_jpeg
from peaking.selection.backward_elimination import SAME_PLACE, BackwardElimination
from peaking.selection.blur import relative_to_nearest, worth_of_sharpness
from peaking.selection.coverage import cover
from peaking.selection.policy import CurvePoint, Worth
from peaking.selection.recorded_frames import RecordedCandidate, RecordedFrames

Progress = Callable[[Sequence[int]], Iterable[int]]
"""Wraps the numbers of the frames that are looked at."""

BLURRED = 0.8
"""Sharpness relative to frames from nearby at which a frame is called blurred; 9 of 10 that are not
blurred have more (`peaking.selection.blur`)."""

UNEVEN = 1.3
"""Brightness over that of frames from nearby, or its inverse, at which it is called otherwise
exposed."""

ENOUGH_PARALLAX = 0.15
"""Without depth: gap between frames over the distance of things, at which more are not needed."""

MOST_WITHOUT_NUMBER = 400
"""Without depth, the curve ends here."""

THUMBNAIL_PX = 160
"""Longer side of the small pictures for the report."""

THUMBNAIL_QUALITY = 70


@dataclass(frozen=True)
class FrameChoice:
    """What became of a frame.

    Attributes:
        number: Its place in the recording.
        name: Its name there.
        kept: Whether it was chosen.
        reason: Why, or why not.
        sharpness: Relative to frames from nearby; 1 is as sharp as these, None was not looked at.
        worth_db: What a kept view is worth (`Worth.psnr_db`); None where that is not known.
    """

    number: int
    name: str
    kept: bool
    reason: str
    sharpness: float | None
    worth_db: float | None = None


@dataclass(frozen=True)
class BestFrames:
    """The frames of a recording, sorted into those to keep and the others.

    Attributes:
        frames: All, in the order of the recording.
        curve: How good more and more views are; without depth, how far apart they are.
        by_pictures: Whether pictures were predicted; else there was no depth to do so.
        seconds: Wall time of "reading", "generating" and "choosing".
        thumbnails: Small pictures of the frames that were looked at, by number, as JPEG.
    """

    frames: Sequence[FrameChoice]
    curve: Sequence[CurvePoint] | Sequence[Gap]
    by_pictures: bool
    seconds: dict[str, float] = field(default_factory=dict[str, float])
    thumbnails: dict[int, bytes] = field(default_factory=dict[int, bytes])

    @property
    def kept(self) -> list[int]:
        """Numbers of the frames to keep."""
        return [frame.number for frame in self.frames if frame.kept]


@dataclass(frozen=True)
class Gap:
    """How far apart a number of views leaves the frames.

    Attributes:
        num_views: So many.
        gap_share: The largest distance of a frame from the nearest view, rotations counted, over
            the distance of things.
    """

    num_views: int
    gap_share: float


def choose_best(
    recording: Recording,
    num_views: int | None,
    *,
    options: Options = DEFAULT,
    progress: Progress = iter,
    clock_s: Callable[[], float] = time.perf_counter,
) -> BestFrames:
    """Choose the best frames of a recording.

    Args:
        recording: With depth, or without any.
        num_views: How many; None: as many as are worth it.
        options: How views are built and shown.
        progress: Wraps the numbers of the frames.
        clock_s: For the stages.

    Raises:
        ValueError: More frames are asked for than can be chosen from.
        RecordingError: A frame cannot be read.
    """
    frames = RecordedFrames(recording, options, clock_s=clock_s)
    usable = list(frames.with_depth) or list(range(len(frames)))
    if num_views is not None and not 1 <= num_views <= len(usable):
        raise ValueError(f"need 1 to {len(usable)} views, got {num_views}")
    start_s = clock_s()
    looks = _Looks()
    choose = _by_pictures if frames.with_depth else _by_poses
    chosen = choose(frames, usable, num_views, looks, progress)
    stages_ms, _ = frames.take_costs()
    seconds = {stage: stages_ms.get(stage, 0.0) / 1000 for stage in ("reading", "generating")}
    seconds["choosing"] = clock_s() - start_s - sum(seconds.values())
    relative = dict(zip(usable, looks.relative_sharpness(), strict=True))
    brighter = dict(zip(usable, looks.relative_brightness(), strict=True))

    def choice(number: int) -> FrameChoice:
        name = recording.names[number]
        if number not in relative:
            return FrameChoice(number, name, False, "no depth", None)
        sharp = float(relative[number])
        if number in chosen.kept:
            worth = chosen.kept[number]
            reason = "covers what no other does" if worth is None else worth.why
            return FrameChoice(
                number, name, True, reason, sharp, None if worth is None else worth.psnr_db
            )
        reason = _why_not(sharp, float(brighter[number]), number in chosen.same_place)
        return FrameChoice(number, name, False, reason, sharp)

    return BestFrames(
        [choice(number) for number in range(len(recording))],
        chosen.curve,
        bool(frames.with_depth),
        seconds,
        looks.thumbnails,
    )


def _why_not(sharp: float, brightness: float, same_place: bool) -> str:
    if sharp < BLURRED:
        return "less sharp than others from there"
    if not 1 / UNEVEN < brightness < UNEVEN:
        return f"{'brighter' if brightness > 1 else 'darker'} than others from there"
    if same_place:
        return "taken from the same place as another"
    return "the frames kept show the same"


@dataclass(frozen=True)
class _Chosen:
    kept: dict[int, Worth | None]
    curve: Sequence[CurvePoint] | Sequence[Gap]
    same_place: set[int] = field(default_factory=set[int])


def _by_pictures(
    frames: RecordedFrames,
    usable: Sequence[int],
    num_views: int | None,
    looks: _Looks,
    progress: Progress,
) -> _Chosen:
    policy = BackwardElimination(num_views, frames.options, with_curve=True)
    same_place: set[int] = set()
    for number in progress(usable):
        candidate = RecordedCandidate(frames, number)
        if policy.observe(candidate).reason == SAME_PLACE:
            same_place.add(number)
        looks.add(number, candidate)
    policy.finish()
    worth = policy.worth
    return _Chosen({number: worth[number] for number in policy.views}, policy.curve, same_place)


def _by_poses(
    frames: RecordedFrames,
    usable: Sequence[int],
    num_views: int | None,
    looks: _Looks,
    progress: Progress,
) -> _Chosen:
    for number in progress(usable):
        looks.add(number, RecordedCandidate(frames, number))
    distance = typical_distance(frames.recording.cameras, frames.recording.read) or frames.depth_m
    worth = worth_of_sharpness(looks.relative_sharpness())
    cameras = [frames.cameras[number] for number in usable]
    count = max(num_views or 0, min(len(usable), MOST_WITHOUT_NUMBER))
    found = cover(cameras, distance, count, worth=worth)
    # How far the worst frame is from all of the first k: the largest gap that is still to come.
    left = np.maximum.accumulate(np.array([*found.gaps_m[1:], found.left_m])[::-1])[::-1]
    curve = [Gap(k + 1, float(gap / distance)) for k, gap in enumerate(left)]
    near = (point.num_views for point in curve if point.gap_share < ENOUGH_PARALLAX)
    enough = next(near, len(curve))
    count = num_views or enough
    return _Chosen({usable[place]: None for place in found.places[:count]}, curve)


class _Looks:
    """What is remembered of every frame that was looked at."""

    def __init__(self) -> None:
        self.thumbnails: dict[int, bytes] = {}
        self._cameras: list[Camera] = []
        self._sharpness: list[float] = []
        self._brightness: list[float] = []

    def add(self, number: int, candidate: RecordedCandidate) -> None:
        """Look at a frame."""
        frame = candidate.frame(candidate.frames.options.pixels)
        height, width = frame.rgb.shape[:2]
        shrink = min(1.0, THUMBNAIL_PX / max(height, width))
        size_px = max(1, round(width * shrink)), max(1, round(height * shrink))
        small = cv2.resize(frame.rgb, size_px, interpolation=cv2.INTER_AREA)
        self.thumbnails[number] = encode_jpeg(small.astype(np.uint8), quality=THUMBNAIL_QUALITY)
        self._cameras.append(frame.camera)
        self._sharpness.append(candidate.sharpness())
        self._brightness.append(float(np.mean(frame.rgb)))

    def relative_sharpness(self) -> Float64[np.ndarray, "n"]:
        """Return the sharpness of each over that of those from nearby."""
        return relative_to_nearest(self._cameras, np.array(self._sharpness))

    def relative_brightness(self) -> Float64[np.ndarray, "n"]:
        """Return the brightness of each over that of those from nearby."""
        return relative_to_nearest(self._cameras, np.array(self._brightness))
