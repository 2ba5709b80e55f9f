"""What is to be evaluated, and the steps that it takes: choosing views, then scoring them.

A step is plain data with a key: what was done under a key is found again when the run goes on.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import peaking
from peaking.datasets.registry import AS_FOUND, Reading
from peaking.errors import RecordingError
from peaking.experiments.placing import Placement, Pose
from peaking.experiments.reconstruct import ModelKind, SplatTraining
from peaking.experiments.results import Case
from peaking.experiments.splits import TestViews
from peaking.metrics.lpips import LpipsName
from peaking.options import DEFAULT, PAPER_PEAKED_SHARE, POLICY_NAMES, Options, PolicyName
from peaking.selection.registry import POLICIES

REFERENCE: PolicyName = "peaking"
"""The strategy that the others are compared with, where it takes part."""


@dataclass(frozen=True)
class EvaluationOptions:
    """What to evaluate, and how."""

    scenes: tuple[Path, ...]
    options: Options = DEFAULT
    strategies: tuple[PolicyName, ...] = POLICY_NAMES
    reconstruct: tuple[ModelKind, ...] = ("mpi",)
    test_views: tuple[TestViews, ...] = ("holdout",)
    views: tuple[int, ...] | Literal["threshold-count"] | None = None
    """Numbers of views; or as many as `threshold` takes at `threshold_share`; or three budgets."""
    threshold_share: float = PAPER_PEAKED_SHARE
    seeds: int = 5
    uniform_metres_per_rad: float = 0.0
    """What a rotation counts as on the path of `uniform`, in metres; 0 leaves rotations out."""
    splat: SplatTraining = field(default_factory=SplatTraining)
    cameras: Literal["recorded", "colmap"] = "recorded"
    """Where 3D Gaussians are trained and tested from."""
    refine: bool = False
    """Mend the recorded poses first, for everything."""
    reading: Reading = AS_FOUND
    """How the recordings are read."""
    lpips_folder: Path | None = None

    def __post_init__(self) -> None:
        unknown = [name for name in self.strategies if name not in POLICIES]
        if unknown or not self.strategies:
            raise ValueError(f"need strategies among {', '.join(POLICIES)}, got {unknown}")
        for name in ("scenes", "reconstruct", "test_views"):
            if not getattr(self, name):
                raise ValueError(f"need at least one of {name}")
        if self.seeds < 1:
            raise ValueError(f"need seeds >= 1, got {self.seeds}")
        if len({scene.resolve().name for scene in self.scenes}) < len(self.scenes):
            raise ValueError("need scenes whose folders have different names")
        if self.reading.images is not None and len(self.scenes) > 1:
            raise ValueError("need one scene for --images, the folder of its pictures")
        if not 0 <= self.threshold_share < 1:
            raise ValueError(f"need 0 <= threshold_share < 1, got {self.threshold_share}")
        if not 0 <= self.uniform_metres_per_rad < math.inf:
            raise ValueError(f"need uniform_metres_per_rad >= 0, got {self.uniform_metres_per_rad}")
        if isinstance(self.views, tuple) and (not self.views or min(self.views) < 1):
            raise ValueError(f"need numbers of views >= 1, got {self.views}")
        if self.cameras == "colmap" and "3dgs" not in self.reconstruct:
            raise ValueError(
                "need --reconstruct 3dgs for --cameras colmap; MPIs stay at the recorded cameras"
            )
        if self.cameras == "colmap" and self.refine:
            raise ValueError("need one of --refine and --cameras colmap")

    @property
    def reference(self) -> PolicyName:
        """The strategy that the others are compared with."""
        return REFERENCE if REFERENCE in self.strategies else self.strategies[0]

    def as_dict(self) -> dict[str, Any]:
        """Return the configuration as it is written into results, without paths of this machine."""
        return {
            "scenes": [scene.resolve().name for scene in self.scenes],
            "strategies": list(self.strategies),
            "reconstruct": list(self.reconstruct),
            "test_views": list(self.test_views),
            "views": self.views if not isinstance(self.views, tuple) else list(self.views),
            "threshold_share": self.threshold_share,
            "seeds": self.seeds,
            "uniform_metres_per_rad": self.uniform_metres_per_rad,
            "reference": self.reference,
            "splat": asdict(self.splat),
            "cameras": self.cameras,
            "refine": self.refine,
            "options": self.options.as_dict(),
        }


@dataclass(frozen=True)
class EvaluationStep:
    """What an executor does: a step of an evaluation, or of an experiment of another kind."""


@dataclass(frozen=True)
class CountStep(EvaluationStep):
    """Count the views that the paper's rule takes."""

    scene: Path
    fingerprint: str
    options: Options
    threshold_share: float
    mpis: Path | None = None
    """Folder for MPIs that all workers share."""
    reading: Reading = AS_FOUND


