"""The best N frames of a recording, as a data set, and why they are.

With depth, frames are chosen by our own policy (`peaking.selection.backward_elimination`). Without
it, only poses and sharpness are known: frames that cover best (`peaking.selection.coverage`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from peaking.best_frames.choosing import Chosen, FrameChoice, Looks, choose_by_pictures
from peaking.datasets import Recording
from peaking.datasets.depth_unit import typical_distance
from peaking.options import DEFAULT, Options
from peaking.selection.blur import worth_of_sharpness
from peaking.selection.coverage import cover
from peaking.selection.policy import CurvePoint
from peaking.selection.recorded_frames import RecordedCandidate, RecordedFrames

Progress = Callable[[Sequence[int]], Iterable[int]]
"""Wraps the numbers of the frames that are looked at."""

ENOUGH_PARALLAX = 0.15
"""Without depth: gap between frames over the distance of things, at which more are not needed."""

MOST_WITHOUT_NUMBER = 400
"""Without depth, the curve ends here."""


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
    looks = Looks(options.pixels, with_thumbnails=True)
    if frames.with_depth:
        chosen = choose_by_pictures(
            progress(usable), partial(RecordedCandidate, frames), num_views, options, looks
        )
        curve: Sequence[CurvePoint] | Sequence[Gap] = chosen.curve
    else:
        chosen, curve = _by_poses(frames, usable, num_views, looks, progress)
    stages_ms, _ = frames.take_costs()
    seconds = {stage: stages_ms.get(stage, 0.0) / 1000 for stage in ("reading", "generating")}
    seconds["choosing"] = clock_s() - start_s - sum(seconds.values())
    choices = looks.choices(chosen, lambda number: recording.names[number])
    return BestFrames(
        [
            choices.get(number, FrameChoice(number, name, False, "no depth", None))
            for number, name in enumerate(recording.names)
        ],
        curve,
        bool(frames.with_depth),
        seconds,
        looks.thumbnails,
    )


def _by_poses(
    frames: RecordedFrames,
    usable: Sequence[int],
    num_views: int | None,
    looks: Looks,
    progress: Progress,
) -> tuple[Chosen, list[Gap]]:
    for number in progress(usable):
        looks.add(RecordedCandidate(frames, number))
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
    return Chosen({usable[place]: None for place in found.places[:count]}, []), curve
