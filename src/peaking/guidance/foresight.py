"""What is foreseen of a picture that was never taken: how much is new, and how wrong the rest.

views ── render the nearest ──► foretell ──► wrong, shown by so many ──┐
memory ── look ───────────────────────────► never seen ────────────────┴──► Foresight
"""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from peaking.geometry import Camera
from peaking.guidance._foresight_numpy import WRONG
from peaking.memory import COARSER, Memory
from peaking.mpi import Mpi
from peaking.options import Options
from peaking.rendering import Backend, render
from peaking.view_weights import Neighbour, nearest_by_overlap

PIXELS = 3000
"""Of a foreseen picture."""

NOTHING = 0.2
"""Mean squared error of a pixel that shows nothing."""

HIDDEN = 0.1
"""The same where another view than those blended saw something."""

GOOD = 0.003
"""The same of the best pictures that MPIs give: 25 dB."""

SHRUNK = 0.5
"""A blend is so much less wrong than its views: their errors differ."""

LOOKED_RAD, LOOKED_TURN_RAD = 0.1, math.radians(20)
"""A view this close, as an angle at the scene's depth, that looks the same way would have seen what
is there, if anything is."""


@dataclass(frozen=True)
class Foresight:
    """What is foreseen of a picture; shares are of all of its pixels, 0…1.

    Attributes:
        error: Mean squared error over pixels and channels.
        new: What no view has seen.
        wrong: What views have seen and will show wrongly.
        one_side: The part of `wrong` that one of the nearest views shows alone.
        lost: The part of `new` and `wrong` that more views will not mend.
        towards: Where in the picture the new lies: x right, y down, -1…1 from the middle.
    """

    error: float
    new: float
    wrong: float
    one_side: float
    lost: float
    towards: tuple[float, float]

    @property
    def help(self) -> float:
        """How much of the picture a view from here would mend."""
        return max(self.new + self.wrong - self.lost, 0.0)

    @property
    def complete(self) -> float:
        """How near the picture is to a good one: 0 shows nothing, 1 is as good as can be.

        By the root of the mean squared error, of `NOTHING` and of `GOOD`.
        """
        nothing, good = math.sqrt(NOTHING + GOOD), math.sqrt(GOOD)
        return min(max((nothing - math.sqrt(self.error)) / (nothing - good), 0.0), 1.0)


@dataclass(frozen=True)
class SmallViews:
    """Views with small MPIs, and what they have seen.

    Attributes:
        mpis: The views, in metres.
        memory: Of their surface.
        depth_m: How far away things typically are.
        options: How views are blended.
    """

    mpis: Sequence[Mpi]
    memory: Memory
    depth_m: float
    options: Options

    def nearest(self, camera: Camera) -> tuple[Neighbour, ...]:
        """Return the views that a picture would be blended from."""
        cameras = [mpi.camera for mpi in self.mpis]
        return nearest_by_overlap(cameras, camera, self.depth_m, count=self.options.neighbours)

    def foresee(
        self,
        camera: Camera,
        neighbours: Sequence[Neighbour] | None = None,
        *,
        backend: Backend = "numba",
    ) -> Foresight:
        """Foresee a picture.

        Args:
            camera: Where from; the smaller, the sooner it is done (`PIXELS`).
            neighbours: The views it is blended from, else the nearest.
            backend: Which implementation.
        """
        neighbours = self.nearest(camera) if neighbours is None else neighbours
        rendered = [render(self.mpis[n.index], camera, backend=backend) for n in neighbours]
        if backend == "numba":
            from peaking.guidance import _foresight_numba as module
        else:
            from peaking.guidance import _foresight_numpy as module
        error, seen_by, alike = module.foretell(
            np.stack([rendering.rgba for rendering in rendered]),
            np.stack([rendering.depth_m for rendering in rendered]),
            np.array([n.weight for n in neighbours]),
            np.array([n.distance_m for n in neighbours]),
        )
        width, height = camera.pinhole.size_px
        new = self.memory.look(camera.resized(COARSER * width, COARSER * height)).unseen
        empty = (seen_by == 0) & ~new
        squared = np.where(new, NOTHING, np.where(empty, HIDDEN, SHRUNK * error)) + GOOD
        wrong = ~new & (empty | (error > WRONG))
        lost = (wrong & alike) | (new & self._looked_at(camera))
        return Foresight(
            error=float(squared.mean()),
            new=float(new.mean()),
            wrong=float(wrong.mean()),
            one_side=float((wrong & (seen_by == 1)).mean()),
            lost=float(lost.mean()),
            towards=_towards(new & ~lost),
        )

    def _looked_at(self, camera: Camera) -> Bool[np.ndarray, "h w"]:
        """Return what lies in the picture of a view that is about here and looks this way."""
        looked = np.zeros(camera.pinhole.size_px[::-1], np.bool_)
        for mpi in self.mpis:
            away_m = float(np.linalg.norm(mpi.camera.position_m - camera.position_m))
            turned = float(mpi.camera.forward @ camera.forward)
            if away_m < LOOKED_RAD * self.depth_m and turned > math.cos(LOOKED_TURN_RAD):
                points_m = camera.world_from_cam.apply(camera.pinhole.rays() * self.depth_m)
                looked |= mpi.camera.sees(points_m)
        return looked


def _towards(there: Bool[np.ndarray, "h w"]) -> tuple[float, float]:
    """Return the middle of a part of the picture, -1…1; that of the picture where it is empty."""
    height, width = there.shape
    rows, cols = np.nonzero(there)
    if len(rows) == 0:
        return 0.0, 0.0
    x = _middle(cols.astype(np.float64), width)
    return x, _middle(rows.astype(np.float64), height)


def _middle(places: Float64[np.ndarray, "n"], size: int) -> float:
    return float(2 * (places.mean() + 0.5) / size - 1)
