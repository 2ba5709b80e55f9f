"""The optimiser on the CPU, by the compiled kernels."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from peaking.frame import Frame
from peaking.splat._adam_numba import adam_step
from peaking.splat.loss import loss_and_gradient
from peaking.splat.optimiser import Moments
from peaking.splat.tape import Tape
from peaking.splat.view import CutOffs


class NumbaOptimiser:
    """See `peaking.splat.optimiser.Optimiser`; the same steps give the same bits."""

    def __init__(self, moments: Moments, cut_offs: CutOffs) -> None:
        self._cut_offs = cut_offs
        self._steps = 0
        self.restart(moments)

    def restart(self, moments: Moments) -> None:
        """Go on with other Gaussians."""
        self._moments = moments
        self._screen = np.zeros((len(moments.parameters), 2), np.float32)

    def step(self, frame: Frame, rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, compare, move."""
        moments = self._moments
        tape = Tape(moments.parameters, frame.camera, self._cut_offs)
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        loss, by_rgb = loss_and_gradient(np.ascontiguousarray(tape.rgb), photo)
        gradients = tape.gradients(by_rgb, self._screen)
        self._steps += 1
        adam_step(moments.parameters, gradients, moments.first, moments.second, rates, self._steps)
        return loss

    def moments(self) -> Moments:
        """Return the parameters as they are now."""
        return self._moments

    def pulls(self) -> Float32[np.ndarray, "n"]:
        """Return the mean gradient by the position on the picture."""
        return self._screen[:, 0] / np.maximum(self._screen[:, 1], 1)
