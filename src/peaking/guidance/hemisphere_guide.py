"""Views on a part of a sphere around a point, all looking at it (Davis et al. 2012).

Neighbours are a fixed angle apart. The plenoptic spacing would ask for hundreds of views here, so
the step is an option and no bound.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Cam, Rigid, World
from peaking.guidance.guide import Guide, Tolerance

TOLERANCE_SHARE = 0.25
"""Of the distance between neighbours."""


def hemisphere(
    world_from_anchor: Rigid[World, Cam],
    radius_m: float,
    *,
    step_rad: float = math.radians(20),
    extent_rad: float = math.radians(60),
    near_enough: Tolerance | None = None,
) -> Guide:
    """Return the guide whose targets lie on a cap of a sphere, ring by ring from its middle.

    Args:
        world_from_anchor: Where the camera was when the scan ended: the middle of the cap.
        radius_m: From the anchor to the point that it looks at, the centre of the sphere.
        step_rad: Angle between neighbours, seen from the point.
        extent_rad: From the middle of the cap to its edge; 90° is a hemisphere.
        near_enough: Without it, a quarter of the distance between neighbours and 10°.

    Raises:
        ValueError: The radius is not > 0, or an angle is not within 90°.
    """
    if not (math.isfinite(radius_m) and radius_m > 0):
        raise ValueError(f"need a finite radius_m > 0, got {radius_m}")
    if not 0 < step_rad <= math.pi / 2:
        raise ValueError(f"need 0 < step_rad <= π/2, got {step_rad}")
    if not 0 <= extent_rad <= math.pi / 2:
        raise ValueError(f"need 0 <= extent_rad <= π/2, got {extent_rad}")
    point_m = world_from_anchor.apply(np.array([0.0, 0.0, radius_m]))
    targets: list[Rigid[World, Cam]] = []
    for ring in range(math.floor(extent_rad / step_rad + 1e-9) + 1):
        polar_rad = ring * step_rad
        count = max(1, math.ceil(2 * math.pi * math.sin(polar_rad) / step_rad - 1e-9))
        for place in range(count):
            tilt = _tilt(polar_rad, 2 * math.pi * place / count)
            rotation = world_from_anchor.rotation @ tilt
            targets.append(Rigid(rotation, point_m - radius_m * rotation[:, 2]))
    tolerance = near_enough or Tolerance(position_m=TOLERANCE_SHARE * radius_m * step_rad)
    return Guide(tuple(targets), tolerance)


def _tilt(polar_rad: float, azimuth_rad: float) -> Float64[np.ndarray, "3 3"]:
    """Return the shortest rotation that moves a camera round the point: to its right at azimuth 0.

    Its axis is across the viewing direction, so nothing rolls more than it must.
    """
    # A camera that has gone to (cos a, sin a) in its picture's plane looks back by the polar angle.
    x, y = math.sin(azimuth_rad), -math.cos(azimuth_rad)
    c, s = math.cos(polar_rad), math.sin(polar_rad)
    d = 1.0 - c
    return np.array(
        [
            [c + d * x * x, d * x * y, s * y],
            [d * x * y, c + d * y * y, -s * x],
            [-s * y, s * x, c],
        ]
    )
