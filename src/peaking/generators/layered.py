"""The `layered` generator: RGB and metric depth to an MPI, without a network.

1. Planes go where the picture's disparities are (`planes.py`).
2. Every pixel is split between the two planes around it: the one behind is opaque, the one before
   has the opacity that puts the pixel, by interpolation, at its own disparity. Seen from the
   photographed view the pixel is unchanged.
3. Where a surface falls back by one plane, the plane behind goes on a little below the nearer
   one, so that no crack opens when the camera moves.
4. Behind depth edges the background is continued into the foreground as far as a step of
   `reach_m` can look behind it, in the background's colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.generators.planes import plane_disparities_per_m
from peaking.geometry import Camera
from peaking.mpi import Mpi

MAX_PLANES, MAX_UNDERLAP = 2**14, 255
"""What the fast path packs into 16 and 8 bits."""


@dataclass(frozen=True)
class Layered:
    """The weight-free generator and its options."""

    num_planes: int = 32
    """Planes of the MPI (D of the paper)."""
    reach_m: float = 0.20
    """Sideways step of the camera, in metres, that the background behind edges must last for."""
    jump_planes: float = 1.5
    """Jump of disparity that counts as a depth edge, in mean distances between planes."""
    underlap_px: int = 2
    """How far a plane goes on below its nearer neighbours, in pixels."""
    underlap_planes: int = 1
    """How many planes go on below a nearer one."""
    backend: Literal["numpy", "numba"] = "numba"

    name = "layered"

    def __post_init__(self) -> None:
        if not 2 <= self.num_planes <= MAX_PLANES:
            raise ValueError(f"need num_planes of 2..{MAX_PLANES}, got {self.num_planes}")
        if not 0 <= self.underlap_planes <= MAX_UNDERLAP:
            raise ValueError(
                f"need underlap_planes of 0..{MAX_UNDERLAP}, got {self.underlap_planes}"
            )
        if min(self.reach_m, self.underlap_px) < 0 or self.jump_planes <= 0:
            raise ValueError(f"need jump_planes > 0 and the rest >= 0, got {self}")

    def __call__(
        self,
        rgb: UInt8[np.ndarray, "h w 3"],
        depth_m: Float32[np.ndarray, "h w"],
        camera: Camera,
    ) -> Mpi:
        """Make the MPI of a picture whose depth is known at every pixel.

        Raises:
            ValueError: Sizes differ, or a depth is not a number > 0.
        """
        if not rgb.shape[:2] == depth_m.shape == camera.pinhole.size_px[::-1]:
            raise ValueError(
                f"need picture, depth and camera of one size, got {rgb.shape[:2]}, "
                f"{depth_m.shape} and {camera.pinhole.size_px[::-1]}"
            )
        if not (np.isfinite(depth_m).all() and depth_m.min() > 0):
            raise ValueError("need a depth > 0 at every pixel; complete the depth first")
        disparity = (1.0 / depth_m).astype(np.float32)
        disparities = plane_disparities_per_m(disparity, self.num_planes)
        jump = self.jump_planes * (disparities[-1] - disparities[0]) / (self.num_planes - 1)
        reach_px = self.reach_m * (camera.pinhole.fx_px + camera.pinhole.fy_px) / 2
        if self.backend == "numpy":
            from peaking.generators import _numpy as module
        else:
            from peaking.generators import _numba as module
        places, texels = module.layers(
            rgb,
            disparity,
            disparities,
            reach_px=reach_px,
            jump_per_m=float(jump),
            underlap_px=self.underlap_px,
            underlap_planes=self.underlap_planes,
        )
        return Mpi(camera, 1.0 / disparities, places, texels, generator=self.name)
