"""Compare a rendered view with the live picture: which pixels are wrong, and why."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.options import DEFAULT, Marks
from peaking.rendering import Backend, Rendering

MIN_ALPHA = 0.5
"""Opacity below which nothing was rendered at a pixel."""

GAIN_STRIDE = 5
"""Every how many pixels the exposure is measured at, per axis."""

GAIN_RANGE = 2.0
"""Exposure is compensated by at most this factor, up or down."""


@dataclass(frozen=True)
class ErrorMap:
    """What is wrong with a rendered view.

    Attributes:
        error: L1 over RGB of straight colours in 0…1, so 0…3.
        peaked: What a view from here mends. With `marks="paper"` where the error is above the
            threshold, as in the paper; with `"apart"` what is `wrong` or `unseen`.
        unseen: No view has seen what is here.
        unfixable: It is wrong, and no view will help.
    """

    error: Float32[np.ndarray, "h w"]
    peaked: Bool[np.ndarray, "h w"]
    unseen: Bool[np.ndarray, "h w"]
    unfixable: Bool[np.ndarray, "h w"]

    @property
    def wrong(self) -> Bool[np.ndarray, "h w"]:
        """Seen, shown wrongly, and mended by a view from here."""
        return self.peaked & ~self.unseen & ~self.unfixable

    @property
    def peaked_share(self) -> float:
        """Peaked pixels divided by all pixels, 0…1."""
        return _share(self.peaked)

    @property
    def wrong_share(self) -> float:
        """Wrong pixels divided by all pixels, 0…1."""
        return _share(self.wrong)

    @property
    def unseen_share(self) -> float:
        """Pixels of what no view has seen divided by all pixels, 0…1."""
        return _share(self.unseen)

    @property
    def unfixable_share(self) -> float:
        """Pixels that no view will help divided by all pixels, 0…1."""
        return _share(self.unfixable)

    @property
    def mean_error(self) -> float:
        """Mean of the error over all pixels, 0…3."""
        return float(self.error.mean())


def compare(
    rendering: Rendering,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    unseen: Bool[np.ndarray, "h w"] | None = None,
    threshold: float = DEFAULT.error_threshold,
    shift_px: int = DEFAULT.shift_px,
    compensate_exposure: bool = DEFAULT.compensate_exposure,
    marks: Marks = DEFAULT.marks,
    backend: Backend = "numba",
) -> ErrorMap:
    """Compare a rendering with the live picture of the same camera.

    The error of a pixel is `L(c_mpi, c_vid) = Σ_rgb |c_mpi - c_vid|` (paper, section 3.2) with the
    straight colour of the rendering, and black where nothing was rendered. With `shift_px` = 1 it
    is the least of the errors against the 3×3 rendered pixels around: a misalignment of one pixel,
    which is what phone tracking leaves, is then not an error, while wrong and missing content is.

    Args:
        rendering: What the captured views show.
        live: What the camera sees.
        unseen: What no view has seen (`peaking.memory`); else where the rendering is empty.
        threshold: Error above which a pixel is peaked, t of the paper; 0…3.
        shift_px: Pixels by which the rendering may be displaced without counting as wrong; 0 or 1.
        compensate_exposure: Compare after a gain per channel that makes the medians equal.
        marks: What counts as peaked.
        backend: Which implementation.

    Raises:
        ValueError: The sizes differ, or a number is out of its range.
    """
    if not 0 < threshold < 3:
        raise ValueError(f"need 0 < threshold < 3, got {threshold}")
    if shift_px not in (0, 1):
        raise ValueError(f"need shift_px of 0 or 1, got {shift_px}")
    if live.shape[:2] != rendering.depth_m.shape:
        raise ValueError(
            f"need a live picture of the rendering's size {rendering.depth_m.shape}, "
            f"got {live.shape[:2]}"
        )
    gain = exposure_gain(rendering, live) if compensate_exposure else np.ones(3, np.float32)
    if backend == "numpy":
        from peaking.error_map import _numpy as module
    else:
        from peaking.error_map import _numba as module
    error, over, empty = module.compare(
        rendering.rgba, live, gain, threshold=threshold, shift_px=shift_px, min_alpha=MIN_ALPHA
    )
    never = empty if unseen is None else unseen
    # Where something was seen that no view can show from here, nothing was compared.
    peaked = over if marks == "paper" else over | never | empty
    return ErrorMap(error, peaked, never, np.zeros_like(never))


def _share(mask: Bool[np.ndarray, "h w"]) -> float:
    return float(np.count_nonzero(mask) / mask.size)


def exposure_gain(
    rendering: Rendering, live: UInt8[np.ndarray, "h w 3"]
) -> Float32[np.ndarray, "3"]:
    """Return the factor per channel by which the live picture is brighter than the rendering.

    The median over pixels that are well covered and neither dark nor clipped in either picture;
    1 where there are too few. A phone's automatic exposure and white balance change like this.
    """
    rgba = rendering.rgba[::GAIN_STRIDE, ::GAIN_STRIDE].reshape(-1, 4)
    rgb = live[::GAIN_STRIDE, ::GAIN_STRIDE].reshape(-1, 3).astype(np.float32) / 255.0
    gain = np.ones(3, np.float32)
    for c in range(3):
        ours, theirs = rgba[:, c], rgb[:, c]
        good = (rgba[:, 3] > 0.95) & (ours > 0.08) & (theirs > 0.08)
        good &= (ours < 0.97) & (theirs < 0.97)
        if np.count_nonzero(good) >= 50:
            gain[c] = np.median(theirs[good] / ours[good])
    return np.clip(gain, 1.0 / GAIN_RANGE, GAIN_RANGE)
