"""The scan before the first view finds the least depth, z_min, while the user looks around.

One wrong pixel that is too near would ask for too many views, so a depth counts only when enough
pixels of enough frames are as near.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

NEAR_SHARE = 0.01
"""Share of a frame's known depths that may be nearer than its near depth: noise, flying pixels."""

CONFIRMATIONS = 3
"""Frames that must have seen something as near as z_min."""

MIN_KNOWN_SHARE = 0.05
"""A frame with a smaller share of known depths says nothing."""


class DepthScan:
    """Finds z_min over the depth maps of a scan, one at a time.

    Each map gives its near depth, the `NEAR_SHARE` quantile of what is known in it. z_min is the
    `CONFIRMATIONS`-th smallest of them: that many maps less one may be entirely wrong. After the
    first few maps z_min can only fall, and only what is nearest is kept.
    """

    def __init__(self, *, confirmations: int = CONFIRMATIONS) -> None:
        """Begin a scan."""
        if confirmations < 1:
            raise ValueError(f"need confirmations >= 1, got {confirmations}")
        self.confirmations = confirmations
        self.frames = 0
        """Maps that said something."""
        self._nearest_m: list[float] = []

    def add(self, depth_m: Float[np.ndarray, "h w"]) -> None:
        """Look at a depth map in metres; 0 is unknown, and so is what is not finite."""
        near_m = near_depth_m(depth_m)
        if near_m is None:
            return
        self.frames += 1
        self._nearest_m = sorted([*self._nearest_m, near_m])[: self.confirmations]

    @property
    def z_min_m(self) -> float | None:
        """The least depth so far; None until enough maps have confirmed one."""
        return self._nearest_m[-1] if len(self._nearest_m) == self.confirmations else None


def near_depth_m(depth_m: Float[np.ndarray, "h w"]) -> float | None:
    """Return the near depth of a map: of its n known ones that of rank floor(n · `NEAR_SHARE`).

    Rank 0 is the smallest. None when fewer than `MIN_KNOWN_SHARE` of the pixels are known.
    """
    known_m = depth_m[np.isfinite(depth_m) & (depth_m > 0)]
    if known_m.size == 0 or known_m.size < MIN_KNOWN_SHARE * depth_m.size:
        return None
    rank = math.floor(known_m.size * NEAR_SHARE)
    return float(np.partition(known_m, rank)[rank])


def middle_depth_m(depth_m: Float[np.ndarray, "h w"]) -> float | None:
    """Return how far what the camera looks at is: the median of the middle ninth of a map.

    Of its n known depths that of rank floor(n / 2), rank 0 the smallest; None when none is known.
    """
    height, width = depth_m.shape
    middle_m = depth_m[height // 3 : height - height // 3, width // 3 : width - width // 3]
    known_m = middle_m[np.isfinite(middle_m) & (middle_m > 0)]
    if known_m.size == 0:
        return None
    return float(np.partition(known_m, known_m.size // 2)[known_m.size // 2])
