"""The paper's three pictures: the MPI over black, the peaks on the video, the peaks on the MPI."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import UInt8

from peaking.error_map import ErrorMap
from peaking.rendering import Rendering

Overlay = Literal["mpi", "video", "peaks"]
"""`mpi`: the MPI over black; `video`: peaks on the video; `peaks`: peaks on the MPI (default)."""

ERROR_RGB = (255, 0, 0)
"""c_err of the paper."""


def mpi_over_black(rendering: Rendering) -> UInt8[np.ndarray, "h w 3"]:
    """Show what the reconstruction knows: `c' = α c_mpi` (paper, section 3.2, over black)."""
    return np.clip(rendering.rgba[..., :3] * 255.0 + 0.5, 0, 255).astype(np.uint8)


def peaks_on_video(
    errors: ErrorMap, live: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Show the live picture, red where the rendering is wrong."""
    picture = live.copy()
    picture[errors.peaked] = ERROR_RGB
    return picture


def peaks_on_mpi(errors: ErrorMap, rendering: Rendering) -> UInt8[np.ndarray, "h w 3"]:
    """Show the digital double over black, red where it is wrong (the default)."""
    picture = mpi_over_black(rendering)
    picture[errors.peaked] = ERROR_RGB
    return picture


def draw(
    overlay: Overlay,
    *,
    rendering: Rendering,
    errors: ErrorMap,
    live: UInt8[np.ndarray, "h w 3"],
) -> UInt8[np.ndarray, "h w 3"]:
    """Draw one of the three pictures."""
    if overlay == "mpi":
        return mpi_over_black(rendering)
    if overlay == "video":
        return peaks_on_video(errors, live)
    return peaks_on_mpi(errors, rendering)
