"""A wind-up duck: the thing that stands somewhere else in every picture of the desk."""

from typing import Any

import numpy as np

from peaking.photographers.drawn import surfaces
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import ball, satin, shape

DUCK = ("duck_body", "duck_bill")


def duck(rng: np.random.Generator) -> dict[str, Any]:
    """A duck of 11 cm at the origin, looking along -y."""
    body, bill = MeshParts(smooth=True), MeshParts(smooth=True)
    trunk = [(r, 0.78 * h) for r, h in ball(0.042)]
    body.turned(trunk, Pose((0.0, 0.0, 0.036)), longer=1.45)
    body.turned(ball(0.027), Pose((0.0, -0.035, 0.085)))
    body.turned([(r, 0.5 * h) for r, h in ball(0.022)], Pose((0.0, 0.056, 0.052), pitch_deg=25))
    bill.turned([(r, 0.32 * h) for r, h in ball(0.016)], Pose((0.0, -0.064, 0.081)), longer=1.3)
    for side in (-1, 1):
        bill.turned([(r, 0.3 * h) for r, h in ball(0.02)], Pose((0.024 * side, -0.01, 0.005)))
    bill.tube(np.array([(x, 0.0, 0.05) for x in (0.035, 0.06)]), 0.004)
    bill.box((0.004, 0.03, 0.022), Pose((0.062, 0.0, 0.05)))
    yellow = [(0.9, 0.74, 0.16), (0.86, 0.66, 0.12), (0.9, 0.74, 0.16), (0.26, 0.3, 0.55)]
    return {
        "duck_body": shape(
            "duck_body", body, satin(surfaces.glazed(rng, (240, 640), yellow, rings=8), 0.25)
        ),
        "duck_bill": shape(
            "duck_bill", bill, satin(surfaces.plastic_grain(rng, (0.82, 0.36, 0.12)), 0.3)
        ),
    }
