"""Pairs of pictures, made by formula, on which the published implementations were run."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32


def metric_pairs() -> dict[str, tuple[Float32[np.ndarray, "h w 3"], Float32[np.ndarray, "h w 3"]]]:
    """Return (image, reference) by name, encoded sRGB, of 71×90 px."""
    y, x = np.mgrid[0:71, 0:90].astype(np.float64)
    reference = np.stack(
        [0.5 + 0.4 * np.sin(0.2 * x + 0.1 * y), 0.5 + 0.4 * np.cos(0.02 * x * y), x / 89], axis=-1
    )
    reference[20:45, 15:40] = (0.9, 0.2, 0.1)
    reference[30:60, 55:58] = 0.0
    ripple = 0.08 * np.sin(1.7 * x - 0.9 * y)[..., None]
    hole = reference.copy()
    hole[40:60, 50:75] = 0.0
    images = {
        "rippled": np.clip(0.9 * reference + ripple + 0.02, 0, 1),
        "shifted": np.roll(reference, 2, axis=1),
        "hole": hole,
        "grey": np.repeat(reference.mean(axis=-1, keepdims=True), 3, axis=-1),
    }
    single = reference.astype(np.float32)
    return {name: (image.astype(np.float32), single) for name, image in images.items()}
