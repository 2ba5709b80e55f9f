"""The paper's three pictures: the MPI over black, the peaks on the video, the peaks on the MPI.

What is marked apart is told apart by more than its colour, and never covers what one frames:

- *wrong*: red, see-through, with a thin light contour, so that it reads on red things;
- *never seen*: the live picture, grey and cool, with a fine hatch and a thin light border;
- *no view will help*: amber dots with a dark rim, so that they read on what is over-exposed, and
  a border.

The client draws the same (`web/src/render/display.frag.glsl`), smooth on a screen with more pixels.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.error_map import ErrorMap
from peaking.options import DEFAULT, Marks
from peaking.rendering import Rendering

Overlay = Literal["mpi", "video", "peaks"]
"""`mpi`: the MPI over black; `video`: peaks on the video; `peaks`: peaks on the MPI (default)."""

ERROR_RGB = (255, 0, 0)
"""c_err of the paper."""

WRONG_OPACITY = 2 / 3
"""Of the red where classes are marked apart."""

CONTOUR_RGB = (255, 225, 215)
"""Along the border of what is wrong."""

UNSEEN_RGB = (150, 165, 190)
"""The cool grey of what was never seen: its hatch and border."""

UNFIXABLE_RGB = (255, 176, 0)
"""Amber."""

HATCH_PX = 6
"""From one line of the hatch to the next, along a row."""

UNFIXABLE_RIM_RGB, UNFIXABLE_RIM_OPACITY = (31, 20, 0), 0.6
"""Around each dot."""

DOT_EVERY_PX, DOT_PX, DOT_RIM_PX = 8, 1.6, 0.9
"""From one dot to the next, its radius, and how much farther its rim reaches."""


def mpi_over_black(rendering: Rendering) -> UInt8[np.ndarray, "h w 3"]:
    """Show what the reconstruction knows: `c' = α c_mpi` (paper, section 3.2, over black)."""
    return np.clip(rendering.rgba[..., :3] * 255.0 + 0.5, 0, 255).astype(np.uint8)


def peaks_on_video(
    errors: ErrorMap, live: UInt8[np.ndarray, "h w 3"], *, marks: Marks = DEFAULT.marks
) -> UInt8[np.ndarray, "h w 3"]:
    """Show the live picture, marked where the rendering is wrong."""
    return _marked(live, errors, live, marks)


def peaks_on_mpi(
    errors: ErrorMap,
    rendering: Rendering,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    marks: Marks = DEFAULT.marks,
) -> UInt8[np.ndarray, "h w 3"]:
    """Show the digital double over black, marked where it is wrong (the default)."""
    return _marked(mpi_over_black(rendering), errors, live, marks)


def draw(
    overlay: Overlay,
    *,
    rendering: Rendering,
    errors: ErrorMap,
    live: UInt8[np.ndarray, "h w 3"],
    marks: Marks = DEFAULT.marks,
) -> UInt8[np.ndarray, "h w 3"]:
    """Draw one of the three pictures."""
    if overlay == "mpi":
        return mpi_over_black(rendering)
    if overlay == "video":
        return peaks_on_video(errors, live, marks=marks)
    return peaks_on_mpi(errors, rendering, live, marks=marks)


def _marked(
    picture: UInt8[np.ndarray, "h w 3"],
    errors: ErrorMap,
    live: UInt8[np.ndarray, "h w 3"],
    marks: Marks,
) -> UInt8[np.ndarray, "h w 3"]:
    if marks == "paper":
        painted = picture.copy()
        painted[errors.peaked] = ERROR_RGB
        return painted
    rows, cols = np.indices(errors.wrong.shape)
    shown = picture.astype(np.float32)
    grey = live.astype(np.float32).mean(axis=-1, keepdims=True)
    cool = 0.55 * grey + 0.15 * np.array(UNSEEN_RGB, np.float32)
    shown = np.where(errors.unseen[..., None], cool, shown)
    hatch = errors.unseen & ((rows + cols) % HATCH_PX == 0)
    _paint(shown, hatch, UNSEEN_RGB, 0.5)
    _paint(shown, _border(errors.unseen), UNSEEN_RGB, 0.9)
    _paint(shown, errors.wrong, ERROR_RGB, WRONG_OPACITY)
    _paint(shown, _border(~errors.wrong), CONTOUR_RGB, 0.6)
    _paint_dots(shown, errors.unfixable)
    _paint(shown, _border(errors.unfixable), UNFIXABLE_RGB, 0.9)
    return np.clip(shown + 0.5, 0, 255).astype(np.uint8)


def _paint(
    shown: Float32[np.ndarray, "h w 3"],
    mask: Bool[np.ndarray, "h w"],
    rgb: tuple[int, int, int],
    opacity: float | Float32[np.ndarray, "masked 1"],
) -> None:
    shown[mask] += opacity * (np.array(rgb, np.float32) - shown[mask])


def _paint_dots(shown: Float32[np.ndarray, "h w 3"], mask: Bool[np.ndarray, "h w"]) -> None:
    rows, cols = np.nonzero(mask)
    half = DOT_EVERY_PX / 2
    from_middle_px = np.hypot(
        rows % DOT_EVERY_PX + 0.5 - half, cols % DOT_EVERY_PX + 0.5 - half
    ).astype(np.float32)
    for rgb, opacity, radius_px in (
        (UNFIXABLE_RIM_RGB, UNFIXABLE_RIM_OPACITY, DOT_PX + DOT_RIM_PX),
        (UNFIXABLE_RGB, 1.0, DOT_PX),
    ):
        covered = np.clip(radius_px - from_middle_px + np.float32(0.5), 0, 1)[:, None]
        _paint(shown, mask, rgb, np.float32(opacity) * covered)


def _border(mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return the pixels of a mask that have a neighbour outside it; the picture's edge is none."""
    inside = np.pad(mask, 1, mode="edge")
    kept = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    return mask & ~kept
