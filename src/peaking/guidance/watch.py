"""A capture that is watched while it grows: where next, how complete it is, what is left.

views, walk ──► virtual cameras ──► foresight of each ──┬──► score, verdict
└──► next view, what is left
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from peaking.frame import working_size_px
from peaking.geometry import Cam, Camera, Rigid, World, seen_by
from peaking.guidance.completeness import ENOUGH, Verdict, score, scored, verdict
from peaking.guidance.foresight import PIXELS, Foresight, SmallViews
from peaking.guidance.next_view import Suggestion, apart, keep_or_change, suggestions
from peaking.guidance.virtual_cameras import CLEARANCE, poses_around, step_length_m
from peaking.memory import Memory
from peaking.memory.depth_maps import DEPTHS
from peaking.mpi import Mpi
from peaking.options import DEFAULT, Options
from peaking.view_weights import overlap_points_m

MAX_LEFT = 3
"""Places that are named as left, at most."""

WALKED = 64
"""Places of the walk that are scored: more than half so many, at most so many."""


MAX_KNOWN = 2000
"""Foresights that are remembered."""

NONE_NEW = 0.002
"""Of a picture with less that is new, no view can take away more."""

SHRINK, MIN_PIXELS = 16, 8000
"""Views are looked at with so many times fewer pixels than they are shown with, but not with fewer
than so many: the memory would have gaps."""

Pose = Rigid[World, Cam]


def small_views(options: Options) -> Options:
    """Return the options by which the small views of a `Watch` are made."""
    pixels = min(options.pixels, max(MIN_PIXELS, options.pixels // SHRINK))
    return replace(options, pixels=pixels)


@dataclass(frozen=True)
class Advice:
    """What is told of a capture.

    Attributes:
        views: How many views it is about.
        score: How complete the capture is, 0…1.
        verdict: Whether to go on.
        next: The pose to go to; None where no view helps, or it is enough.
        left: What is left, the most first: up to `MAX_LEFT` places.
        surface_m: Places in the world where a surface was seen.
    """

    views: int
    score: float
    verdict: Verdict
    next: Suggestion | None
    left: tuple[Suggestion, ...]
    surface_m: Float32[np.ndarray, "n 3"]


class Watch:
    """Watches one capture. What does not change when a view comes is not computed again."""

    def __init__(self, options: Options = DEFAULT) -> None:
        """Begin without views.

        Args:
            options: How views are blended.
        """
        self._options = options
        self._memory = Memory()
        self._next: Suggestion | None = None
        self._mpis: Sequence[Mpi] = ()
        self._known: dict[tuple[object, ...], _Known] = {}

    def advise(
        self,
        mpis: Sequence[Mpi],
        path: Sequence[Pose] = (),
        *,
        pause: Callable[[], None] = lambda: None,
    ) -> Advice:
        """Look at a capture as it is now.

        Args:
            mpis: The views, in order, in metres; small ones are enough. The same object is the
                same view.
            path: Where the photographer was, in order; without it, around the views.
            pause: Called between two pictures: may wait while there is something better to do.

        Raises:
            ValueError: There is no view.
        """
        if not mpis:
            raise ValueError("need at least one view, got none")
        self._memory.follow(mpis)
        self._mpis = mpis
        depth_m = _about(float(np.median([np.median(mpi.plane_depths_m) for mpi in mpis])))
        step_m = step_length_m(depth_m)
        views = SmallViews(mpis, self._memory, depth_m, self._options)
        size_px = working_size_px(*mpis[0].camera.pinhole.size_px, pixels=PIXELS)
        cameras = [mpi.camera.resized(*size_px) for mpi in mpis]
        surface_m = self._memory.surface_m(CLEARANCE * step_m)
        around = poses_around(cameras, path, surface_m, step_m)
        foreseen = [self._foresee(views, virtual.camera, pause) for virtual in around]
        walked = [Camera(cameras[0].pinhole, pose) for pose in _walked(path)] or cameras
        pictures = scored(
            [(camera, self._foresee(views, camera, pause)) for camera in walked],
            [
                (virtual.camera, foresight)
                for virtual, foresight in zip(around, foreseen, strict=True)
                if not (virtual.turned or virtual.walked)
            ],
        )
        if self._next is not None:  # it may be no longer among them
            around = [self._next.virtual, *around]
            foreseen = [self._foresee(views, self._next.camera, pause), *foreseen]
        here = Camera(cameras[0].pinhole, path[-1]) if path else cameras[-1]
        found = suggestions(around, foreseen, pictures, step_m=step_m, here=here)
        self._next = keep_or_change(self._next, found)
        total = score(pictures)
        return Advice(
            views=len(mpis),
            score=total,
            verdict=verdict(total, helps=bool(found)),
            next=None if total >= ENOUGH else self._next,
            left=tuple(apart(found, MAX_LEFT, step_m=step_m)),
            surface_m=surface_m,
        )

    def _foresee(self, views: SmallViews, camera: Camera, pause: Callable[[], None]) -> Foresight:
        """Foresee a picture, unless what is known of it holds still."""
        neighbours = views.nearest(camera)
        key = (
            camera.world_from_cam.rotation.tobytes(),
            camera.world_from_cam.translation_m.tobytes(),
            *((id(views.mpis[n.index]), round(n.weight, 2)) for n in neighbours),
        )
        known = self._known.pop(key, None)
        if known is None or not self._holds(known, camera, views.depth_m):
            pause()
            known = _Known(views.foresee(camera, neighbours), tuple(views.mpis))
        self._known[key] = known  # the newest last
        while len(self._known) > MAX_KNOWN:
            del self._known[next(iter(self._known))]
        return known.foresight

    def _holds(self, known: _Known, camera: Camera, depth_m: float) -> bool:
        """Return whether no view came or went that saw some of what was new."""
        if known.foresight.new < NONE_NEW and len(self._mpis) >= len(known.mpis):
            return True
        now, then = {id(mpi) for mpi in self._mpis}, {id(mpi) for mpi in known.mpis}
        changed = [mpi.camera for mpi in (*self._mpis, *known.mpis) if id(mpi) in now ^ then]
        points_m = [overlap_points_m(camera, depth_m * factor) for factor in DEPTHS]
        return not changed or not seen_by(changed, np.concatenate(points_m)).any()


@dataclass(frozen=True)
class _Known:
    """What was foreseen, and of which views."""

    foresight: Foresight
    mpis: tuple[Mpi, ...]


def _about(depth_m: float) -> float:
    """Return a depth near this one, the same for most: so that weights change when views do."""
    return 2.0 ** (round(4 * math.log2(depth_m)) / 4)


def _walked(path: Sequence[Pose]) -> Sequence[Pose]:
    """Return places of a walk, evenly in time; as it gets longer, most of them stay."""
    every = 1
    while len(path) > WALKED * every:
        every *= 2
    return path[::every]
