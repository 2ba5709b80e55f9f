"""Train Gaussians on posed pictures (Kerbl et al. 2023): one schedule for all backends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from peaking.frame import Frame
from peaking.geometry import Camera, near_origin_m
from peaking.point_cloud import PointCloud
from peaking.splat.columns import (
    LOG_SCALES,
    MEANS,
    NUM_COLUMNS,
    OPACITY_LOGIT,
    QUAT_W,
    QUATS,
    SH0,
    SHN,
)
from peaking.splat.gaussians import Gaussians, Parameters
from peaking.splat.initialisation import initial_points
from peaking.splat.optimiser import AdamState, Optimiser
from peaking.splat.options import SplatOptions
from peaking.splat.refinement import refine
from peaking.splat.rendering import C0
from peaking.splat.snapshot import Snapshot

__all__ = ["Backend", "SplatOptions", "Trainer", "TrainingStep", "train"]

Backend = Literal["numba", "gsplat"]
DEFAULT = SplatOptions()


@dataclass(frozen=True)
class TrainingStep:
    """What one step of training did."""

    iteration: int
    loss: float
    num_gaussians: int


def train(
    frames: Sequence[Frame],
    options: SplatOptions = DEFAULT,
    *,
    points: PointCloud | None = None,
    backend: Backend = "numba",
    progress: Callable[[TrainingStep], None] | None = None,
) -> Gaussians:
    """Return Gaussians trained on the pictures.

    Args:
        frames: At least one; sizes may differ. The time is proportional to the number of pixels:
            shrink large pictures first (`Frame.resized`).
        options: How to train.
        points: Where to start from; found in the frames when not given (`initial_points`).
        backend: `numba` (CPU) gives the same Gaussians for the same seed, whatever the number of
            threads; `gsplat` (CUDA) sums in any order, so results repeat only approximately.
        progress: Called after every step.

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
    """The state of training; `step` uses one picture."""

    def __init__(
        self,
        frames: Sequence[Frame],
        options: SplatOptions,
        *,
        points: PointCloud | None = None,
        backend: Backend = "numba",
    ) -> None:
        """Place a Gaussian on each point to start from."""
        if not frames:
            raise ValueError("need at least one frame to train on, got none")
        self._origin_m = near_origin_m([frame.camera for frame in frames])
        self._frames = [_from(frame, self._origin_m) for frame in frames]
        self._options = options
        self._rng = np.random.default_rng(options.seed)
        if points is not None:
            points = replace(points, xyz_m=points.xyz_m - self._origin_m)
        else:
            points = initial_points(self._frames, options.max_init_points, self._rng)
        if not len(points):
            raise ValueError("need at least one point to start from, got none")
        points = points.thinned(options.max_init_points, self._rng)
        self._scene_scale_m = _scene_scale_m([frame.camera for frame in self._frames], points.xyz_m)
        initial = AdamState.initial(_initial_parameters(points, options))
        self._optimiser = _create_optimiser(initial, options, backend)
        self._num_gaussians = len(points)
        self._waiting: list[int] = []
        self._iteration = 0

    def gaussians(self) -> Gaussians:
        """Return the Gaussians as they are now, without those that are not finite."""
        parameters = self._optimiser.state().parameters
        finite = np.isfinite(parameters).all(axis=1)
        return Gaussians.from_parameters(parameters[finite], origin_m=self._origin_m)

    def step(self) -> TrainingStep:
        """Train on the next picture; every picture is used once before any is used again."""
        o = self._options
        if not self._waiting:
            self._waiting = self._rng.permutation(len(self._frames)).tolist()
        frame = self._frames[self._waiting.pop()]
        if self._iteration < o.half_size_share * o.iterations:
            width, height = frame.camera.pinhole.size_px
            frame = frame.resized(max(16, width // 2), max(16, height // 2))
        self._iteration += 1
        loss = self._optimiser.step(frame, self._learning_rates())
        share = self._iteration / o.iterations
        due = self._iteration % o.refine_every == 0
        if due and o.refine_start_share <= share <= o.refine_stop_share:
            self._refine()
        return TrainingStep(self._iteration, loss, self._num_gaussians)

    @property
    def iteration(self) -> int:
        """Steps that were taken."""
        return self._iteration

    @property
    def num_gaussians(self) -> int:
        """Gaussians that there are."""
        return self._num_gaussians

    def snapshot(self) -> Snapshot:
        """Return all that changes while one trains; to be written or used before the next step."""
        return Snapshot(
            self._optimiser.state(),
            self._optimiser.progress(),
            self._iteration,
            tuple(self._waiting),
            dict(self._rng.bit_generator.state),
            self._names,
        )

    def go_on(self, snapshot: Snapshot) -> None:
        """Go on from where another training of the same pictures and options stopped.

        Raises:
            ValueError: It is of other pictures, or of other options.
        """
        columns = NUM_COLUMNS[self._options.sh_degree]
        if snapshot.state.parameters.shape[1:] != (columns,):
            raise ValueError(f"need parameters of {columns} columns to go on from")
        within = all(0 <= index < len(self._frames) for index in snapshot.waiting)
        if snapshot.pictures != self._names or not within:
            raise ValueError("need the pictures of the training that stopped")
        self._optimiser.go_on(snapshot.state, snapshot.progress)
        self._num_gaussians = len(snapshot.state.parameters)
        self._iteration = snapshot.iteration
        self._waiting = list(snapshot.waiting)
        self._rng.bit_generator.state = snapshot.random

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(frame.name for frame in self._frames)

    def _learning_rates(self) -> Float32[np.ndarray, "columns"]:
        """Return one for each column of the parameters."""
        o = self._options
        share = self._iteration / o.iterations
        start = o.lr_decay_start_share
        decay = o.lr_decay_to ** max(0.0, (share - start) / (1 - start))
        rates = np.empty(NUM_COLUMNS[o.sh_degree])
        rates[MEANS] = o.means_lr * self._scene_scale_m * 0.01**share
        rates[LOG_SCALES] = o.scales_lr * decay
        rates[QUATS] = o.quats_lr * decay
        rates[OPACITY_LOGIT] = o.opacities_lr * decay
        rates[SH0] = o.sh0_lr * decay
        rates[SHN] = o.shn_lr * decay
        return rates.astype(np.float32)

    def _refine(self) -> None:
        state = refine(
            self._optimiser.state(),
            self._optimiser.mean_grad2d(),
            self._options,
            scene_scale_m=self._scene_scale_m,
            rng=self._rng,
        )
        self._optimiser.reset(state)
        self._num_gaussians = len(state.parameters)


def _from(frame: Frame, origin_m: Float64[np.ndarray, "3"]) -> Frame:
    return replace(frame, camera=frame.camera.relative_to(origin_m))


def _create_optimiser(state: AdamState, options: SplatOptions, backend: Backend) -> Optimiser:
    if backend == "gsplat":
        from peaking.splat._gsplat import GsplatOptimiser

        return GsplatOptimiser(state, options.cut_offs)
    from peaking.splat._numba import NumbaOptimiser

    return NumbaOptimiser(state, options.cut_offs)


def _initial_parameters(points: PointCloud, options: SplatOptions) -> Parameters:
    """Return round Gaussians, sized by the distance to the nearest other points."""
    parameters = np.zeros((len(points), NUM_COLUMNS[options.sh_degree]), np.float32)
    parameters[:, MEANS] = points.xyz_m
    spacing_m = _spacing_m(points.xyz_m)
    spacing_m = np.clip(spacing_m, 1e-6, np.percentile(spacing_m, 95) + 1e-6)
    parameters[:, LOG_SCALES] = np.log(options.init_scale * spacing_m)[:, None]
    parameters[:, QUAT_W] = 1
    parameters[:, OPACITY_LOGIT] = np.log(options.init_opacity / (1 - options.init_opacity))
    parameters[:, SH0] = (points.rgb - 0.5) / C0
    return parameters


def _spacing_m(xyz_m: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n"]:
    """Return the root mean square distance to the three nearest others."""
    if len(xyz_m) < 4:
        return np.full(len(xyz_m), 0.1)
    data = xyz_m.astype(np.float32)
    index = cv2.flann.Index(data, {"algorithm": 4, "leaf_max_size": 10})
    _, squares = index.knnSearch(data, 4, params={})
    return np.sqrt(np.maximum(squares[:, 1:].astype(np.float64), 0).mean(axis=1))


def _scene_scale_m(cameras: Sequence[Camera], xyz_m: Float64[np.ndarray, "n 3"]) -> float:
    """Return 1.1 times the radius of the camera positions, or a tenth of the scene's if greater."""
    positions_m = np.array([camera.position_m for camera in cameras])
    center_m = positions_m.mean(axis=0)
    radius_m = float(np.linalg.norm(positions_m - center_m, axis=1).max())
    distance_m = float(np.median(np.linalg.norm(xyz_m - center_m, axis=1)))
    return 1.1 * max(radius_m, 0.1 * distance_m)
