"""The Gaussians that are trained, as 3D Gaussian splatting stores them."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from jaxtyping import Float32, Float64

from peaking.splat.columns import LOG_SCALES, MEANS, OPACITY_LOGIT, QUATS, SH

NUM_COEFFICIENTS = (1, 4, 9, 16)
"""Of spherical harmonics up to degree 0, 1, 2, 3."""

Parameters = Float32[np.ndarray, "n columns"]
"""One Gaussian per row; `columns.py` names the columns."""


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Parameters before activation (Kerbl et al. 2023).

    Attributes:
        means_m: Centres, counted from `origin_m`.
        log_scales: Natural logarithms of the standard deviations (metres) along the own axes.
        quaternions: world_from_own rotations as w, x, y, z, of any length but 0.
        opacity_logits: The opacity is 1 / (1 + exp(-logit)).
        sh: Spherical harmonics of degree 0 to 3 (1, 4, 9 or 16 coefficients), RGB; the colour is
            0.5 plus their sum for the direction from the camera, not below 0. What trains and draws
            them knows degrees 0 and 1.
        origin_m: Where in the world `means_m` are counted from; the axes are the world's. float32
            has half a metre at 5,000 km from the origin, where maps have their coordinates.
    """

    means_m: Float32[np.ndarray, "n 3"]
    log_scales: Float32[np.ndarray, "n 3"]
    quaternions: Float32[np.ndarray, "n 4"]
    opacity_logits: Float32[np.ndarray, "n"]
    sh: Float32[np.ndarray, "n k 3"]
    origin_m: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if self.sh.shape[1] not in NUM_COEFFICIENTS:
            raise ValueError(f"need 1, 4, 9 or 16 SH coefficients, got {self.sh.shape[1]}")
        for name in [column.name for column in fields(self)]:
            values = getattr(self, name)
            if name != "origin_m" and len(values) != len(self.means_m):
                raise ValueError(f"need {len(self.means_m)} {name}, got {len(values)}")
            if not np.isfinite(values).all():
                raise ValueError(f"need finite {name}, got NaN or infinity")

    def __len__(self) -> int:
        return len(self.means_m)

    @property
    def opacities(self) -> Float32[np.ndarray, "n"]:
        """Opacity of the centre, 0…1."""
        return (1 / (1 + np.exp(-self.opacity_logits.astype(np.float64)))).astype(np.float32)

    @property
    def degree(self) -> int:
        """Of their spherical harmonics."""
        return NUM_COEFFICIENTS.index(self.sh.shape[1])

    def of_degree(self, degree: int) -> Gaussians:
        """Return them without coefficients above a degree."""
        return replace(self, sh=self.sh[:, : NUM_COEFFICIENTS[degree]].copy())

    def parameters(self) -> Parameters:
        """Return all parameters as one matrix, a row for each Gaussian."""
        return np.concatenate(
            [
                self.means_m,
                self.log_scales,
                self.quaternions,
                self.opacity_logits[:, None],
                self.sh.reshape(len(self), self.sh.shape[1] * 3),
            ],
            axis=1,
        )

    @classmethod
    def from_parameters(
        cls, parameters: Parameters, *, origin_m: Float64[np.ndarray, "3"] | None = None
    ) -> Gaussians:
        """Return the Gaussians of a matrix as `parameters` makes it, counted from a point."""
        sh = parameters[:, SH]
        return cls(
            means_m=parameters[:, MEANS].copy(),
            log_scales=parameters[:, LOG_SCALES].copy(),
            quaternions=parameters[:, QUATS].copy(),
            opacity_logits=parameters[:, OPACITY_LOGIT].copy(),
            sh=sh.reshape(len(sh), sh.shape[1] // 3, 3).copy(),
            origin_m=np.zeros(3) if origin_m is None else origin_m,
        )
