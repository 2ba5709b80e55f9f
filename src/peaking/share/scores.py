"""How near a rendering is to a frame's picture."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from peaking.frame import Frame
from peaking.metrics.psnr_ssim import psnr

MOST_PSNR_DB = 60.0
"""Counts as the same picture."""


def psnr_db(rgb: Float[np.ndarray, "h w 3"], frame: Frame) -> float | None:
    """Return the PSNR of a rendering over black; None where no pixel of the frame counts."""
    if frame.mask is not None and not frame.mask.any():
        return None
    shown = np.clip(rgb, 0, 1).astype(np.float64)
    return min(psnr(shown, frame.rgb / 255.0, frame.mask), MOST_PSNR_DB)
