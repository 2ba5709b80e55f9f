"""Depth from a picture alone: what an estimator is."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8


@runtime_checkable
class DepthEstimator(Protocol):
    """Guesses disparity, large where near, from one picture."""

    @property
    def name(self) -> str:
        """What logs and reports call it."""
        ...

    @property
    def metric(self) -> bool:
        """Whether it guesses 1/m; else scale and shift are unknown, in every picture others."""
        ...

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
        """Return disparity at every pixel."""
        ...
