"""Depth Anything V2 (Yang et al., NeurIPS 2024), and every depth model of the same interface.

Read through `transformers` from a folder, with safetensors: nothing is downloaded and nothing in
the files is run. Pictures are prepared here, as the model's preprocessor_config.json says.
"""

# PyTorch and transformers are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8
from transformers import AutoConfig, AutoModelForDepthEstimation

from peaking.checkpoints import checkpoints_folder
from peaking.errors import BackendUnavailable, CheckpointError
from peaking.options import DepthRuntime, Device

METRIC_KINDS = ("zoedepth", "glpn")
"""Architectures that give metres always; of others the configuration says it."""

FARTHEST_M = 1e3

MAX_SIDE_PX = 4096
"""Of what a model is shown."""

MAX_CONFIG_BYTES = 2**16
"""Of a preprocessor_config.json; those of the hub have 1 kB."""

Run = Callable[[Float32[np.ndarray, "1 3 h w"]], Float32[np.ndarray, "h2 w2"]]
"""From a prepared picture to what the model says of it."""


@dataclass(frozen=True)
class Preparation:
    """How a picture becomes the model's input.

    Attributes:
        width_px: Wanted size; what comes of it depends on the aspect.
        height_px: The same.
        keep_aspect: Scale both axes alike, by the factor that is nearer to 1.
        multiple_px: Sides become multiples of this.
        mean: Of colours, 0…1.
        std: The same.
    """

    width_px: int
    height_px: int
    keep_aspect: bool
    multiple_px: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]

    @staticmethod
    def read(path: Path) -> Preparation:
        """Read a preprocessor_config.json.

        Raises:
            CheckpointError: It is missing or not as it should be.
        """
        try:
            with path.open("rb") as file:
                said: dict[str, Any] = json.loads(file.read(MAX_CONFIG_BYTES))
            size = said.get("size", {})
            shortest = size.get("shortest_edge", 384)
            return Preparation(
                width_px=_side_px(size.get("width", shortest)),
                height_px=_side_px(size.get("height", shortest)),
                keep_aspect=bool(said.get("keep_aspect_ratio", False)),
                multiple_px=_side_px(said.get("ensure_multiple_of", 1)),
                mean=_three(said.get("image_mean", (0.485, 0.456, 0.406))),
                std=_three(said.get("image_std", (0.229, 0.224, 0.225))),
            )
        except Exception as error:  # its fields may be anything
            raise CheckpointError(
                f"{path}: cannot be used ({error}); put the model's own file there"
            ) from error

    def size_px(self, width_px: int, height_px: int) -> tuple[int, int]:
        """Return the width and height that a picture gets (294×639 becomes 238×518)."""
        across, down = self.width_px / width_px, self.height_px / height_px
        if self.keep_aspect:
            across = down = min(across, down, key=lambda factor: abs(1.0 - factor))

        def side(length: float) -> int:
            return max(round(length / self.multiple_px), 1) * self.multiple_px

        return side(across * width_px), side(down * height_px)

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "1 3 h2 w2"]:
        """Return the model's input."""
        height, width = rgb.shape[:2]
        sized = cv2.resize(rgb, self.size_px(width, height), interpolation=cv2.INTER_CUBIC)
        mean, std = np.array(self.mean, np.float32), np.array(self.std, np.float32)
        colours = (sized.astype(np.float32) / 255.0 - mean) / std
        return np.ascontiguousarray(colours.transpose(2, 0, 1)[None], dtype=np.float32)


def _side_px(said: Any) -> int:
    side_px = int(said)
    if not 1 <= side_px <= MAX_SIDE_PX:
        raise ValueError(f"need 1..{MAX_SIDE_PX} pixels, got {said}")
    return side_px


def _three(numbers: Any) -> tuple[float, float, float]:
    red, green, blue = (float(number) for number in numbers)
    return red, green, blue


class OnPyTorch:
    """A depth model on one device, as PyTorch runs it."""

    def __init__(self, model: torch.nn.Module, device: Device) -> None:
        """Put a model on a device.

        Raises:
            BackendUnavailable: CUDA was asked for and is not there.
        """
        if device == "cuda" and not torch.cuda.is_available():
            raise BackendUnavailable("PyTorch finds no CUDA here; use --device cpu")
        if device == "auto":
            device = "cuda" if torch.cuda.is_available() else "cpu"
        placed: Any = model.to(device)
        self._model = placed.to(memory_format=torch.channels_last)  # faster on processors
        self._device = device

    def __call__(self, shown: Float32[np.ndarray, "1 3 h w"]) -> Float32[np.ndarray, "h2 w2"]:
        """Return what the model says of a prepared picture."""
        with torch.inference_mode():
            there = torch.from_numpy(shown).to(self._device, memory_format=torch.channels_last)
            return self._model(there).predicted_depth[0].float().cpu().numpy()


class HubDepth:
    """A depth model of the Hugging Face hub."""

    def __init__(self, run: Run, preparation: Preparation, *, name: str, metric: bool) -> None:
        """Take a model that is ready to run."""
        self.name = name
        self.metric = metric
        self._run = run
        self._prepare = preparation

    @staticmethod
    def load(
        folder: Path, *, device: Device = "auto", runtime: DepthRuntime = "pytorch"
    ) -> HubDepth:
        """Read a model from a folder.

        Raises:
            CheckpointError: Its files cannot be used.
            BackendUnavailable: CUDA or OpenVINO was asked for and is not there.
        """
        if runtime != "pytorch" and device == "cuda":
            raise BackendUnavailable(
                "OpenVINO runs on the processor; leave out --device cuda or --depth-runtime"
            )
        preparation = Preparation.read(folder / "preprocessor_config.json")
        try:
            config = AutoConfig.from_pretrained(folder, local_files_only=True)
            model = AutoModelForDepthEstimation.from_pretrained(
                folder, local_files_only=True, use_safetensors=True
            ).eval()
        except Exception as error:  # damaged files raise anything
            first = str(error).strip().splitlines()[0][:200] if str(error) else repr(error)
            raise CheckpointError(
                f"{folder}: the depth model cannot be read ({first}); "
                "put its config.json and model.safetensors there again"
            ) from error
        metric = (
            getattr(config, "depth_estimation_type", "relative") == "metric"
            or config.model_type in METRIC_KINDS
        )
        if runtime == "pytorch":
            run: Run = OnPyTorch(model, device)
        else:
            from peaking.depth.on_openvino import OnOpenVino

            precision = "bf16" if runtime == "openvino-bf16" else "f32"
            run = OnOpenVino(model, folder, checkpoints_folder() / "openvino", precision)
        return HubDepth(run, preparation, name=folder.name, metric=metric)

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
        """Return disparity at every pixel, large where near."""
        height, width = rgb.shape[:2]
        said = self._run(self._prepare(rgb))
        if self.metric:
            said = 1.0 / np.clip(said, 1.0 / FARTHEST_M, FARTHEST_M)
        return cv2.resize(said, (width, height), interpolation=cv2.INTER_LINEAR).astype(np.float32)
