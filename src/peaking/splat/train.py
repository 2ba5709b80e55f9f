"""Training Gaussians on posed pictures (Kerbl et al. 2023, on the CPU)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.splat import _project_numba
from peaking.splat.gaussians import Gaussians, Parameters
from peaking.splat.loss import loss_and_gradient
from peaking.splat.rasterise import CutOffs, Tape
from peaking.splat.seeds import Points, seed_points, thinned


@dataclass(frozen=True)
class SplatOptions:
    """How to train; rates are Adam's, per step."""

    iterations: int = 2000
    """Pictures looked at."""
    seed: int = 0
    """Of the order of pictures and of where Gaussians split."""
    seed_count: int = 12000
    """Points to start from, at most."""
    max_count: int = 60000
    """Gaussians at most; bounds time and memory."""
    sh_degree: int = 1
    """0: the same colour from everywhere; 1: brighter from one side."""
    coarse_share: float = 0.2
    """Share of the steps at half the size."""
    position_rate: float = 1.6e-4
    """In extents of the cameras; falls exponentially to a hundredth."""
    scale_rate: float = 5e-3
    rotation_rate: float = 1e-3
    opacity_rate: float = 5e-2
    colour_rate: float = 5e-3
    direction_rate: float = 2.5e-4
    densify_every: int = 100
    densify_from: float = 0.1
    densify_until: float = 0.6
    """Shares of the steps."""
    densify_gradient: float = 4e-4
    """Mean gradient by the position (in half pictures) above which one becomes two."""
    split_size: float = 0.01
    """In extents of the cameras: larger ones are split, smaller ones are doubled."""
    prune_opacity: float = 0.005
    cut_offs: CutOffs = field(default_factory=CutOffs)

    def __post_init__(self) -> None:
        if self.iterations < 1 or self.seed_count < 1 or self.max_count < 1:
            raise ValueError("need iterations, seed_count and max_count of at least 1")
        if self.sh_degree not in (0, 1):
            raise ValueError(f"need an sh_degree of 0 or 1, got {self.sh_degree}")
        if not (0 <= self.coarse_share <= 1 and self.densify_every > 0):
            raise ValueError("need 0 <= coarse_share <= 1 and densify_every > 0")


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
    progress: Callable[[Step], None] | None = None,
) -> Gaussians:
    """Return Gaussians that look like the pictures; the same seed gives the same ones.

    Args:
        frames: At least one; sizes may differ. Training costs by the pixel: make them small before
            (`Frame.resized`).
        options: How to train.
        points: Where to start from; found in the frames when not given (`seed_points`).
        progress: Is told about every step.

    Raises:
        ValueError: There are no frames, or no points.
    """
    trainer = Trainer(frames, options, points=points)
    for _ in range(options.iterations):
        step = trainer.step()
        if progress is not None:
            progress(step)
    return trainer.gaussians()


class Trainer:
    """The state of training; `step` looks at one picture."""

    def __init__(
        self, frames: Sequence[Frame], options: SplatOptions, *, points: Points | None = None
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
        self._parameters = _placed(points, options.sh_degree)
        self._first = np.zeros_like(self._parameters)
        self._second = np.zeros_like(self._parameters)
        self._screen = np.zeros((len(self._parameters), 2), np.float32)
        self._waiting: list[int] = []
        self._iteration = 0

    def gaussians(self) -> Gaussians:
        """Return what was learnt so far; Gaussians that are not finite are left out."""
        finite = np.isfinite(self._parameters).all(axis=1)
        return Gaussians.unpacked(self._parameters[finite])

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
        tape = Tape(self._parameters, frame.camera, o.cut_offs)
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        loss, by_rgb = loss_and_gradient(np.ascontiguousarray(tape.rgb), photo)
        gradients = tape.gradients(by_rgb, self._screen)
        _project_numba.adam_step(
            self._parameters, gradients, self._first, self._second, self._rates(), self._iteration
        )
        share = self._iteration / o.iterations
        due = self._iteration % o.densify_every == 0
        if due and o.densify_from <= share <= o.densify_until:
            self._densify()
        return Step(self._iteration, loss, len(self._parameters))

    def _rates(self) -> Float32[np.ndarray, "columns"]:
        o = self._options
        position = o.position_rate * self._extent_m * 0.01 ** (self._iteration / o.iterations)
        rates = [position] * 3 + [o.scale_rate] * 3 + [o.rotation_rate] * 4 + [o.opacity_rate]
        rates += [o.colour_rate] * 3 + [o.direction_rate] * (self._parameters.shape[1] - 14)
        return np.array(rates, np.float32)

    def _densify(self) -> None:
        """Double or split what the loss pulls about, and drop what is transparent or broken."""
        o = self._options
        p = self._parameters
        pull = self._screen[:, 0] / np.maximum(self._screen[:, 1], 1)
        opacity = 1 / (1 + np.exp(-p[:, 10].astype(np.float64)))
        sound = np.isfinite(p).all(axis=1) & (opacity > o.prune_opacity)
        hot = sound & (pull > o.densify_gradient)
        room = max(0, o.max_count - int(sound.sum()))
        if hot.sum() > room:
            strongest = np.argsort(np.where(hot, -pull, np.inf), kind="stable")[:room]
            hot = np.zeros_like(hot)
            hot[strongest] = True
        large = np.exp(p[:, 3:6]).max(axis=1) > o.split_size * self._extent_m
        split, kept = hot & large, sound & ~(hot & large)
        halves = [_half(p[split], self._rng) for _ in range(2)]
        self._parameters = np.concatenate([p[kept], p[hot & ~large], *halves])
        fresh = np.zeros((len(self._parameters) - int(kept.sum()), p.shape[1]), np.float32)
        self._first = np.concatenate([self._first[kept], fresh])
        self._second = np.concatenate([self._second[kept], fresh])
        self._screen = np.zeros((len(self._parameters), 2), np.float32)


def _half(rows: Parameters, rng: np.random.Generator) -> Parameters:
    """Return Gaussians 1.6 times smaller at places drawn from the given ones."""
    halves = rows.copy()
    w, a, b, c = (rows[:, 6:10] / np.linalg.norm(rows[:, 6:10], axis=1, keepdims=True)).T
    rotation = np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    away = rng.normal(size=(len(rows), 3)) * np.exp(rows[:, 3:6])
    halves[:, :3] += np.einsum("ijn,nj->ni", rotation, away).astype(np.float32)
    halves[:, 3:6] -= np.float32(np.log(1.6))
    return halves


def _placed(points: Points, sh_degree: int) -> Parameters:
    """Return round Gaussians, as large as the distance to the nearest others."""
    places = points.places_m
    n = len(places)
    parameters = np.zeros((n, 14 if sh_degree == 0 else 23), np.float32)
    parameters[:, :3] = places
    spacing = _spacing(places)
    spacing = np.clip(spacing, 1e-6, np.percentile(spacing, 95) + 1e-6)
    parameters[:, 3:6] = np.log(spacing)[:, None]
    parameters[:, 6] = 1
    parameters[:, 10] = np.log(0.1 / 0.9)
    parameters[:, 11:14] = (points.rgb - 0.5) / _project_numba.C0
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
