"""A rendered image of Gaussians, and the constants that all renderers share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

C0 = 0.28209479177387814
C1 = 0.4886025119029199
"""Real spherical harmonics of degree 0 and 1."""
DILATION_PX2 = 0.3
"""Added to the variance on the picture, so that a Gaussian covers a pixel (gsplat: `eps2d`)."""
FIELD_MARGIN = 0.3
"""The projection is linearised inside the picture and this share of half the picture around it, as
in gsplat."""


@dataclass(frozen=True)
class CutOffs:
    """What is left out of the sum.

    Attributes:
        near_m: A Gaussian whose centre is nearer than this along +z is not drawn.
        alpha_min: A Gaussian adds nothing where its alpha is smaller.
        alpha_max: Larger alphas are reduced to this.
        min_transmittance: The first Gaussian that would take a pixel's transmittance below this is
            not drawn there, and neither is any behind it, as in Kerbl et al. and gsplat.
    """

    near_m: float = 0.05
    alpha_min: float = 1 / 255
    alpha_max: float = 0.999
    min_transmittance: float = 1e-4

    def __post_init__(self) -> None:
        if not (self.near_m > 0 and 0 < self.alpha_min < self.alpha_max < 1):
            raise ValueError(f"need near_m > 0, 0 < alpha_min < alpha_max < 1, got {self}")
        if self.min_transmittance < 0:
            raise ValueError(f"need min_transmittance >= 0, got {self.min_transmittance}")


@dataclass(frozen=True, eq=False)
class Rendering:
    """Gaussians rendered from a camera.

    Attributes:
        rgb: Premultiplied colour (over black).
        alpha: Opacity, 0…1.
        depth_m: Mean depth along +z, weighted by what each Gaussian adds; 0 where nothing was hit.
    """

    rgb: Float[np.ndarray, "h w 3"]
    alpha: Float[np.ndarray, "h w"]
    depth_m: Float[np.ndarray, "h w"]
