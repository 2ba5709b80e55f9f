"""Training Gaussians on posed pictures (Kerbl et al. 2023): the schedule, for every backend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.splat.densify import densify
from peaking.splat.gaussians import Gaussians, Parameters
from peaking.splat.optimiser import Moments, Optimiser
from peaking.splat.options import SplatOptions
from peaking.splat.seeds import Points, seed_points, thinned
from peaking.splat.view import C0

__all__ = ["Backend", "SplatOptions", "Step", "Trainer", "train"]

Backend = Literal["numba", "gsplat"]


@dataclass(frozen=True)
class Step:
    """How far training is."""

    iteration: int
    loss: float
    num_gaussians: int


def train(
    frames: Sequence[Frame],
    options: SplatOptions,
    *,
    points: Points | None = None,
    backend: Backend = "numba",
    progress: Callable[[Step], None] | None = None,
) -> Gaussians:
    """Return Gaussians that look like the pictures.

    Args:
        frames: At least one; sizes may differ. Training costs by the pixel: make them small before
            (`Frame.resized`).
        options: How to train.
        points: Where to start from; found in the frames when not given (`seed_points`).
        backend: `numba` (CPU) gives the same Gaussians for the same seed, whatever the number of
            threads; `gsplat` (CUDA) adds in any order and repeats only nearly.
        progress: Is told about every step.

    Raises:
        ValueError: There are no frames, or no points.
        BackendUnavailable: gsplat, torch or CUDA is missing.
    """
    trainer = Trainer(frames, options, points=points, backend=backend)
    for _ in range(options.iterations):
        step = trainer.step()
        if progress is not None:
            progress(step)
    return trainer.gaussians()


class Trainer:
    """The state of training; `step` looks at one picture."""

    def __init__(
        self,
        frames: Sequence[Frame],
        options: SplatOptions,
        *,
        points: Points | None = None,
        backend: Backend = "numba",
    ) -> None:
        """Place a Gaussian on each point to start from."""
        if not frames:
            raise ValueError("need at least one frame to train on, got none")
        self._frames = frames
        self._options = options
        self._rng = np.random.default_rng(options.seed)
        if points is None:
            points = seed_points(frames, options.seed_count, self._rng)
        if not len(points):
            raise ValueError("need at least one point to start from, got none")
        points = thinned(points, options.seed_count, self._rng)
        self._extent_m = _extent_m([frame.camera for frame in frames], points.places_m)
        placed = Moments.fresh(_placed(points, options))
        self._optimiser = _optimiser(placed, options, backend)
        self._num_gaussians = len(points)
        self._waiting: list[int] = []
        self._iteration = 0

    def gaussians(self) -> Gaussians:
        """Return what was learnt so far; Gaussians that are not finite are left out."""
        parameters = self._optimiser.moments().parameters
        return Gaussians.unpacked(parameters[np.isfinite(parameters).all(axis=1)])

    def step(self) -> Step:
        """Look at the next picture (every picture once before any twice) and move."""
        o = self._options
        if not self._waiting:
            self._waiting = self._rng.permutation(len(self._frames)).tolist()
        frame = self._frames[self._waiting.pop()]
        if self._iteration < o.coarse_share * o.iterations:
            width, height = frame.camera.pinhole.size_px
            frame = frame.resized(max(16, width // 2), max(16, height // 2))
        self._iteration += 1
        loss = self._optimiser.step(frame, self._rates())
        share = self._iteration / o.iterations
        due = self._iteration % o.densify_every == 0
        if due and o.densify_from <= share <= o.densify_until:
            self._densify()
        return Step(self._iteration, loss, self._num_gaussians)

    def _rates(self) -> Float32[np.ndarray, "columns"]:
        o = self._options
        share = self._iteration / o.iterations
        position = o.position_rate * self._extent_m * 0.01**share
        rates = [o.scale_rate] * 3 + [o.rotation_rate] * 4 + [o.opacity_rate]
        rates += [o.colour_rate] * 3 + [o.direction_rate] * (9 if o.sh_degree else 0)
        settled = o.settle_to ** max(0.0, (share - o.settle_from) / (1 - o.settle_from))
        return np.array([position] * 3 + [rate * settled for rate in rates], np.float32)

    def _densify(self) -> None:
        moments = densify(
            self._optimiser.moments(),
            self._optimiser.pulls(),
            self._options,
            extent_m=self._extent_m,
            rng=self._rng,
        )
        self._optimiser.restart(moments)
        self._num_gaussians = len(moments.parameters)


def _optimiser(moments: Moments, options: SplatOptions, backend: Backend) -> Optimiser:
    if backend == "gsplat":
        from peaking.splat._gsplat import GsplatOptimiser

        return GsplatOptimiser(moments, options.cut_offs)
    from peaking.splat._numba import NumbaOptimiser

    return NumbaOptimiser(moments, options.cut_offs)


def _placed(points: Points, options: SplatOptions) -> Parameters:
    """Return round Gaussians, as large as the distance to the nearest others says."""
    places = points.places_m
    n = len(places)
    parameters = np.zeros((n, 14 if options.sh_degree == 0 else 23), np.float32)
    parameters[:, :3] = places
    spacing = _spacing(places)
    spacing = np.clip(spacing, 1e-6, np.percentile(spacing, 95) + 1e-6)
    parameters[:, 3:6] = np.log(options.first_size * spacing)[:, None]
    parameters[:, 6] = 1
    parameters[:, 10] = np.log(options.first_opacity / (1 - options.first_opacity))
    parameters[:, 11:14] = (points.rgb - 0.5) / C0
    return parameters


def _spacing(places: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n"]:
    """Return the root mean square distance to the three nearest others."""
    if len(places) < 4:
        return np.full(len(places), 0.1)
    data = places.astype(np.float32)
    index = cv2.flann.Index(data, {"algorithm": 4, "leaf_max_size": 10})
    _, squares = index.knnSearch(data, 4, params={})
    return np.sqrt(np.maximum(squares[:, 1:].astype(np.float64), 0).mean(axis=1))


def _extent_m(cameras: Sequence[Camera], places: Float64[np.ndarray, "n 3"]) -> float:
    """Return 1.1 times the radius of the cameras; a tenth of the scene's where they stand still."""
    eyes = np.array([camera.position_m for camera in cameras])
    radius = float(np.linalg.norm(eyes - eyes.mean(axis=0), axis=1).max())
    away = float(np.median(np.linalg.norm(places - eyes.mean(axis=0), axis=1)))
    return 1.1 * max(radius, 0.1 * away)
