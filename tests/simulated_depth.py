"""A stand-in for a learned depth estimator: right up to scale, shift and waves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32, UInt8


@dataclass
class Simulated:
    """Answers with the disparity of depths that it was told, with another scale and shift each.

    Attributes:
        depths_m: True depth by picture (its bytes).
        waves: Smooth error, as a part of the range of disparities.
    """

    waves: float = 0.02
    depths_m: dict[bytes, Float32[np.ndarray, "h w"]] = field(
        default_factory=dict[bytes, Float32[np.ndarray, "h w"]]
    )

    name = "simulated"
    metric = False

    def tell(self, rgb: UInt8[np.ndarray, "h w 3"], depth_m: Float32[np.ndarray, "h w"]) -> None:
        """Let it know a picture."""
        self.depths_m[rgb.tobytes()] = depth_m

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
        """Return relative disparity."""
        disparity = 1.0 / self.depths_m[rgb.tobytes()]
        generator = np.random.default_rng(int(rgb[::7, ::7].sum()))
        scale, shift = generator.uniform(3, 30), generator.uniform(-1, 5)
        height, width = disparity.shape
        y, x = np.mgrid[0:height, 0:width] / max(height, width)
        turns = generator.uniform(0, 2 * np.pi, 2)
        wave = np.sin(5 * x + turns[0]) * np.cos(4 * y + turns[1])
        error = self.waves * float(np.ptp(disparity)) * wave
        return (scale * (disparity + error) + shift).astype(np.float32)
