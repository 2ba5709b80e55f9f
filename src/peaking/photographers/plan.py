"""What photographers are to do, and the steps that it takes."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from peaking.experiments.plan import EvaluationStep
from peaking.experiments.reconstruct import SplatTraining
from peaking.photographers.guides import GUIDE_NAMES, GUIDES, REFERENCE, VIEWS, GuideName
from peaking.photographers.sensor import Shot
from peaking.photographers.tasks import SCENE_NAMES, TASKS, SceneName


@dataclass(frozen=True)
class PhotographersPlan:
    """Who photographs what, with which guides."""

    scenes: tuple[SceneName, ...] = SCENE_NAMES
    guides: tuple[GuideName, ...] = GUIDE_NAMES
    photos: tuple[int, ...] = (8, 16, 32)
    """Limits of photos; each is a session of its own, where knowing it matters."""
    seconds: float = 60.0
    """A session is over after them."""
    photographers: int = 12
    """With every guide in every scene."""
    test_views: int = 24
    """Pictures of every scene that are compared, from its whole volume."""
    splats: int = 0
    """Of how many photographers 3D Gaussians are trained too, at the largest limit."""
    splat: SplatTraining = field(default_factory=SplatTraining)

    def __post_init__(self) -> None:
        for name in ("scenes", "guides", "photos"):
            given = getattr(self, name)
            if not given or len(set(given)) < len(given):
                raise ValueError(f"need different {name}, at least one, got {list(given)}")
        unknown = [*set(self.scenes) - set(TASKS), *set(self.guides) - set(GUIDES)]
        if unknown:
            raise ValueError(f"need known scenes and guides, got {unknown}")
        if min(self.photos) < 1:
            raise ValueError(f"need photos >= 1, got {min(self.photos)}")
        if not 1 <= self.seconds < math.inf:
            raise ValueError(f"need seconds >= 1, got {self.seconds}")
        for name, least in (("photographers", 1), ("test_views", 1), ("splats", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"need {name} >= {least}, got {getattr(self, name)}")

    @property
    def reference(self) -> GuideName:
        """The guide that the others are compared with."""
        return REFERENCE if REFERENCE in self.guides else self.guides[0]

    def as_dict(self) -> dict[str, Any]:
        """Return it as it is written into results."""
        return {**asdict(self), "reference": self.reference, "views": VIEWS.as_dict()}


@dataclass(frozen=True)
class SessionStep(EvaluationStep):
    """One photographer with one guide: what they take, and how well it shows the scene."""

    place: SceneName
    guide: GuideName
    photographer: int
    photos: tuple[int, ...]
    """Limits to score."""
    seconds: float
    test_views: int


@dataclass(frozen=True)
class SplatStep(EvaluationStep):
    """Train 3D Gaussians on what a photographer kept."""

    place: SceneName
    guide: GuideName
    photographer: int
    shots: tuple[Shot, ...]
    test_views: int
    splat: SplatTraining


def session_steps(plan: PhotographersPlan) -> list[SessionStep]:
    """Return every session; those of a scene are neighbours, for it takes seconds to build."""
    return [
        SessionStep(scene, guide, photographer, plan.photos, plan.seconds, plan.test_views)
        for scene in plan.scenes
        for photographer in range(plan.photographers)
        for guide in plan.guides
    ]
