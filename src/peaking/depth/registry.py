"""The depth estimators by name."""

from __future__ import annotations

from peaking.checkpoints import depth_model_folder
from peaking.depth.estimator import DepthEstimator
from peaking.errors import BackendUnavailable
from peaking.options import DepthRuntime, Device


def create_estimator(
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
