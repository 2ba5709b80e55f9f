"""Photographs as places show them: shrunk, encoded anew, so without metadata."""

from __future__ import annotations

import cv2
import numpy as np
import simplejpeg
from jaxtyping import UInt8

from peaking.frame import Frame

PHOTO_PX, PHOTO_QUALITY = 1280, 80
THUMBNAIL_PX, THUMBNAIL_QUALITY = 160, 65
"""Longer sides, and JPEG qualities."""
LEFT_OUT = 128
"""Grey, where a mask says that pixels do not count: masks hide people, too."""


def photo(frame: Frame) -> bytes:
    """Return a frame's picture as a JPEG, at most `PHOTO_PX` wide and high."""
    return encoded(_shown(frame))


def thumbnail(frame: Frame) -> bytes:
    """Return a small picture of a frame as a JPEG."""
    return encoded(_shown(frame), THUMBNAIL_PX, quality=THUMBNAIL_QUALITY)


def encoded(
    rgb: UInt8[np.ndarray, "h w 3"], longest_px: int = PHOTO_PX, *, quality: int = PHOTO_QUALITY
) -> bytes:
    """Return a picture as a JPEG (4:2:0), shrunk where a side is longer than that."""
    small = np.ascontiguousarray(_shrunk(rgb, longest_px))
    return simplejpeg.encode_jpeg(small, quality, colorspace="RGB", colorsubsampling="420")


def _shown(frame: Frame) -> UInt8[np.ndarray, "h w 3"]:
    if frame.mask is None:
        return frame.rgb
    return np.where(frame.mask[..., None], frame.rgb, np.uint8(LEFT_OUT))


def _shrunk(rgb: UInt8[np.ndarray, "h w 3"], longest_px: int) -> UInt8[np.ndarray, "_ _ 3"]:
    height, width = rgb.shape[:2]
    scale = longest_px / max(height, width)
    if scale >= 1:
        return rgb
    size_px = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(rgb, size_px, interpolation=cv2.INTER_AREA), np.uint8)
