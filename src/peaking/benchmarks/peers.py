"""What the stages are compared with: common implementations, and memory bandwidth."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float32

from peaking.errors import ToolMissing
from peaking.geometry import Camera
from peaking.mpi import Mpi
from peaking.rendering import plane_homographies

INSTALL = "pip install 'peaking[torch]', or leave the peers out: --no-peers"
BANDWIDTH_BYTES = 256 * 2**20


def torch_layer_loop(mpi: Mpi) -> Callable[[Camera], Float32[np.ndarray, "h w 4"]]:
    """Return a plain PyTorch renderer of the MPI: `grid_sample` plane by plane, then over.

    The dense planes are premultiplied float32 tensors, made once; only what a renderer has to do
    for every new view is in the function that is returned.

    Raises:
        ToolMissing: PyTorch is not installed.
    """
    torch = _installed("torch")
    functional = torch.nn.functional
    width, height = mpi.camera.pinhole.size_px
    planes = torch.from_numpy(mpi.dense()).permute(0, 3, 1, 2).float() / 255.0
    source_size = torch.tensor([width, height], dtype=torch.float32)

    def render(camera: Camera) -> Float32[np.ndarray, "h w 4"]:
        target_width, target_height = camera.pinhole.size_px
        homographies, _ = plane_homographies(mpi, camera)
        pixels = torch.from_numpy(
            np.dstack([camera.pinhole.pixel_centers(), np.ones((target_height, target_width))])
        ).float()
        out = torch.zeros(4, target_height, target_width)
        with torch.inference_mode():
            for plane, homography in zip(planes, homographies, strict=True):
                if np.isnan(homography[0, 0]):
                    continue
                warped = pixels @ torch.from_numpy(homography.T).float()
                grid = warped[..., :2] / warped[..., 2:] / source_size * 2.0 - 1.0
                layer = functional.grid_sample(
                    plane[None], grid[None], padding_mode="zeros", align_corners=False
                )[0]
                out = layer + (1.0 - layer[3]) * out
        return out.permute(1, 2, 0).numpy()

    return render


def depth_anything_small() -> Callable[[], object]:
    """Return one forward pass of Depth Anything V2 Small at 518×518, with random weights.

    The same arithmetic as with the trained ones, so the same time.

    Raises:
        ToolMissing: PyTorch or transformers is not installed.
    """
    torch, transformers = _installed("torch"), _installed("transformers")
    backbone = transformers.Dinov2Config(
        hidden_size=384,
        num_hidden_layers=12,
        num_attention_heads=6,
        image_size=518,
        patch_size=14,
        out_features=["stage3", "stage6", "stage9", "stage12"],
        reshape_hidden_states=False,
    )
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone,
        reassemble_hidden_size=384,
        neck_hidden_sizes=[48, 96, 192, 384],
        fusion_hidden_size=64,
    )
    model = transformers.DepthAnythingForDepthEstimation(config).eval()
    picture = torch.rand(1, 3, 518, 518)

    def forward() -> object:
        with torch.inference_mode():
            return model(picture).predicted_depth

    return forward


def bandwidth_bytes_per_ms(clock_s: Callable[[], float] = time.perf_counter) -> float:
    """Return how many bytes per millisecond all cores together read from memory, at best."""
    from peaking.benchmarks._kernels import read_all

    block = np.ones(BANDWIDTH_BYTES // 8, np.uint64)
    read_all(block)
    best_s = float("inf")
    for _ in range(7):
        start_s = clock_s()
        read_all(block)
        best_s = min(best_s, clock_s() - start_s)
    return block.nbytes / (best_s * 1e3)


def _installed(name: str) -> Any:
    """Import a package of the extra `torch`."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ToolMissing(f"{name} is not installed ({error}); {INSTALL}") from error
