"""Our default: hold more views than are needed, and drop the one that is least missed.

Greedy backward elimination, one frame at a time. The plain threshold takes a view where it is red
now, and cannot know whether the next view, taken for another reason, would have shown the same.
Where the scene is hard it takes every frame, and where it is easy none, so that on average its
views are worse than evenly spread ones. Here every frame is tried as a view, and only so many are
held: the one that goes is the one without which the others show the frames seen so far least worse.
So the error decides, and coverage comes by itself, since a frame that nothing shows is wrong
altogether. Nothing of the future is known; neither the length of the path nor a threshold has to
be.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from peaking.mpi import Mpi
from peaking.options import Options
from peaking.selection.blur import Sharpnesses
from peaking.selection.policy import (
    ALONE,
    SHARPER,
    WRONG,
    Candidate,
    CurvePoint,
    Decision,
    Why,
    Worth,
)
from peaking.selection.seen_frames import SeenFrames
from peaking.selection.shown_errors import Blend, ShownErrors

HELD_PER_VIEW = 4
"""Views held while shooting, per view wanted; the rest goes at the end. With 2 the mean PSNR was up
to 0.5 dB lower, with 8 it was the same (docs/evaluation.md)."""

HELD_WITHOUT_NUMBER = 240
"""Views held while shooting where the curve is to tell how many are wanted."""

MAX_SEEN = 600
"""Frames that are remembered, at least so many; of more, those go that are closest in time."""

SHRINK = 16
"""The errors are looked at with so many times fewer pixels than the views are made with."""

MIN_PIXELS = 256

EXPONENT = 0.25
"""What a frame's mean squared error is raised to before it is summed. Towards 0 the mean PSNR over
frames counts, towards 1 the worst frames alone."""

GAIN_DB = 1.0
"""The curve has flattened where twice as many views bring less than this."""

SHARPER_BY = 1.1
"""So many times as sharp, a frame takes the place of a view from the same place."""

SAME_PLACE = "a view from the same place is held"
"""Why a frame is not held."""

SHOWN_RIGHT = 1e-3
"""Mean squared error, at most, of a frame that is held as a view: 30 dB."""

MIN_ERROR = 1e-5
"""Mean squared errors below it count as this in decibels: 50 dB."""


@dataclass(frozen=True)
class Loss:
    """What is lost when a view goes, summed over the frames that it shows.

    Attributes:
        missed: What is minimised, the sum of (mean squared error)^`EXPONENT`.
        psnr_db: PSNR.
        error: Mean squared error.
        unseen: The part of it where no other view shows anything.
    """

    missed: float
    psnr_db: float
    error: float
    unseen: float


class BackwardElimination:
    """Holds at most `HELD_PER_VIEW` views per view wanted, and in the end those wanted.

    Views are weighted by distance over overlap, whatever `Options.blend_weights` says: the question
    is which view is missed, and those weights change without jumps when one goes.

    How well a frame is shown is asked of the other views, because that a view shows itself says
    nothing about its neighbours. But a view that goes is no longer shown by itself, so what the
    others make of it counts as lost: what one view alone shows is held.
    """

    def __init__(
        self,
        num_views: int | None,
        options: Options,
        *,
        with_curve: bool = False,
        most_held: int | None = None,
    ) -> None:
        """Begin without a view.

        Args:
            num_views: How many are wanted in the end; None: as many as the curve says are enough.
            options: How views are built and blended.
            with_curve: Whether to find out at the end how good fewer views would be.
            most_held: Views held until the end; `HELD_PER_VIEW` per view wanted without it.

        Raises:
            ValueError: `num_views` < 1.
        """
        if num_views is not None and num_views < 1:
            raise ValueError(f"need num_views >= 1, got {num_views}")
        self._num_views = num_views
        self._options = options
        usual = HELD_WITHOUT_NUMBER if num_views is None else HELD_PER_VIEW * num_views
        self._most_held = usual if most_held is None else most_held
        self._most_seen = max(MAX_SEEN, 2 * self._most_held)
        self._with_curve = with_curve or num_views is None
        self._pixels = 0
        self._shown = ShownErrors(
            options.opacity, max_photos=self._most_seen + 1, max_views=options.neighbours
        )
        self._seen = SeenFrames(self._most_seen + 1)
        self._sharp = Sharpnesses()
        self._sharper: set[int] = set()
        self._error: dict[int, float] = {}
        self._unseen: dict[int, float] = {}
        self._shown_by: dict[int, frozenset[int]] = {}
        self._shows: dict[int, set[int]] = {}
        self._others_lose: dict[int, Loss] = {}
        self._last: _Step | None = None
        self._curve: list[CurvePoint] = []

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views that are held now."""
        return tuple(self._seen.held) if self._last is None else self._last.views

    @property
    def worth(self) -> Mapping[int, Worth]:
        """What each view held is worth: how much worse the frames seen are shown without it."""
        return self._worth() if self._last is None else self._last.worth

    @property
    def curve(self) -> Sequence[CurvePoint]:
        """After the end, with a curve: how well fewer and fewer views show the frames seen."""
        return self._curve

    def observe(self, candidate: Candidate) -> Decision:
        """Hold the frame, unless a view from the same place is; drop one view too many."""
        if not candidate.accepted:
            return Decision(False, "no depth")
        number = candidate.number
        touched = self._see(candidate)
        same = self._seen.from_same_place(number)
        if same is not None and self._sharp.of(number) > SHARPER_BY * self._sharp.of(same):
            self._replace(same, number, candidate.mpi(self._pixels), also=touched)
            return Decision(True, f"sharper than view {same}, from there", dropped=(same,))
        new = same is None
        shown_now: set[int] = set()
        if new:
            self._hold(number, candidate.mpi(self._pixels))
            touched.add(number)
            shown_now = self._seen.shown_by(number, self._options.neighbours)
        self._look_again(sorted(shown_now | {number}), also=touched)
        if len(self._seen.held) <= self._most_held:
            if new:
                return Decision(True, "held until views that are missed less are known")
            return Decision(False, SAME_PLACE)
        gone = self._drop()
        if gone == number:
            return Decision(False, "the views held show the frames seen so far without it")
        return Decision(new, f"view {gone} is missed least", dropped=(gone,))

    def give_up(self, among: Collection[int]) -> int | None:
        """Give up the one of some views that is least missed; return it, None if none is held."""
        return self._drop(among) if any(i in among for i in self._seen.held) else None

    def forget_renderings(self) -> None:
        """Give the memory back that takes the most; it is filled again when it is needed."""
        self._shown.forget_renderings()

    def finish(self) -> Decision:
        """Drop the least missed until as many are held as are wanted."""
        held = tuple(self._seen.held)
        steps = [self._step()]
        least = 1 if self._with_curve else self._num_views or 1
        while len(self._seen.held) > least:
            self._drop()
            steps.append(self._step())
        self._curve = [CurvePoint(len(step.views), step.psnr_db) for step in reversed(steps)]
        wanted = self._num_views or enough(self._curve)
        self._last = next((step for step in steps if len(step.views) <= wanted), steps[-1])
        self._shown.forget_renderings()
        gone = sorted(set(held) - set(self._last.views))
        return Decision(False, "missed least of all", dropped=tuple(gone))

    def _see(self, candidate: Candidate) -> set[int]:
        """Remember a frame; return which views that changes."""
        if not self._pixels:
            width, height = candidate.camera.pinhole.size_px
            self._pixels = max(MIN_PIXELS, width * height // SHRINK)
        number = candidate.number
        frame = candidate.frame(self._pixels)
        depth_m = float(np.median(candidate.mpi(self._pixels).plane_depths_m))
        self._shown.add_photo(number, frame)
        self._seen.add(number, frame.camera, depth_m)
        self._sharp.add(number, frame.camera, candidate.sharpness())
        self._shown_by[number] = frozenset()
        return self._forget() if len(self._seen) > self._most_seen else set()

    def _forget(self) -> set[int]:
        """Forget the frame seen that is closest in time to others; return which views showed it."""
        gone = self._seen.remove_closest()
        self._shown.remove_photo(gone)
        self._sharp.remove(gone)
        del self._error[gone], self._unseen[gone]
        views = set(self._shown_by.pop(gone))
        for i in views:
            self._shows[i].discard(gone)
        return views

    def _hold(self, number: int, mpi: Mpi) -> None:
        """Hold a frame as a view."""
        self._seen.hold(number)
        self._shown.add_mpi(number, mpi)
        self._shows[number] = set()

    def _replace(self, old: int, new: int, mpi: Mpi, *, also: set[int]) -> None:
        """Hold a frame instead of a view from the same place."""
        self._seen.release(old)
        del self._others_lose[old]
        self._hold(new, mpi)
        self._sharper.add(new)
        shown_now = self._seen.shown_by(new, self._options.neighbours)
        self._look_again(sorted(self._shows[old] | shown_now | {new}), also=also | {new})
        del self._shows[old]
        self._shown.remove_mpi(old)

    def _drop(self, among: Collection[int] | None = None) -> int:
        """Give up the view that is least missed, of some or of all; return its number.

        What is missed of a view counts as much as it is sharp: of two that show the same, the
        sharper one stays.
        """
        held = [i for i in self._seen.held if among is None or i in among]
        missed = np.array([self._loss(i).missed for i in held])
        least = held[int(np.argmin(np.where(missed > 0, missed * self._sharp.worth(held), missed)))]
        self._seen.release(least)
        del self._others_lose[least]
        self._look_again(sorted(self._shows[least]), also=set())
        del self._shows[least]
        self._shown.remove_mpi(least)
        return least

    def _look_again(self, frames: Sequence[int], *, also: set[int]) -> None:
        """Update the errors of frames, and what is lost with the views that show them."""
        touched = set(also)
        blends = [self._blend(t) for t in frames]
        for blend, (error, unseen) in zip(blends, self._errors(blends), strict=True):
            t = blend.target
            for i in self._shown_by[t]:
                self._shows[i].discard(t)
            touched |= self._shown_by[t]
            self._error[t], self._unseen[t] = error, unseen
            self._shown_by[t] = frozenset(blend.views)
            for i in blend.views:
                self._shows[i].add(t)
            touched |= self._shown_by[t]
        views = [i for i in self._seen.held if i in touched]
        without = [self._blend(t, without=i) for i in views for t in sorted(self._shows[i])]
        errors = iter(self._errors(without))
        for i in views:
            self._others_lose[i] = self._lost(sorted(self._shows[i]), errors)

    def _lost(self, frames: Sequence[int], errors: Iterator[tuple[float, float]]) -> Loss:
        """Sum up what frames lose, given their errors without the view."""
        missed = psnr_db = rises = unseen = 0.0
        for t, (error_without, unseen_without) in zip(frames, errors, strict=False):
            missed += error_without**EXPONENT - self._error[t] ** EXPONENT
            psnr_db += _psnr_db(self._error[t]) - _psnr_db(error_without)
            rises += error_without - self._error[t]
            unseen += unseen_without - self._unseen[t]
        return Loss(missed, psnr_db, rises, unseen)

    def _loss(self, view: int) -> Loss:
        """Return what is lost when a view goes: what others lose, and that it shows itself."""
        others = self._others_lose[view]
        own, right = self._error[view], min(self._error[view], SHOWN_RIGHT)
        return Loss(
            others.missed + own**EXPONENT - right**EXPONENT,
            others.psnr_db + _psnr_db(right) - _psnr_db(own),
            others.error + own - right,
            others.unseen + self._unseen[view],
        )

    def _blend(self, target: int, *, without: int | None = None) -> Blend:
        """Return which views held show a frame, and their weights."""
        views, weights = self._seen.neighbours(target, self._options.neighbours, without=without)
        return Blend(target, views, weights)

    def _errors(self, blends: Sequence[Blend]) -> list[tuple[float, float]]:
        return [(error, unseen) for error, unseen in self._shown.errors(blends).tolist()]

    def _step(self) -> _Step:
        held = set(self._seen.held)
        shown = [
            _psnr_db(min(error, SHOWN_RIGHT) if t in held else error)
            for t, error in self._error.items()
        ]
        psnr_db = float(np.mean(shown or [0.0]))
        return _Step(tuple(self._seen.held), psnr_db, self._worth())

    def _worth(self) -> dict[int, Worth]:
        frames = max(1, len(self._seen))
        return {i: Worth(self._loss(i).psnr_db / frames, self._why(i)) for i in self._seen.held}

    def _why(self, view: int) -> Why:
        loss = self._loss(view)
        if 2 * loss.unseen > loss.error:
            return ALONE
        return SHARPER if view in self._sharper else WRONG


@dataclass(frozen=True)
class _Step:
    """The views held at one time, and how well they show the frames seen."""

    views: tuple[int, ...]
    psnr_db: float
    worth: Mapping[int, Worth]


def enough(curve: Sequence[CurvePoint], *, gain_db: float = GAIN_DB) -> int:
    """Return the least number of views of which twice as many would gain less than `gain_db`.

    Args:
        curve: Points in rising number of views; where it ends, nothing more can be gained.
        gain_db: What twice as many views must bring to be worth it.
    """
    psnr_db = np.maximum.accumulate([point.psnr_db for point in curve])
    numbers = [point.num_views for point in curve]
    for number, here_db in zip(numbers, psnr_db, strict=True):
        if float(np.interp(2 * number, numbers, psnr_db)) - here_db < gain_db:
            return number
    raise ValueError("need a point of the curve")


def _psnr_db(error: float) -> float:
    return -10.0 * math.log10(max(error, MIN_ERROR))
