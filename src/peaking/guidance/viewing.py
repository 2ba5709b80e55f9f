"""Which errors a person can see: the bound extended by screen, eye and motion.

The paper names what plenoptic sampling leaves out: the pixels of the screen, the distance of the
eyes, and the motion of the user. Each has a finest detail that it lets through; measured on the
screen, the coarsest of them is the finest detail that counts, and it takes the place of the one
pixel of the bound (`PlenopticBound.detail_px`). docs/plenoptic.md derives it and says which parts
the literature supports.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from peaking.guidance.plenoptic import PlenopticBound

Factor = Literal["mpi", "display", "eye", "motion"]

INCH_M = 0.0254
ARCMIN_RAD = math.radians(1 / 60)

PURSUIT_GAIN = 0.82
DRIFT_DEG_PER_S = 0.15
MAX_PURSUIT_DEG_PER_S = 80.0
"""How eyes follow what moves: Daly (1998). docs/plenoptic.md says which of these were checked."""

CORNER_DEG_PER_S = 2.0
"""Slip on the retina at which the detail seen best is twice as coarse as in an image at rest: Kelly
(1979), equation 8, 45.9 / (2π (v + 2)) cycles per degree."""


@dataclass(frozen=True, kw_only=True)
class Viewing:
    """How the result is looked at; the defaults are the paper's phone, held still."""

    display_ppi: float = 460.0
    """Pixels of the screen per inch."""
    display_width_px: float = 1179.0
    """Pixels of the screen that the picture's width covers."""
    eye_m: float = 0.35
    """From the screen to the eyes."""
    acuity_arcmin: float = 1.0
    """The finest detail that the eye resolves at rest; 1 is 20/20."""
    speed_m_per_s: float = 0.0
    """How fast the camera moves sideways while one looks."""
    frames_per_s: float = 30.0
    """Pictures per second; each is held until the next."""

    def __post_init__(self) -> None:
        for name in ("display_ppi", "display_width_px", "eye_m", "acuity_arcmin", "frames_per_s"):
            number = getattr(self, name)
            if not (math.isfinite(number) and number > 0):
                raise ValueError(f"need a finite {name} > 0, got {number}")
        if not (math.isfinite(self.speed_m_per_s) and self.speed_m_per_s >= 0):
            raise ValueError(f"need a finite speed_m_per_s >= 0, got {self.speed_m_per_s}")


@dataclass(frozen=True)
class Limit:
    """The finest detail that one factor lets through."""

    factor: Factor
    on_display_m: float
    """Its size on the screen."""
    arcmin: float
    """Its size for the eye."""
    detail_px: float
    """Its size in pixels of an MPI."""


def limits(bound: PlenopticBound, viewing: Viewing) -> tuple[Limit, ...]:
    """Return what each factor lets through, the coarsest first; that one limits.

    `motion` is the way that something at the least depth goes on the screen while one picture is
    held: eyes that follow it smear it by as much. It is left out when the camera does not move.
    """
    display_m = INCH_M / viewing.display_ppi
    mpi_m = display_m * viewing.display_width_px / bound.width_px
    flow_m_per_s = viewing.speed_m_per_s * bound.focal_px / bound.z_min_m * mpi_m
    followed, slip_deg_per_s = _follow(math.degrees(math.atan(flow_m_per_s / viewing.eye_m)))
    coarser = (slip_deg_per_s + CORNER_DEG_PER_S) / (DRIFT_DEG_PER_S + CORNER_DEG_PER_S)
    eye_m = viewing.eye_m * math.tan(viewing.acuity_arcmin * coarser * ARCMIN_RAD)
    on_display_m: dict[Factor, float] = {"mpi": mpi_m, "display": display_m, "eye": eye_m}
    if viewing.speed_m_per_s > 0:
        on_display_m["motion"] = followed * flow_m_per_s / viewing.frames_per_s
    found = [
        Limit(factor, size_m, math.atan(size_m / viewing.eye_m) / ARCMIN_RAD, size_m / mpi_m)
        for factor, size_m in on_display_m.items()
    ]
    return tuple(sorted(found, key=lambda limit: -limit.on_display_m))


def extended_bound(bound: PlenopticBound, viewing: Viewing) -> PlenopticBound:
    """Return the bound for the finest detail that all factors let through."""
    return replace(bound, detail_px=limits(bound, viewing)[0].detail_px)


def _follow(target_deg_per_s: float) -> tuple[float, float]:
    """Return the share of a motion that the eyes follow, and the slip that is left, in °/s."""
    eye_deg_per_s = min(PURSUIT_GAIN * target_deg_per_s + DRIFT_DEG_PER_S, MAX_PURSUIT_DEG_PER_S)
    eye_deg_per_s = min(eye_deg_per_s, target_deg_per_s)
    slip_deg_per_s = max(target_deg_per_s - eye_deg_per_s, DRIFT_DEG_PER_S)
    return (eye_deg_per_s / target_deg_per_s if target_deg_per_s > 0 else 0.0), slip_deg_per_s
