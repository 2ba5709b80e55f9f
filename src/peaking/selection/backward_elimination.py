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

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float64, UInt8

from peaking.geometry import Camera
from peaking.light_field import blend_renderings
from peaking.mpi import Mpi
from peaking.options import Options
from peaking.rendering import Rendering, render
from peaking.selection.policy import Candidate, Decision
from peaking.view_weights import (
    CLOSE_M,
    costs_m,
    fading_weights,
    overlap_costs_m,
    overlap_points_m,
)

HELD_PER_VIEW = 4
"""Views held while shooting, per view wanted; the rest goes at the end. With 2 the mean PSNR was up
to 0.5 dB lower, with 8 it was the same (docs/evaluation.md)."""

SHRINK = 16
"""The errors are looked at with so many times fewer pixels than the views are made with."""

MIN_PIXELS = 256

EXPONENT = 0.25
"""What a frame's mean squared error is raised to before it is summed. Towards 0 the mean PSNR over
frames counts, towards 1 the worst frames alone."""

SAME_PLACE_M = 2 * CLOSE_M
"""Cost (distance over overlap) up to which a view is from where another was: who stands still takes
one. Each would else be missed by the other, which no third one shows as well."""

ALL_WRONG = 0.3
"""Mean squared error of a frame that no view shows."""

MAX_RENDERINGS = 1500
"""Renderings that are kept; at the paper's size they take 0.35 GB."""


@dataclass(frozen=True)
class _Seen:
    """A frame seen so far, small.

    Attributes:
        number: What the outside calls it.
        camera: Of the small picture.
        rgb: The small picture.
        points_m: Points of the world that tell how much of it a view saw (`overlap_points_m`).
    """

    number: int
    camera: Camera
    rgb: UInt8[np.ndarray, "h w 3"]
    points_m: Float64[np.ndarray, "n 3"]


