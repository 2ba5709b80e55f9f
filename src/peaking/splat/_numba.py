"""The optimiser on the CPU, by the compiled kernels."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from peaking.frame import Frame
from peaking.splat._adam_numba import adam_step
from peaking.splat.loss import loss_and_gradient
from peaking.splat.optimiser import AdamState, Progress
from peaking.splat.rendering import CutOffs
from peaking.splat.tape import Tape


class NumbaOptimiser:
    """See `peaking.splat.optimiser.Optimiser`; the same steps give the same bits."""

    def __init__(self, state: AdamState, cut_offs: CutOffs) -> None:
        self._cut_offs = cut_offs
        self._steps = 0
        self.reset(state)

    def reset(self, state: AdamState) -> None:
        """Go on with other Gaussians."""
        self._state = state
        self._grad2d = np.zeros(len(state.parameters), np.float32)
        self._count = np.zeros(len(state.parameters), np.float32)

    def step(self, frame: Frame, learning_rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, compare, move."""
        state = self._state
        tape = Tape(state.parameters, frame.camera, self._cut_offs)
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        rgb = np.ascontiguousarray(tape.rgb)
        if frame.mask is not None:  # what does not count is as it should be
            photo = np.where(frame.mask[..., None], photo, rgb)
        loss, by_rgb = loss_and_gradient(rgb, photo)
        if frame.mask is not None:
            by_rgb[~frame.mask] = 0
        gradients = tape.gradients(by_rgb, self._grad2d, self._count)
        self._steps += 1
        adam_step(
            state.parameters,
            gradients,
            state.first_moment,
            state.second_moment,
            learning_rates,
            self._steps,
        )
        return loss

    def state(self) -> AdamState:
        """Return the parameters and moments as they are now."""
        return self._state

    def mean_grad2d(self) -> Float32[np.ndarray, "n"]:
        """Return the mean length of the gradient by the projected centre."""
        return self._grad2d / np.maximum(self._count, 1)

    def progress(self) -> Progress:
        """Return what else is needed to go on later."""
        return Progress(self._steps, self._grad2d, self._count)

    def go_on(self, state: AdamState, progress: Progress) -> None:
        """Go on from where another optimiser stopped."""
        self.reset(state)
        self._steps = progress.steps
        self._grad2d = progress.grad2d
        self._count = progress.count
