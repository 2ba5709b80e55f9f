"""Compare a rendered view with the live picture: which pixels are wrong, and why."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from peaking.error_map.exposure import SAME, Exposure, measure_exposure
from peaking.options import DEFAULT, Marks
from peaking.rendering import Backend, Rendering

MIN_ALPHA = 0.5
"""Opacity below which nothing was rendered at a pixel."""

BLOWN_OUT, BRIGHT = 250, 0.85
"""In all channels of a picture, of 255: brighter than the camera can tell; and in all channels of a
rendering at the picture's exposure, of 1: nearly as bright. Lower, and a thing that has become
lighter would be hidden."""


@dataclass(frozen=True)
class ErrorMap:
    """What is wrong with a rendered view.

    Attributes:
        error: L1 over RGB of straight colours in 0…1, so 0…3.
        peaked: What a view from here mends: what is `wrong` or `unseen`. With `marks="paper"` where
            the error is above the threshold, as in the paper.
        unseen: No view has seen what is here.
        unfixable: It is wrong, and no view will help: it has moved, is a mirror or glass, or is
            brighter than the camera can tell.
        counted: Pixels of which shares and means are taken; None: all.
    """

    error: Float32[np.ndarray, "h w"]
    peaked: Bool[np.ndarray, "h w"]
    unseen: Bool[np.ndarray, "h w"]
    unfixable: Bool[np.ndarray, "h w"]
    counted: Bool[np.ndarray, "h w"] | None = None

    def within(self, mask: Bool[np.ndarray, "h w"] | None) -> ErrorMap:
        """Return the map, and its shares, without what a mask of the picture leaves out."""
        if mask is None:
            return self
        return replace(
            self,
            error=np.where(mask, self.error, np.float32(0)),
            peaked=self.peaked & mask,
            unseen=self.unseen & mask,
            unfixable=self.unfixable & mask,
            counted=mask,
        )

    @property
    def wrong(self) -> Bool[np.ndarray, "h w"]:
        """Seen, shown wrongly, and mended by a view from here."""
        return self.peaked & ~self.unseen

    def without(self, unfixable: Bool[np.ndarray, "h w"]) -> ErrorMap:
        """Return the map where of what was wrong this part is unfixable."""
        lost = self.wrong & unfixable
        return replace(self, peaked=self.peaked & ~lost, unfixable=self.unfixable | lost)

    @property
    def peaked_share(self) -> float:
        """Peaked pixels divided by all pixels, 0…1."""
        return self._share(self.peaked)

    @property
    def wrong_share(self) -> float:
        """Wrong pixels divided by all pixels, 0…1."""
        return self._share(self.wrong)

    @property
    def unseen_share(self) -> float:
        """Pixels of what no view has seen divided by all pixels, 0…1."""
        return self._share(self.unseen)

    @property
    def unfixable_share(self) -> float:
        """Pixels that no view will help divided by all pixels, 0…1."""
        return self._share(self.unfixable)

    @property
    def mean_error(self) -> float:
        """Mean of the error over all pixels, 0…3."""
        if self.counted is None:
            return float(self.error.mean())
        return float(self.error.sum(dtype=np.float64) / max(self._count, 1))

    @property
    def _count(self) -> int:
        return self.error.size if self.counted is None else int(np.count_nonzero(self.counted))

    def _share(self, marked: Bool[np.ndarray, "h w"]) -> float:
        return np.count_nonzero(marked) / max(self._count, 1)


def compare(
    rendering: Rendering,
    live: UInt8[np.ndarray, "h w 3"],
    *,
    unseen: Bool[np.ndarray, "h w"] | None = None,
    threshold: float = DEFAULT.error_threshold,
    shift_px: float = DEFAULT.shift_px,
    compensate_exposure: bool = DEFAULT.compensate_exposure,
    marks: Marks = DEFAULT.marks,
    backend: Backend = "numba",
) -> ErrorMap:
    """Compare a rendering with the live picture of the same camera.

    The error of a pixel is `L(c_mpi, c_vid) = Σ_rgb |c_mpi - c_vid|` (paper, section 3.2) with the
    straight colour of the rendering, and black where nothing was rendered. With `shift_px` it is
    the least against the rendering displaced by so much, in nine ways; and the same asked the other
    way round, the live picture displaced; of the two the larger counts. So a misalignment that
    small is forgiven, and what only one of the pictures has, such as a ghost's edge, is not.

    Args:
        rendering: What the captured views show.
        live: What the camera sees.
        unseen: What no view has seen (`peaking.memory`); else where the rendering is empty.
        threshold: Error above which a pixel is peaked, t of the paper; 0…3.
        shift_px: Pixels by which the pictures may be displaced without counting as wrong; 0…1.
        compensate_exposure: Compare after exposure, white balance and vignette are made equal.
        marks: What counts as peaked.
        backend: Which implementation.

    Raises:
        ValueError: The sizes differ, or a number is out of its range.
    """
    if not 0 < threshold < 3:
        raise ValueError(f"need 0 < threshold < 3, got {threshold}")
    if not 0 <= shift_px <= 1:
        raise ValueError(f"need 0 <= shift_px <= 1, got {shift_px}")
    if live.shape[:2] != rendering.depth_m.shape:
        raise ValueError(
            f"need a live picture of the rendering's size {rendering.depth_m.shape}, "
            f"got {live.shape[:2]}"
        )
    exposure = measure_exposure(rendering, live) if compensate_exposure else SAME
    if backend == "numpy":
        from peaking.error_map import _numpy as module
    else:
        from peaking.error_map import _numba as module
    error, over, empty = module.compare(
        rendering.rgba,
        live,
        exposure.gain,
        exposure.factors(*live.shape[1::-1]),
        threshold=threshold,
        shift_px=shift_px,
        min_alpha=MIN_ALPHA,
    )
    never = empty if unseen is None else unseen | (empty & _grown(unseen))
    nothing = np.zeros_like(never)
    if marks == "paper":
        return ErrorMap(error, over, never, nothing)
    # Where something was seen that no view can show from here, nothing was compared.
    errors = ErrorMap(error, over | never | empty, never, nothing)
    return errors.without(_blown_out(rendering, live, exposure))


def _grown(mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return a mask with a rim: what views saw ends a little later than what can be shown of it."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(np.bool_)


def _blown_out(
    rendering: Rendering, live: UInt8[np.ndarray, "h w 3"], exposure: Exposure
) -> Bool[np.ndarray, "h w"]:
    """Return where the picture is as bright as it can be, and the rendering of a bright thing.

    What the rendering shows dark there is wrong, however bright the picture.
    """
    out = (live >= BLOWN_OUT).all(axis=2) & (rendering.alpha >= MIN_ALPHA)
    shown = rendering.rgba[out]
    bright = shown[:, :3] * exposure.gain >= BRIGHT * shown[:, 3:]
    out[out] = bright.all(axis=1)
    return out
