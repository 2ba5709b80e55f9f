"""Single-view data: what a tracked phone gives for one picture (paper, section 3.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from peaking.geometry import Camera
from peaking.options import PAPER_PIXELS


@dataclass(frozen=True)
class Frame:
    """One picture with its camera and, where the device gave it, metric depth.

    `depth_m` covers the same field of view as `rgb` at any size of the same aspect; 0 = unknown.
    `mask`, where there is one, says which pixels count: what is False there is left out of what is
    generated, compared and trained. `points_m` are points of the world that are seen in it, where
    something tells them: a device that tracks features, or the point cloud of a recording. Some may
    be wrong.
    """

    name: str
    rgb: UInt8[np.ndarray, "h w 3"]
    camera: Camera
    depth_m: Float32[np.ndarray, "dh dw"] | None = None
    timestamp_s: float | None = None
    points_m: Float64[np.ndarray, "points 3"] | None = None
    mask: Bool[np.ndarray, "h w"] | None = None

    def __post_init__(self) -> None:
        height, width = self.rgb.shape[:2]
        if (width, height) != self.camera.pinhole.size_px:
            raise ValueError(
                f"need a picture of the camera's size {self.camera.pinhole.size_px}, "
                f"got {width}x{height}"
            )

    def resized(self, width_px: int, height_px: int) -> Frame:
        """Return the frame with picture, mask and camera at another size; depth stays as it is."""
        if (width_px, height_px) == self.camera.pinhole.size_px:
            return self
        shrinks = width_px * height_px < self.rgb.shape[0] * self.rgb.shape[1]
        how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        rgb = cv2.resize(self.rgb, (width_px, height_px), interpolation=how)
        return replace(
            self,
            rgb=rgb.astype(np.uint8),
            camera=self.camera.resized(width_px, height_px),
            mask=None if self.mask is None else mask_resized(self.mask, width_px, height_px),
        )


def mask_resized(
    mask: Bool[np.ndarray, "h w"], width_px: int, height_px: int
) -> Bool[np.ndarray, "height width"]:
    """Return a mask at another size; a pixel counts where all that it covers does."""
    left_out = (~mask).astype(np.float32)
    shrinks = width_px * height_px < mask.size
    how = cv2.INTER_AREA if shrinks else cv2.INTER_NEAREST
    return np.asarray(cv2.resize(left_out, (width_px, height_px), interpolation=how)) < 1e-3


def working_size_px(
    width_px: int, height_px: int, *, pixels: int = PAPER_PIXELS
) -> tuple[int, int]:
    """Return the size of the same aspect with about `pixels` pixels (294×639 gives itself)."""
    scale = (pixels / (width_px * height_px)) ** 0.5
    return max(1, round(width_px * scale)), max(1, round(height_px * scale))


def as_float(rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w 3"]:
    """Return 8-bit colours as float32 in 0…1."""
    return rgb.astype(np.float32) / np.float32(255)
