"""What is seen of Gaussians, and the constants that all renderers share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

C0 = 0.28209479177387814
C1 = 0.4886025119029199
"""Real spherical harmonics of degree 0 and 1."""
DILATION_PX2 = 0.3
"""Added to the variance on the picture (Kerbl et al.: a Gaussian covers at least a pixel)."""
FIELD_MARGIN = 0.3
"""The projection is linearised inside the picture and this share of half the picture around it, as
in gsplat."""


@dataclass(frozen=True)
class CutOffs:
    """What is left out of the sum.

    Attributes:
        near_m: Gaussians with a centre nearer than this along +z are not drawn.
        alpha_min: A Gaussian adds nothing where its alpha is smaller.
        alpha_max: No alpha is greater, so that something always shines through.
        opaque: A Gaussian that would let less than this shine through is left out, and so is all
            behind it, as in Kerbl et al. and gsplat.
    """

    near_m: float = 0.05
    alpha_min: float = 1 / 255
    alpha_max: float = 0.999
    opaque: float = 1e-4

    def __post_init__(self) -> None:
        if not (self.near_m > 0 and 0 < self.alpha_min < self.alpha_max < 1 and self.opaque >= 0):
            raise ValueError(f"need near_m > 0, 0 < alpha_min < alpha_max < 1, got {self}")


@dataclass(frozen=True, eq=False)
class View:
    """What is seen.

    Attributes:
        rgb: Premultiplied colour (over black).
        alpha: Opacity, 0…1.
        depth_m: Mean depth along +z of what is seen; 0 where nothing is.
    """

    rgb: Float[np.ndarray, "h w 3"]
    alpha: Float[np.ndarray, "h w"]
    depth_m: Float[np.ndarray, "h w"]
