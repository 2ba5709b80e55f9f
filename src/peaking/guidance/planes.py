"""Views on several parallel planes, so that the user may also step forward and back.

The paper names 2D planes as one of the usual annotations and gives no spacing for them. Within a
plane ours is the plenoptic one. Between planes, a step of Δz moves a pixel at the edge of the
picture, W/2 from its middle, by (W/2) Δz / z_min; that it stays within D pixels, as sideways, gives
Δz = 2 D z_min / W = Δu / tan(θ/2).
"""

from __future__ import annotations

import math

from peaking.geometry import Cam, Rigid, World
from peaking.guidance.guide import Guide, Tolerance
from peaking.guidance.plenoptic import PlenopticBound, grid_targets

TOLERANCE_SHARE = 0.5
"""Of the pitch: a plane is drawn as tiles, and a view within a tile takes it."""


def plane_stack(
    world_from_anchor: Rigid[World, Cam],
    bound: PlenopticBound,
    *,
    near_enough: Tolerance | None = None,
) -> Guide:
    """Return the guide that fills a cube of the area's side with planes of views.

    The first plane is the anchor's, the others are behind it: nothing is nearer to them than z_min.

    Args:
        world_from_anchor: Where the camera was when the scan ended: the middle of the first plane.
        bound: How dense the planes are to be.
        near_enough: Without it, half of the pitch and 10°.
    """
    layers = num_layers(bound)
    layer_pitch_m = bound.area_side_m / layers
    targets = tuple(
        target
        for layer in range(layers)
        for target in grid_targets(
            world_from_anchor, bound.views_per_side, bound.pitch_m, back_m=layer * layer_pitch_m
        )
    )
    return Guide(targets, near_enough or Tolerance(position_m=TOLERANCE_SHARE * bound.pitch_m))


def num_layers(bound: PlenopticBound) -> int:
    """Return how many planes a depth of the area's side needs."""
    gap_m = bound.spacing_m / math.tan(bound.fov_rad / 2)
    return math.ceil(bound.area_side_m / gap_m - 1e-9)
