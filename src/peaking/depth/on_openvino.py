"""Depth models of the hub on a processor through OpenVINO, which runs them faster than PyTorch.

A model is converted once for every size of picture; that takes half a minute at worst, so what
comes of it is kept beside the weights. The converter is called by itself, since
`openvino.convert_model` reports its use over the network.
"""

# PyTorch and OpenVINO are typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import hashlib
import importlib
import logging
import shutil
import tempfile
import threading
import warnings
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float32

from peaking.errors import BackendUnavailable

Precision = Literal["f32", "bf16"]
DIGITS = 12
"""So many hex digits of the SHA-256 of a model say whose conversion a folder holds."""

_log = logging.getLogger("peaking.depth")


class OnOpenVino:
    """A depth model on this machine's processor. May be called from several threads."""

    def __init__(
        self, model: torch.nn.Module, folder: Path, kept_in: Path, precision: Precision
    ) -> None:
        """Take a model in PyTorch and the folder that it was read from.

        Args:
            model: Returns `predicted_depth`.
            folder: Where its weights lie; what they are says whether a conversion is theirs.
            kept_in: Folder for conversions; when it cannot be written, each start converts again.
            precision: `bf16` is as fast as the processor knows that type, and rounds to 3 digits.

        Raises:
            BackendUnavailable: OpenVINO is not installed.
        """
        try:
            self._openvino: Any = importlib.import_module("openvino")
            frontend: Any = importlib.import_module("openvino.frontend")
            self._decoder: Any = importlib.import_module("openvino.frontend.pytorch.ts_decoder")
        except ImportError as error:
            raise BackendUnavailable(
                f"OpenVINO is not here ({error}); pip install 'peaking[openvino]', or leave out "
                "--depth-runtime"
            ) from error
        self._frontend = frontend.FrontEndManager().load_by_framework("pytorch")
        self._core = self._openvino.Core()
        self._model = _DepthAlone(model).eval()
        self._kept_in = kept_in
        self._name = f"{folder.name}-{_digest(folder)}"
        self._how = {"INFERENCE_PRECISION_HINT": precision, "PERFORMANCE_HINT": "LATENCY"}
        self._lock = threading.Lock()
        self._compiled: dict[tuple[int, ...], Any] = {}

    def __call__(self, shown: Float32[np.ndarray, "1 3 h w"]) -> Float32[np.ndarray, "h2 w2"]:
        """Return what the model says of a prepared picture."""
        with self._lock:
            if shown.shape not in self._compiled:
                self._compiled[shown.shape] = self._core.compile_model(
                    self._converted(shown), "CPU", self._how
                )
            compiled = self._compiled[shown.shape]
        return np.asarray(compiled.infer_new_request({0: shown})[0][0], np.float32)

    def _converted(self, shown: Float32[np.ndarray, "1 3 h w"]) -> Any:
        height, width = shown.shape[2:]
        place = self._kept_in / f"{self._name}-{width}x{height}"
        if (place / "model.xml").is_file():
            try:
                return self._core.read_model(place / "model.xml")
            except RuntimeError as error:
                _log.warning("%s is damaged (%s); converting again", place, error)
                shutil.rmtree(place, ignore_errors=True)
        _log.info("converting %s for %dx%d, once", self._name, width, height)
        with warnings.catch_warnings():  # about what tracing fixes: sizes, which stay
            warnings.simplefilter("ignore")
            traced = torch.jit.trace(self._model, torch.from_numpy(shown))
            decoder = self._decoder.TorchScriptPythonDecoder(traced)
            converted = self._frontend.convert(self._frontend.load(decoder))
        converted.reshape(list(shown.shape))
        self._keep(converted, place)
        return converted

    def _keep(self, converted: Any, place: Path) -> None:
        """Write a conversion, complete or not at all."""
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            partial = Path(tempfile.mkdtemp(prefix=".", dir=place.parent))
            try:
                self._openvino.save_model(converted, partial / "model.xml", compress_to_fp16=False)
                partial.rename(place)
            finally:
                shutil.rmtree(partial, ignore_errors=True)
        except (OSError, RuntimeError) as error:
            _log.warning("%s was not kept (%s); the next start converts again", place, error)


class _DepthAlone(torch.nn.Module):
    """A depth model that returns nothing but depth."""

    def __init__(self, model: torch.nn.Module) -> None:
        super().__init__()
        self._model = model

    def forward(self, shown: torch.Tensor) -> torch.Tensor:
        return self._model(shown).predicted_depth


def _digest(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted([folder / "config.json", *folder.glob("*.safetensors")]):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:DIGITS]
