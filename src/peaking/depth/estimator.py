"""Depth from a picture alone: the protocol, and estimators by name."""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.checkpoints import depth_model_folder
from peaking.errors import BackendUnavailable

Device = Literal["auto", "cpu", "cuda"]
DepthRuntime = Literal["pytorch", "openvino", "openvino-bf16"]
"""What runs the model; OpenVINO is for processors."""


@runtime_checkable
class DepthEstimator(Protocol):
    """Guesses disparity, large where near, from one picture."""

    @property
    def name(self) -> str:
        """What logs and reports call it."""
        ...

    @property
    def metric(self) -> bool:
        """Whether it guesses 1/m; else scale and shift are unknown, in every picture others."""
        ...

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
        """Return disparity at every pixel."""
        ...


def estimator_named(
    model: str, *, device: Device = "auto", runtime: DepthRuntime = "pytorch"
) -> DepthEstimator:
    """Return an estimator, ready for use; nothing is downloaded.

    Args:
        model: A folder, or a name of the Hugging Face hub whose files are here.
        device: Where it runs.
        runtime: What runs it.

    Raises:
        BackendUnavailable: PyTorch, transformers, OpenVINO or CUDA is missing.
        CheckpointError: The model is not here, or its files cannot be used.
    """
    folder = depth_model_folder(model)
    try:
        from peaking.depth.hub import HubDepth
    except ImportError as error:
        raise BackendUnavailable(
            f"estimating depth needs PyTorch and transformers ({error}); "
            "pip install 'peaking[torch]'"
        ) from error
    return HubDepth.load(folder, device=device, runtime=runtime)
