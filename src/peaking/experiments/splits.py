"""Which frames are looked at in the end, and which may be chosen."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from peaking.datasets import Recording
from peaking.errors import RecordingError
from peaking.selection.recorded_frames import RecordedFrames
from peaking.selection.uniform import spread_along

TestViews = Literal["holdout", "paper"]

HOLD_OUT_EVERY = 8
"""Every so many frames one is kept for testing; of short recordings every fourth."""

SHORT = 40
"""A recording of fewer frames is short."""

MIN_VIEWS = 2
"""Views that every strategy is asked for, at least."""


@dataclass(frozen=True)
class Split:
    """Frames by number: those that are tested, and those that strategies choose from.

    Attributes:
        candidates: In the order of capture.
        test: In the order of capture; none is a candidate.
        uniform: The views of Uniform, where the test views lie between these.
    """

    candidates: tuple[int, ...]
    test: tuple[int, ...]
    uniform: tuple[int, ...] | None = None


def split(
    frames: RecordedFrames,
    usable: Sequence[int],
    test_views: TestViews,
    num_views: int,
    *,
    uniform_metres_per_rad: float = 0.0,
) -> Split:
    """Split the usable frames of a recording.

    `holdout`: every n-th frame is tested and never a candidate, the same for all strategies and
    numbers of views. `paper`: tested is the middle frame between every two views of Uniform (paper,
    section 4.2); the rest is candidates. `uniform_metres_per_rad` is what a rotation counts as on
    Uniform's path.

    Raises:
        RecordingError: There are too few frames for so many views and a test view.
    """
    if test_views == "holdout":
        every = HOLD_OUT_EVERY if len(usable) >= SHORT else HOLD_OUT_EVERY // 2
        test = tuple(usable[every // 2 :: every])
        uniform = None
    else:
        cameras = [frames.cameras[i] for i in usable]
        count = min(num_views, len(usable))
        marks = spread_along(cameras, count, metres_per_rad=uniform_metres_per_rad)
        uniform = tuple(usable[k] for k in marks)
        place = {frame: k for k, frame in enumerate(usable)}
        places = itertools.pairwise(place[i] for i in uniform)
        test = tuple(usable[(a + b) // 2] for a, b in places if b - a > 1)
    tested = set(test)
    candidates = tuple(i for i in usable if i not in tested)
    if num_views < MIN_VIEWS or num_views > len(candidates) or not test:
        raise RecordingError(
            frames.recording.path,
            f"has {len(usable)} usable frames, which leaves {len(candidates)} to choose from and "
            f"{len(test)} to test with ({test_views}); {num_views} views were asked for",
            remedy=f"ask for {MIN_VIEWS} to {max(MIN_VIEWS, len(candidates))} views (--views)",
        )
    return Split(candidates, test, uniform)


def num_candidates(recording: Recording) -> int:
    """Return how many candidates a recording has beside its `holdout` test views."""
    usable = sum(recording.has_depth) or len(recording)
    return usable - usable // (HOLD_OUT_EVERY if usable >= SHORT else HOLD_OUT_EVERY // 2)


def budgets(count: int) -> tuple[int, int, int]:
    """Return few, middle and many views for so many candidates: a twentieth, a tenth, a fifth."""
    few, middle, many = (int(max(MIN_VIEWS, np.rint(count * s))) for s in (0.05, 0.1, 0.2))
    return few, max(middle, few + 1), max(many, few + 2)
