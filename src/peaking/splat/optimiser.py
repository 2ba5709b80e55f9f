"""What trains Gaussians: an optimiser renders, compares with a photograph, and moves them.

There is one for each backend; the schedule (`training.py`) and refinement (`refinement.py`) are the
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
MAX_GRADIENT = 1e10
"""A larger gradient, or one that is not a number, counts as 0."""


@dataclass(frozen=True, eq=False)
class AdamState:
    """Parameters, and Adam's running means of their gradients and of the squared gradients."""

    parameters: Parameters
    first_moment: Parameters
    second_moment: Parameters

    @classmethod
    def initial(cls, parameters: Parameters) -> AdamState:
        """Return parameters before the first step."""
        return cls(parameters, np.zeros_like(parameters), np.zeros_like(parameters))


@dataclass(frozen=True, eq=False)
class Progress:
    """What an optimiser remembers beside `AdamState`.

    Attributes:
        steps: Steps that were taken, of all.
        grad2d: Sum of the lengths of the gradients by the projected centres, since refinement.
        count: How often each Gaussian was seen since then.
    """

    steps: int
    grad2d: Float32[np.ndarray, "n"]
    count: Float32[np.ndarray, "n"]


@runtime_checkable
class Optimiser(Protocol):
    """Takes one step per photograph."""

    def step(self, frame: Frame, learning_rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, move all parameters against the loss's gradient, and return the loss."""
        ...

    def state(self) -> AdamState:
        """Return the parameters and moments as they are now."""
        ...

    def mean_grad2d(self) -> Float32[np.ndarray, "n"]:
        """Return the mean length of the gradient by the projected centre, in half pictures."""
        ...

    def reset(self, state: AdamState) -> None:
        """Go on with other Gaussians; the mean of `mean_grad2d` starts again."""
        ...

    def progress(self) -> Progress:
        """Return what else is needed to go on later."""
        ...

    def go_on(self, state: AdamState, progress: Progress) -> None:
        """Go on from where another optimiser stopped."""
        ...