@dataclass(frozen=True)
class PlaceStep(EvaluationStep):
    """Let COLMAP say where the frames were taken."""

    scene: Path
    fingerprint: str
    reading: Reading = AS_FOUND


@dataclass(frozen=True)
class ChooseStep(EvaluationStep):
    """Let a strategy choose."""

    scene: Path
    fingerprint: str
    options: Options
    strategy: PolicyName
    test_views: TestViews
    num_views: int
    seed: int
    uniform_metres_per_rad: float = 0.0
    """0 too where Uniform decides neither the views nor the test views."""
    mpis: Path | None = None
    """Folder for MPIs that all workers share."""
    reading: Reading = AS_FOUND


@dataclass(frozen=True)
class ScoreStep(EvaluationStep):
    """Reconstruct from views, and score test views."""

    scene: Path
    fingerprint: str
    options: Options
    reconstruct: ModelKind
    views: tuple[int, ...]
    test: tuple[int, ...]
    seed: int
    splat: SplatTraining | None
    poses: tuple[Pose, ...] | None
    """Where the views and the test views were taken; None: where they were recorded."""
    lpips: tuple[LpipsName, ...]
    lpips_folder: Path | None
    mpis: Path | None = None
    """Folder for MPIs that all workers share."""
    reading: Reading = AS_FOUND


def key_of(step: EvaluationStep) -> str:
    """Return a name that changes with everything that a step's result depends on.

    The fingerprint is of the recording as it was read.
    """
    fields = {"step": type(step).__name__, "version": peaking.__version__, **asdict(step)}
    for path in ("scene", "reading", "lpips_folder", "mpis"):
        fields.pop(path, None)
    text = json.dumps(fields, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def choose_steps(
    plan: EvaluationOptions,
    scene: Path,
    fingerprint: str,
    counts: Sequence[int],
    *,
    mpis: Path | None = None,
) -> list[ChooseStep]:
    """Return every choice that a scene needs; strategies without chance have one seed."""
    return [
        ChooseStep(
            scene,
            fingerprint,
            plan.options,
            strategy,
            test_views,
            count,
            seed,
            uniform_metres_per_rad=plan.uniform_metres_per_rad
            if strategy == "uniform" or test_views == "paper"
            else 0.0,
            mpis=mpis,
            reading=plan.reading,
        )
        for test_views in plan.test_views
        for count in counts
        for strategy in plan.strategies
        for seed in range(plan.seeds if POLICIES[strategy].is_random else 1)
    ]


def score_step(
    plan: EvaluationOptions,
    chosen: ChooseStep,
    found: dict[str, Any],
    *,
    how: ModelKind,
    placement: Placement | None,
    lpips: tuple[LpipsName, ...],
) -> ScoreStep:
    """Return the step that scores a choice; equal choices of two strategies give equal steps.

    Raises:
        RecordingError: COLMAP placed none of the views, or none of the test views.
    """
    with_splat = how == "3dgs"
    views, test = tuple(found["views"]), tuple(found["test"])
    poses = None
    if with_splat and placement is not None:
        views, test = placement.placed(views), placement.placed(test)
        if not views or not test:
            raise RecordingError(
                chosen.scene,
                f"COLMAP placed {len(views)} of the {chosen.num_views} views that "
                f"{chosen.strategy} chose and {len(test)} of the {len(found['test'])} test views",
                remedy="take --cameras recorded",
            )
        poses = tuple(placement.at(i) for i in (*views, *test))
    return ScoreStep(
        scene=chosen.scene,
        fingerprint=chosen.fingerprint,
        options=chosen.options,
        reconstruct=how,
        views=views,
        test=test,
        seed=chosen.seed if with_splat else 0,
        splat=plan.splat if with_splat else None,
        poses=poses,
        lpips=lpips,
        lpips_folder=plan.lpips_folder,
        mpis=chosen.mpis,
        reading=chosen.reading,
    )


def case_of(chosen: ChooseStep, found: dict[str, Any], *, how: ModelKind) -> Case:
    """Return what a scored choice is called in the results."""
    return Case(
        scene=chosen.scene.resolve().name,
        strategy=chosen.strategy,
        reconstruct=how,
        test_views=chosen.test_views,
        n_views=len(found["views"]),
        seed=chosen.seed,
    )
