"""How densely to sample: the plenoptic bound of the paper's baseline (LLFF), and its grid of views.

Paper, section 4.1: N = (S W / (2 D z_min tan(θ/2)))², Δu = S / √N. The focal length in pixels is
f = W / (2 tan(θ/2)), so Δu = D z_min / f: between neighbours, what lies between two planes moves
against each other by no more than one pixel. docs/plenoptic.md derives it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from peaking.geometry import Cam, Pinhole, Rigid, World
from peaking.guidance.guide import Guide, Tolerance

LLFF_MOST_DISPARITY_PX = 64.0
"""LLFF's practical limit on what may move between neighbours, besides D and W / 2."""

TOLERANCE_SHARE = 0.25
"""Of the spacing: how far from its target a view may be taken, if nothing else is said."""

_EXACT = 1e-9
"""So that a number of views that is whole but for rounding is not rounded up."""


@dataclass(frozen=True, kw_only=True)
class PlenopticBound:
    """The bound with its inputs; the defaults are the paper's set-up."""

    area_side_m: float = 0.15
    """Side of the square in which views are taken, S."""
    z_min_m: float = 0.5
    """Least depth of the scene."""
    num_planes: int = 32
    """Planes of an MPI, D."""
    width_px: float = 294.0
    """Size of an MPI along the axis of `fov_rad`, W."""
    fov_rad: float = math.radians(45.93)
    """Field of view along that axis, θ."""
    detail_px: float = 1.0
    """The finest detail that counts, in pixels of an MPI: 1 in the paper, more where screen or eye
    resolve less (`viewing`)."""
    cap_disparity: bool = False
    """Use min(D, W/2, 64) in place of D, as LLFF does; the paper does not."""

    def __post_init__(self) -> None:
        for name in ("area_side_m", "z_min_m", "width_px", "detail_px"):
            number = getattr(self, name)
            if not (math.isfinite(number) and number > 0):
                raise ValueError(f"need a finite {name} > 0, got {number}")
        if self.num_planes < 1:
            raise ValueError(f"need num_planes >= 1, got {self.num_planes}")
        if not 0 < self.fov_rad < math.pi:
            raise ValueError(f"need 0 < fov_rad < π, got {self.fov_rad}")

    @classmethod
    def of_camera(
        cls, pinhole: Pinhole, z_min_m: float, *, area_side_m: float = 0.15, num_planes: int = 32
    ) -> PlenopticBound:
        """Return the bound for MPIs of this size, along their width.

        A field of view to the left and right of a principal point that is off the centre is
        replaced by the symmetric one of the same focal length, which is all that counts.
        """
        fov_rad = 2 * math.atan(pinhole.width_px / (2 * pinhole.fx_px))
        return cls(
            area_side_m=area_side_m,
            z_min_m=z_min_m,
            num_planes=num_planes,
            width_px=float(pinhole.width_px),
            fov_rad=fov_rad,
        )

    @property
    def focal_px(self) -> float:
        """Focal length in pixels of an MPI, f = W / (2 tan(θ/2))."""
        return self.width_px / (2 * math.tan(self.fov_rad / 2))

    @property
    def disparity_px(self) -> float:
        """How far the nearest thing may move between neighbours: D, capped where asked for."""
        if not self.cap_disparity:
            return float(self.num_planes)
        return min(float(self.num_planes), self.width_px / 2, LLFF_MOST_DISPARITY_PX)

    @property
    def num_views_exact(self) -> float:
        """N as the formula gives it, not rounded."""
        return (self.area_side_m / self.spacing_m) ** 2

    @property
    def num_views(self) -> int:
        """N, rounded up."""
        return math.ceil(self.num_views_exact - _EXACT)

    @property
    def spacing_m(self) -> float:
        """The largest spacing of neighbours that the bound allows, Δu = S / √N (N not rounded)."""
        return self.detail_px * self.disparity_px * self.z_min_m / self.focal_px

    @property
    def views_per_side(self) -> int:
        """Views along a side of the square grid that fills the area at no more than the spacing."""
        return math.ceil(self.area_side_m / self.spacing_m - _EXACT)

    @property
    def pitch_m(self) -> float:
        """Spacing of that grid: the area's side divided by the views along it."""
        return self.area_side_m / self.views_per_side


def plenoptic_grid(
    world_from_anchor: Rigid[World, Cam],
    bound: PlenopticBound,
    *,
    near_enough: Tolerance | None = None,
) -> Guide:
    """Return LLFF's guide: a square grid of views around the anchor, looking as the anchor does.

    Each view stands in the middle of its cell, row by row from the top left.

    Args:
        world_from_anchor: Where the camera was when the scan ended: the middle of the grid.
        bound: How dense the grid is to be.
        near_enough: Without it, a quarter of the pitch and 10°.
    """
    return Guide(
        grid_targets(world_from_anchor, bound.views_per_side, bound.pitch_m),
        near_enough or Tolerance(position_m=TOLERANCE_SHARE * bound.pitch_m),
    )


def grid_targets(
    world_from_anchor: Rigid[World, Cam], per_side: int, pitch_m: float, *, back_m: float = 0.0
) -> tuple[Rigid[World, Cam], ...]:
    """Return poses in a square grid across the anchor's viewing direction, `back_m` behind it."""
    steps_m = (np.arange(per_side) - (per_side - 1) / 2) * pitch_m
    return tuple(
        Rigid(
            world_from_anchor.rotation,
            world_from_anchor.apply(np.array([x_m, y_m, -back_m])),
        )
        for y_m in steps_m
        for x_m in steps_m
    )
