"""Lens distortion: from stored pixels to the pixels of a pinhole with the same intrinsics.

The model is OpenCV's (Brown-Conrady, k1 k2 p1 p2 k3), which nerfstudio and COLMAP share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from peaking.geometry import Pinhole


@dataclass(frozen=True)
class Lens:
    """A pinhole and OpenCV's five distortion coefficients, in OpenCV's order."""

    pinhole: Pinhole
    k1_k2_p1_p2_k3: tuple[float, float, float, float, float]

    @property
    def has_distortion(self) -> bool:
        """Whether pixels have to move at all."""
        return any(self.k1_k2_p1_p2_k3)

    def resized(self, width_px: int, height_px: int) -> Lens:
        """Return the same lens with another number of pixels."""
        return Lens(self.pinhole.resized(width_px, height_px), self.k1_k2_p1_p2_k3)

    def undistorted(self, rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
        """Return the picture that a pinhole would have taken.

        Beyond the edge of the stored picture its last pixels are repeated: black would be taken
        for a dark part of the scene.
        """
        if not self.has_distortion:
            return rgb
        x_px, y_px = _stored_from_undistorted(self)
        undistorted = cv2.remap(rgb, x_px, y_px, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(undistorted, dtype=np.uint8)

    def undistorted_depth(self, depth_m: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
        """Return the depth map of the pinhole; nearest pixel, 0 beyond the edge."""
        if not self.has_distortion:
            return depth_m
        height, width = depth_m.shape
        x_px, y_px = _stored_from_undistorted(self.resized(width, height))
        undistorted = cv2.remap(
            depth_m, x_px, y_px, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        return np.asarray(undistorted, dtype=np.float32)


# One lens usually took the whole recording; two entries hold its picture and its depth.
@lru_cache(maxsize=2)
def _stored_from_undistorted(
    lens: Lens,
) -> tuple[Float32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return where in the stored picture each pixel of the pinhole's picture lies."""
    matrix = lens.pinhole.px_from_cam
    matrix[:2, 2] -= 0.5  # OpenCV has the centre of the first pixel at 0 (CONVENTIONS.md)
    x_px, y_px = cv2.initUndistortRectifyMap(
        matrix,
        np.array(lens.k1_k2_p1_p2_k3),
        np.eye(3),
        matrix,
        lens.pinhole.size_px,
        cv2.CV_32FC1,
    )
    return np.asarray(x_px, dtype=np.float32), np.asarray(y_px, dtype=np.float32)
