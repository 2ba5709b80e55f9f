"""The light field: MPIs, the choice of views, and a camera give a rendering. It has no state.

    cameras + target ── choose_views ──► neighbours ── render_views ──► fill_holes ──► Rendering

Everything that shows captured views goes through here: live capture, replay, view selection,
evaluation, and `peaking render`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.error_map import ErrorMap, compare
from peaking.geometry import Camera
from peaking.hole_filling import choose_filling_views
from peaking.memory import Memory
from peaking.mpi import Mpi
from peaking.options import DEFAULT, Opacity, Options
from peaking.rendering import Rendering, draw_under, render
from peaking.rendering.blending import blend
from peaking.timing import Stopwatch
from peaking.tracking import Alignment
from peaking.view_weights import Neighbour, nearest_by_distance, nearest_by_overlap


@dataclass(frozen=True)
class Comparison:
    """What the photographer is shown at one moment.

    Attributes:
        rendering: The scene as the views show it.
        errors: Where that differs from the live picture.
        neighbours: The views it was rendered from.
        alignment: Of the live picture with the rendering, where that was asked for: with the camera
            that was rendered for, if it succeeded.
    """

    rendering: Rendering
    errors: ErrorMap
    neighbours: tuple[Neighbour, ...]
    alignment: Alignment | None = None


class Scratch:
    """Room for the renderings of single views, used again for every frame of a video."""

    def __init__(self) -> None:
        """Take no room yet."""
        self._rgba = np.empty((0, 0, 0, 4), np.float32)
        self._depth_m = np.empty((0, 0, 0), np.float32)

    def arrays(
        self, count: int, camera: Camera
    ) -> tuple[Float32[np.ndarray, "k h w 4"], Float32[np.ndarray, "k h w"]]:
        """Return `count` pictures of the camera's size; they hold anything."""
        width, height = camera.pinhole.size_px
        if len(self._depth_m) < count or self._depth_m.shape[1:] != (height, width):
            self._rgba = np.empty((count, height, width, 4), np.float32)
            self._depth_m = np.empty((count, height, width), np.float32)
        return self._rgba[:count], self._depth_m[:count]


def choose_views(
    cameras: Sequence[Camera], target: Camera, options: Options, *, get_mpi: Callable[[int], Mpi]
) -> tuple[Neighbour, ...]:
    """Choose the views to render a target from, and their weights (paper, section 3.1).

    Args:
        cameras: Where the views were taken.
        target: The camera to render for.
        options: How many, and how they are weighted.
        get_mpi: The MPI of a view, by its number; one at most is asked for.

    Raises:
        ValueError: There is no view.
    """
    if options.blend_weights == "paper":
        return nearest_by_distance(cameras, target, count=options.neighbours)
    closest = nearest_by_distance(cameras, target, count=1)[0]
    scene_depth_m = float(np.median(get_mpi(closest.index).plane_depths_m))
    return nearest_by_overlap(cameras, target, scene_depth_m, count=options.neighbours)


def render_views(
    mpis: Sequence[Mpi],
    weights: Sequence[float],
    camera: Camera,
    *,
    opacity: Opacity = DEFAULT.opacity,
    scratch: Scratch | None = None,
    stopwatch: Stopwatch | None = None,
) -> Rendering:
    """Render MPIs from a camera and blend them.

    Args:
        mpis: The views.
        weights: The share of each; they sum to 1.
        camera: Where from.
        opacity: How opaque the blend is.
        scratch: Room to work in, else new room is taken.
        stopwatch: Takes the time of rendering and blending.

    Raises:
        ValueError: The numbers of views and weights differ.
    """
    rgba, depth_m = (scratch or Scratch()).arrays(len(mpis), camera)
    with _stage(stopwatch, "render"):
        for k, mpi in enumerate(mpis):
            render(mpi, camera, out=(rgba[k], depth_m[k]))
    with _stage(stopwatch, "blend"):
        return blend(rgba, depth_m, weights, opacity=opacity)


def fill_holes(
    rendering: Rendering,
    cameras: Sequence[Camera],
    target: Camera,
    options: Options,
    *,
    neighbours: Sequence[Neighbour],
    get_mpi: Callable[[int], Mpi],
) -> tuple[Rendering, tuple[int, ...]]:
    """Draw under a rendering what further views have seen where it is empty.

    Args:
        rendering: What the neighbours show; it is written into.
        cameras: Where the views were taken.
        target: The camera of the rendering.
        options: How many views fill, at most.
        neighbours: The views that are in the rendering.
        get_mpi: The MPI of a view, by its number; only what is needed is asked for.

    Returns:
        The rendering, and the views that filled it.
    """
    if options.filling_views == 0 or len(cameras) <= len(neighbours):
        return rendering, ()
    nearest = min(neighbours, key=lambda neighbour: neighbour.distance_m)
    filling = choose_filling_views(
        cameras,
        target,
        rendering.alpha,
        get_mpi(nearest.index).plane_depths_m,
        blended=[neighbour.index for neighbour in neighbours],
        count=options.filling_views,
    )
    for index in filling:
        rendering = draw_under(rendering, get_mpi(index), target)
    return rendering, filling


def blend_renderings(
    renderings: Sequence[Rendering],
    weights: Sequence[float],
    *,
    opacity: Opacity = DEFAULT.opacity,
) -> Rendering:
    """Blend renderings of single views that are there already; see `render_views`."""
    rgba = np.stack([rendering.rgba for rendering in renderings])
    depth_m = np.stack([rendering.depth_m for rendering in renderings])
    return blend(rgba, depth_m, weights, opacity=opacity)