class BackwardElimination:
    """Holds at most `HELD_PER_VIEW` views per view wanted, and in the end those wanted.

    Views are weighted by distance over overlap, whatever `Options.blend_weights` says: the question
    is which view is missed, and those weights change without jumps when one goes.

    Frames are called by their row: the first one seen is 0. A frame is never shown by its own MPI:
    that it could show itself says nothing about its neighbours.
    """

    def __init__(self, num_views: int, options: Options) -> None:
        """Begin without a view.

        Args:
            num_views: How many are wanted in the end.
            options: How views are built and blended.

        Raises:
            ValueError: `num_views` < 1.
        """
        if num_views < 1:
            raise ValueError(f"need num_views >= 1, got {num_views}")
        self._num_views = num_views
        self._options = options
        self._pixels = 0
        self._seen: list[_Seen] = []
        self._mpis: dict[int, Mpi] = {}
        self._cost_m = np.zeros((0, 0))
        """Cost of a row's frame to be shown by another row's view; only of views it is known."""
        self._rendered = lru_cache(maxsize=MAX_RENDERINGS)(self._render)
        self._known: dict[tuple[object, ...], float] = {}
        self._error: dict[int, float] = {}
        self._shown_by: dict[int, frozenset[int]] = {}
        self._shows: dict[int, set[int]] = {}
        self._missed: dict[int, float] = {}
        self._held: list[int] = []

    @property
    def views(self) -> Sequence[int]:
        """Numbers of the views that are held now."""
        return tuple(self._seen[row].number for row in self._held)

    def observe(self, candidate: Candidate) -> Decision:
        """Hold the frame, unless a view from the same place is; drop one view too many."""
        if not candidate.accepted:
            return Decision(False, "no depth")
        row = self._see(candidate)
        new = not self._held or float(self._cost_m[row, self._held].min()) > SAME_PLACE_M
        if new:
            self._hold(row, candidate.mpi(self._pixels))
        changed = [
            t
            for t in range(len(self._seen))
            if t == row or row in self._neighbours(t, self._held)[0]
        ]
        self._look_again(changed, also={row} if new else set())
        if len(self._held) <= HELD_PER_VIEW * self._num_views:
            if new:
                return Decision(True, "held until views that are missed less are known")
            return Decision(False, "a view from the same place is held")
        gone = self._drop()
        if gone == row:
            return Decision(False, "the views held show the frames seen so far without it")
        number = self._seen[gone].number
        return Decision(new, f"view {number} is missed least", dropped=(number,))

    def finish(self) -> Decision:
        """Drop the least missed until as many are held as are wanted."""
        gone: list[int] = []
        while len(self._held) > self._num_views:
            gone.append(self._seen[self._drop()].number)
        self._rendered.cache_clear()  # takes the most room
        return Decision(False, "missed least of all", dropped=tuple(gone))

    def _see(self, candidate: Candidate) -> int:
        """Remember a frame, and what it would cost to show it by the views held; return its row."""
        if not self._seen:
            width, height = candidate.camera.pinhole.size_px
            self._pixels = max(MIN_PIXELS, width * height // SHRINK)
        frame = candidate.frame(self._pixels)
        depth_m = float(np.median(candidate.mpi(self._pixels).plane_depths_m))
        row = len(self._seen)
        if row == len(self._cost_m):
            room = max(64, row)
            self._cost_m = np.pad(self._cost_m, (0, room), constant_values=np.inf)
        points_m = overlap_points_m(frame.camera, depth_m)
        self._seen.append(_Seen(candidate.number, frame.camera, frame.rgb, points_m))
        self._shown_by[row] = frozenset()
        if self._held:
            cameras = [self._seen[i].camera for i in self._held]
            self._cost_m[row, self._held] = overlap_costs_m(cameras, frame.camera, depth_m)
        return row

    def _hold(self, row: int, mpi: Mpi) -> None:
        """Hold a frame as a view, and tell what all frames seen would cost to be shown by it."""
        camera = self._seen[row].camera
        positions_m = np.array([seen.camera.position_m for seen in self._seen])
        distance_m = np.linalg.norm(positions_m - camera.position_m, axis=1)
        overlap = camera.sees(np.array([seen.points_m for seen in self._seen])).mean(axis=-1)
        self._cost_m[: row + 1, row] = costs_m(distance_m, overlap)
        self._mpis[row] = mpi
        self._held.append(row)
        self._shows[row] = set()

    def _drop(self) -> int:
        """Give up the view that is least missed; return its row."""
        least = min(self._held, key=lambda i: self._missed[i])
        self._held.remove(least)
        del self._missed[least]
        self._look_again(sorted(self._shows[least]), also=set())
        del self._shows[least], self._mpis[least]
        return least

    def _look_again(self, frames: Sequence[int], *, also: set[int]) -> None:
        """Update the errors of frames, and how much the views that show them would be missed."""
        touched = set(also)
        for t in frames:
            touched |= self._shown_by[t]
            for i in self._shown_by[t]:
                self._shows[i].discard(t)
            self._error[t], self._shown_by[t] = self._look(t, self._held)
            for i in self._shown_by[t]:
                self._shows[i].add(t)
            touched |= self._shown_by[t]
        for i in touched & set(self._held):
            without = [k for k in self._held if k != i]
            self._missed[i] = sum(
                self._look(t, without)[0] ** EXPONENT - self._error[t] ** EXPONENT
                for t in sorted(self._shows[i])
            )

    def _neighbours(
        self, target: int, views: Sequence[int]
    ) -> tuple[list[int], Float[np.ndarray, "k"]]:
        """Return the views that show a frame, and their weights."""
        others = [i for i in views if i != target]
        if not others:
            return [], np.zeros(0)
        best, weights = fading_weights(self._cost_m[target, others], self._options.neighbours)
        return [others[k] for k in best], weights

    def _look(self, target: int, views: Sequence[int]) -> tuple[float, frozenset[int]]:
        """Return the mean squared error of a frame as some views show it, and which do."""
        neighbours, weights = self._neighbours(target, views)
        if not neighbours:
            return ALL_WRONG, frozenset()
        key = (target, *neighbours, *np.round(weights, 2).tolist())
        if key not in self._known:
            renderings = [self._rendered(i, target) for i in neighbours]
            shown = blend_renderings(renderings, weights.tolist(), opacity=self._options.opacity)
            photo = self._seen[target].rgb.astype(np.float32) / np.float32(255)
            wrong = np.clip(shown.rgba[..., :3], 0, 1) - photo
            self._known[key] = float(np.mean(wrong * wrong))
        return self._known[key], frozenset(neighbours)

    def _render(self, view: int, target: int) -> Rendering:
        return render(self._mpis[view], self._seen[target].camera)
