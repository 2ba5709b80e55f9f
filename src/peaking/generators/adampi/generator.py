"""The `adampi` generator: AdaMPI with a checkpoint that the user supplies."""

# PyTorch is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from peaking.errors import BackendUnavailable, CheckpointError
from peaking.generators.adampi.checkpoint import Checkpoint, read_checkpoint
from peaking.generators.adampi.chunked import Chunks, forward_in_chunks
from peaking.generators.adampi.cpu import forward_on_cpu
from peaking.generators.adampi.inputs import inputs_of
from peaking.generators.adampi.layers import planes_of, to_mpi
from peaking.generators.adampi.network import Layers
from peaking.geometry import Camera
from peaking.mpi import Mpi
from peaking.options import Device, Precision

ALPHA_CUT = 4 / 255
"""Opacity below which a texel goes to the plane behind: docs/generators.md says what that costs."""


class AdaMpi:
    """A learned generator (Han et al., SIGGRAPH 2022) for one checkpoint on one device."""

    name = "adampi"

    def __init__(
        self,
        checkpoint: Checkpoint,
        *,
        device: Device = "auto",
        precision: Precision = "float32",
        alpha_cut: float = ALPHA_CUT,
    ) -> None:
        """Take a checkpoint to a device.

        Args:
            checkpoint: The network and its number of planes.
            device: `auto` is CUDA where there is one.
            precision: Of convolutions; other than float32 on CUDA only.
            alpha_cut: As in `layers.rounded`.

        Raises:
            BackendUnavailable: CUDA, or a precision that needs it, was asked for and CUDA is not
                there.
        """
        self.device = choose_device(device)
        if precision != "float32" and self.device.type != "cuda":
            raise BackendUnavailable(
                f"--precision {precision} needs CUDA, and the network runs on {self.device.type}; "
                "use --precision float32"
            )
        if not 0 <= alpha_cut < 1:
            raise ValueError(f"need 0 <= alpha_cut < 1, got {alpha_cut}")
        self.num_planes = checkpoint.num_planes
        self.precision: Precision = precision
        self.alpha_cut = alpha_cut
        self._network = checkpoint.network.to(self.device)
        self._chunks = Chunks(self.num_planes)

    @staticmethod
    def load(
        path: Path,
        *,
        num_planes: int,
        device: Device = "auto",
        precision: Precision = "float32",
    ) -> AdaMpi:
        """Read a checkpoint.

        Raises:
            CheckpointError: It cannot be used, or is made for another number of planes.
        """
        checkpoint = read_checkpoint(path)
        if checkpoint.num_planes != num_planes:
            raise CheckpointError(
                f"{path}: num_planes: is made for {checkpoint.num_planes} planes, {num_planes} "
                f"were asked for; use --num-planes {checkpoint.num_planes} or another file"
            )
        return AdaMpi(checkpoint, device=device, precision=precision)

    def __call__(
        self,
        rgb: UInt8[np.ndarray, "h w 3"],
        depth_m: Float32[np.ndarray, "h w"],
        camera: Camera,
    ) -> Mpi:
        """Make the MPI of a picture whose depth is known at every pixel.

        Raises:
            PeakingError: The picture is too small, or the graphics card has no room.
            ValueError: Sizes differ, or a depth is not a number > 0.
        """
        if rgb.shape[:2] != camera.pinhole.size_px[::-1]:
            raise ValueError(
                f"need picture and camera of one size, got {rgb.shape[:2]} and "
                f"{camera.pinhole.size_px[::-1]}"
            )
        shown = inputs_of(rgb, depth_m)
        height, width = rgb.shape[:2]

        def work() -> Mpi:
            picture = torch.from_numpy(shown.rgb).to(self.device).permute(2, 0, 1)
            disparity = torch.from_numpy(shown.disparity).to(self.device)
            layers = self._forward(picture[None].contiguous(), disparity[None, None])
            cropped = Layers(layers.disparities, layers.colour_density[..., :height, :width])
            planes = planes_of(cropped, picture[:, :height, :width], camera.pinhole)
            return to_mpi(
                planes,
                camera,
                disparity_range_per_m=shown.range_per_m,
                alpha_cut=self.alpha_cut,
                generator=self.name,
            )

        with torch.inference_mode():
            return self._chunks.fitting(work)

    def _forward(self, rgb: torch.Tensor, disparity: torch.Tensor) -> Layers:
        if self.device.type == "cpu":
            return forward_on_cpu(self._network, rgb, disparity, self.num_planes)
        return forward_in_chunks(
            self._network,
            rgb,
            disparity,
            self.num_planes,
            chunks=self._chunks,
            precision=self.precision,
        )


def choose_device(device: Device) -> torch.device:
    """Return a device.

    Raises:
        BackendUnavailable: CUDA was asked for and is not there.
    """
    if device == "cuda" and not torch.cuda.is_available():
        raise BackendUnavailable(
            "PyTorch finds no CUDA here; use --device cpu, or install a CUDA build of PyTorch"
        )
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(device)