@dataclass(frozen=True)
class LightField:
    """Views, each an MPI in metres where it was photographed, and how they are shown.

    Attributes:
        mpis: The views.
        options: How views are chosen, weighted, blended and compared.
        guessed: Numbers of the views whose scale is a guess; they are shown only while there is no
            other.
        memory: What the views have seen; without it, what no view has seen is where the rendering
            is empty.
    """

    mpis: Sequence[Mpi]
    options: Options = DEFAULT
    guessed: frozenset[int] = frozenset()
    memory: Memory | None = None

    def choose_views(self, camera: Camera) -> tuple[Neighbour, ...]:
        """Choose the views to render a camera from, and their weights.

        Raises:
            ValueError: There is no view.
        """
        usable = self._usable
        cameras = [self.mpis[i].camera for i in usable]
        chosen = choose_views(cameras, camera, self.options, get_mpi=lambda k: self.mpis[usable[k]])
        return tuple(replace(neighbour, index=usable[neighbour.index]) for neighbour in chosen)

    @property
    def _usable(self) -> Sequence[int]:
        """Numbers of the views that are shown."""
        metric = [i for i in range(len(self.mpis)) if i not in self.guessed]
        return metric or range(len(self.mpis))

    def render(
        self,
        camera: Camera,
        *,
        neighbours: Sequence[Neighbour] | None = None,
        scratch: Scratch | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> Rendering:
        """Render the scene from anywhere; what the blended views leave empty is filled.

        Args:
            camera: Where from.
            neighbours: The views to blend, else those that `choose_views` gives.
            scratch: Room to work in, else new room is taken.
            stopwatch: Takes the time of every stage.

        Raises:
            ValueError: There is no view.
        """
        if neighbours is None:
            with _stage(stopwatch, "nearest"):
                neighbours = self.choose_views(camera)
        blended = render_views(
            [self.mpis[neighbour.index] for neighbour in neighbours],
            [neighbour.weight for neighbour in neighbours],
            camera,
            opacity=self.options.opacity,
            scratch=scratch,
            stopwatch=stopwatch,
        )
        with _stage(stopwatch, "fill"):
            usable = self._usable
            among = [
                replace(neighbour, index=usable.index(neighbour.index)) for neighbour in neighbours
            ]
            filled, _ = fill_holes(
                blended,
                [self.mpis[i].camera for i in usable],
                camera,
                self.options,
                neighbours=among,
                get_mpi=lambda k: self.mpis[usable[k]],
            )
        return filled

    def compare(
        self,
        live: UInt8[np.ndarray, "h w 3"],
        camera: Camera,
        *,
        depth_m: Float32[np.ndarray, "dh dw"] | None = None,
        neighbours: Sequence[Neighbour] | None = None,
        scratch: Scratch | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> Comparison:
        """Render the scene for a live picture, and compare the two (paper, section 3.2).

        Args:
            live: The picture, of the camera's size.
            camera: Where it was taken.
            depth_m: Depth that was measured with it, of the same field of view; 0 = unknown.
            neighbours: The views to render from, else those that `choose_views` gives.
            scratch: Room to work in, else new room is taken.
            stopwatch: Takes the time of every stage.

        Raises:
            ValueError: There is no view, or the sizes differ.
        """
        if neighbours is None:
            with _stage(stopwatch, "nearest"):
                neighbours = self.choose_views(camera)
        rendering = self.render(camera, neighbours=neighbours, scratch=scratch, stopwatch=stopwatch)
        errors = self.errors_of(rendering, live, camera, depth_m=depth_m, stopwatch=stopwatch)
        return Comparison(rendering, errors, tuple(neighbours))

    def errors_of(
        self,
        rendering: Rendering,
        live: UInt8[np.ndarray, "h w 3"],
        camera: Camera,
        *,
        depth_m: Float32[np.ndarray, "dh dw"] | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> ErrorMap:
        """Return where a rendering and a live picture differ, and what the memory says of it.

        Args:
            rendering: Of the camera.
            live: The picture, of its size.
            camera: Where it was taken.
            depth_m: As in `compare`.
            stopwatch: Takes the time of every stage.

        Raises:
            ValueError: The sizes differ.
        """
        unseen = None
        if self.memory is not None:
            with _stage(stopwatch, "remember"):
                sight = self.memory.look(camera, depth_m)
                unseen = sight.unseen_at(*camera.pinhole.size_px)
        with _stage(stopwatch, "compare"):
            errors = compare_with(self.options, rendering, live, unseen=unseen)
        if self.memory is None or self.options.marks == "paper":
            return errors
        with _stage(stopwatch, "remember"):
            return errors.without(self.memory.moved(camera, errors.wrong, depth_m))


def compare_with(
    options: Options,
    rendering: Rendering,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    unseen: Bool[np.ndarray, "h w"] | None = None,
) -> ErrorMap:
    """Compare a rendering with the live picture as the options say.

    Args:
        options: How.
        rendering: What the views show.
        live: The picture.
        unseen: What no view has seen; else where the rendering is empty.

    Raises:
        ValueError: The sizes differ.
    """
    return compare(
        rendering,
        live,
        unseen=unseen,
        marks=options.marks,
        threshold=options.error_threshold,
        shift_px=options.shift_px,
        compensate_exposure=options.compensate_exposure,
    )


def _stage(stopwatch: Stopwatch | None, name: str) -> AbstractContextManager[None]:
    return nullcontext() if stopwatch is None else stopwatch.stage(name)
