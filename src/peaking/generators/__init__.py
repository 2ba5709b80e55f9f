"""From one picture with depth at every pixel to a multi-plane image.

`layered` needs no checkpoint and is the default; others (learned ones) follow the same protocol.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.geometry import Camera
from peaking.mpi import Mpi


@runtime_checkable
class Generator(Protocol):
    """Makes an MPI from one view."""

    @property
    def name(self) -> str:
        """What logs and reports call it."""
        ...

    def __call__(
        self,
        rgb: UInt8[np.ndarray, "h w 3"],
        depth_m: Float32[np.ndarray, "h w"],
        camera: Camera,
    ) -> Mpi:
        """Make the MPI of a picture whose depth is known at every pixel."""
        ...
