"""Where Gaussians are while they are trained: an optimiser renders, compares, and moves them.

There is one for each backend; the schedule (`train.py`) and densification (`densify.py`) are the
same for all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32

from peaking.frame import Frame
from peaking.splat.gaussians import Parameters

ADAM_BETAS = (0.9, 0.999)
ADAM_EPSILON = 1e-15
"""Kingma and Ba 2015, with the epsilon of Kerbl et al."""
GRADIENT_LIMIT = 1e10
"""A larger gradient, or none at all, counts as 0."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Parameters, and Adam's running means of their gradients and of the squares of these."""

    parameters: Parameters
    first: Parameters
    second: Parameters

    @classmethod
    def fresh(cls, parameters: Parameters) -> Moments:
        """Return parameters that were not moved yet."""
        return cls(parameters, np.zeros_like(parameters), np.zeros_like(parameters))


@runtime_checkable
class Optimiser(Protocol):
    """Looks at one picture after another."""

    def step(self, frame: Frame, rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, move all parameters against the loss's gradient, and return the loss."""
        ...

    def moments(self) -> Moments:
        """Return the parameters as they are now."""
        ...

    def pulls(self) -> Float32[np.ndarray, "n"]:
        """Return the mean gradient by the position on the picture (in half pictures)."""
        ...

    def restart(self, moments: Moments) -> None:
        """Go on with other Gaussians; pulls are forgotten."""
        ...
