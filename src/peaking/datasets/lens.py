"""Lens distortion: from stored pixels to the pixels of a pinhole with the same intrinsics.

The models are OpenCV's, which nerfstudio and COLMAP share: Brown-Conrady (k1 k2 p1 p2 k3), the same
over a second polynomial (k4 k5 k6), and fisheye (Kannala & Brandt 2006, four coefficients).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

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
    """A pinhole and OpenCV's distortion coefficients, in OpenCV's order.

    Attributes:
        pinhole: Of the stored picture, and of the straight one.
        k1_k2_p1_p2_k3: Of a lens that is no fisheye.
        k4_k5_k6: The same, of the polynomial that divides.
        r8: The same, of r⁸: Metashape's and RealityCapture's k4, which OpenCV has not.
        fisheye: Of a fisheye: an angle of θ from the axis is seen at a radius of
            f θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸). None: it is no fisheye.
    """

    pinhole: Pinhole
    k1_k2_p1_p2_k3: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    k4_k5_k6: tuple[float, float, float] = (0.0, 0.0, 0.0)
    r8: float = 0.0
    fisheye: tuple[float, float, float, float] | None = None

    @property
    def has_distortion(self) -> bool:
        """Whether pixels have to move at all."""
        return self.fisheye is not None or any((*self.k1_k2_p1_p2_k3, *self.k4_k5_k6, self.r8))

    @property
    def fault(self) -> str | None:
        """Why no straight picture can be made of the lens's; None where one can."""
        return _fault(self) if self.has_distortion else None

    def resized(self, width_px: int, height_px: int) -> Lens:
        """Return the same lens with another number of pixels."""
        return replace(self, pinhole=self.pinhole.resized(width_px, height_px))

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


def same_aspect(small_px: tuple[int, int], large_px: tuple[int, int]) -> bool:
    """Return whether both cover the same field of view, to within one pixel of the first."""
    (width, height), (large_width, large_height) = small_px, large_px
    return (
        abs(width * large_height / large_width - height) <= 1
        or abs(height * large_width / large_height - width) <= 1
    )


@lru_cache(maxsize=2)
def _fault(lens: Lens) -> str | None:
    k, (_, _, p1, p2, _) = lens.pinhole, lens.k1_k2_p1_p2_k3
    columns, rows = np.meshgrid(
        np.linspace(0.0, k.width_px, GRID + 1), np.linspace(0.0, k.height_px, GRID + 1)
    )
    x, y = (columns - k.cx_px) / k.fx_px, (rows - k.cy_px) / k.fy_px
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        r2 = x * x + y * y
        radial, slope = _radial(lens, r2)
        bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        # The derivative is symmetric; its smaller eigenvalue is the stretch in the worst direction.
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
        least = (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)
        u, v = k.fx_px * bent_x + k.cx_px, k.fy_px * bent_y + k.cy_px
        inside = (u >= 0) & (u <= k.width_px) & (v >= 0) & (v <= k.height_px)
    if not (least > 0).all():  # also where it is not a number
        return "fold the picture"
    if (least < LEAST_STRETCH).mean() > MOST_SMEARED:
        return f"stretch parts of the picture {1 / least.min():.3g} times"
    if inside.mean() < LEAST_INSIDE:
        return f"leave {1 - inside.mean():.0%} of the straight picture outside of the stored one"
    return None


def _radial(
    lens: Lens, r2: Float64[np.ndarray, "*n"]
) -> tuple[Float64[np.ndarray, "*n"], Float64[np.ndarray, "*n"]]:
    """Return how many times as far from the axis a point is seen as by a pinhole, and its slope.

    Args:
        lens: The lens.
        r2: Square of the point's distance from the axis, at z = 1.

    Returns:
        g(r), and g'(r) / r, which is finite at r = 0.
    """
    if lens.fisheye is None:
        (k1, k2, _, _, k3), (k4, k5, k6), r8 = lens.k1_k2_p1_p2_k3, lens.k4_k5_k6, lens.r8
        above = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * r8)))
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        above_slope = 2 * (k1 + r2 * (2 * k2 + r2 * (3 * k3 + r2 * 4 * r8)))
        below_slope = 2 * (k4 + r2 * (2 * k5 + r2 * 3 * k6))
        positive = np.where(below > 0, below, np.nan)  # beyond its pole nothing is seen
        return above / positive, (above_slope - above / positive * below_slope) / positive
    k1, k2, k3, k4 = lens.fisheye
    r = np.sqrt(np.maximum(r2, 1e-6))
    theta = np.arctan(r)
    t2 = theta * theta
    bent = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    bent_slope = (1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))) / (1 + r * r)
    return bent / r, (bent_slope * r - bent) / r**3


# One lens usually took the whole recording; two entries hold its picture and its depth.
@lru_cache(maxsize=2)
def _stored_from_undistorted(
    lens: Lens,
) -> tuple[Float32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return where in the stored picture each pixel of the pinhole's picture lies."""
    if lens.fisheye is not None or lens.r8:
        return _stored_from_straight(lens)
    matrix = lens.pinhole.px_from_cam
    matrix[:2, 2] -= 0.5  # OpenCV has the centre of the first pixel at 0 (CONVENTIONS.md)
    x_px, y_px = cv2.initUndistortRectifyMap(
        matrix,
        np.array([*lens.k1_k2_p1_p2_k3, *lens.k4_k5_k6]),
        np.eye(3),
        matrix,
        lens.pinhole.size_px,
        cv2.CV_32FC1,
    )
    return np.asarray(x_px, dtype=np.float32), np.asarray(y_px, dtype=np.float32)


def _stored_from_straight(
    lens: Lens,
) -> tuple[Float32[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
    """Return the same of a lens that OpenCV has not, in OpenCV's pixels."""
    k, (_, _, p1, p2, _) = lens.pinhole, lens.k1_k2_p1_p2_k3
    x = (np.arange(k.width_px) + 0.5 - k.cx_px) / k.fx_px
    y = (np.arange(k.height_px) + 0.5 - k.cy_px)[:, None] / k.fy_px
    r2 = x * x + y * y
    radial, _ = _radial(lens, r2)
    bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    x_px, y_px = k.fx_px * bent_x + k.cx_px - 0.5, k.fy_px * bent_y + k.cy_px - 0.5
    return x_px.astype(np.float32), y_px.astype(np.float32)
