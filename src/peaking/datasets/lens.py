"""Lens distortion: from stored pixels to the pixels of a pinhole with the same intrinsics.

The model is OpenCV's (Brown-Conrady, k1 k2 p1 p2 k3), which nerfstudio and COLMAP share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.geometry import Pinhole

GRID = 64
"""Places along each side at which a lens is looked at."""
LEAST_STRETCH = 0.2
"""Pixels of the stored picture in one of the straight picture, in its worst direction. Below it the
straight picture is smeared; lenses of wide cameras keep above 0.4."""
MOST_SMEARED = 0.02
LEAST_INSIDE = 0.5
"""Shares of the straight picture."""


@dataclass(frozen=True)
class Lens:
    """A pinhole and OpenCV's five distortion coefficients, in OpenCV's order."""

    pinhole: Pinhole
    k1_k2_p1_p2_k3: tuple[float, float, float, float, float]

    @property
    def has_distortion(self) -> bool:
        """Whether pixels have to move at all."""
        return any(self.k1_k2_p1_p2_k3)

    @property
    def fault(self) -> str | None:
        """Why no straight picture can be made of the lens's; None where one can."""
        return _fault(self) if self.has_distortion else None

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

    def undistorted_mask(self, mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """Return which pixels of the pinhole's picture count; nearest pixel, as at the edge."""
        if not self.has_distortion:
            return mask
        x_px, y_px = _stored_from_undistorted(self)
        counts = cv2.remap(
            mask.astype(np.uint8), x_px, y_px, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(counts).astype(np.bool_)

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


@lru_cache(maxsize=2)
def _fault(lens: Lens) -> str | None:
    k, (k1, k2, p1, p2, k3) = lens.pinhole, lens.k1_k2_p1_p2_k3
    columns, rows = np.meshgrid(
        np.linspace(0.0, k.width_px, GRID + 1), np.linspace(0.0, k.height_px, GRID + 1)
    )
    x, y = (columns - k.cx_px) / k.fx_px, (rows - k.cy_px) / k.fy_px
    with np.errstate(over="ignore", invalid="ignore"):
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        # The derivative is symmetric; its smaller eigenvalue is the stretch in the worst direction.
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
        least = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)
        u, v = k.fx_px * bent_x + k.cx_px, k.fy_px * bent_y + k.cy_px
        inside = (u >= 0) & (u <= k.width_px) & (v >= 0) & (v <= k.height_px)
    if not (least > 0).all():
        return "fold the picture"
    if (least < LEAST_STRETCH).mean() > MOST_SMEARED:
        return f"stretch parts of the picture {1 / least.min():.3g} times"
    if inside.mean() < LEAST_INSIDE:
        return f"leave {1 - inside.mean():.0%} of the straight picture outside of the stored one"
    return None


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
