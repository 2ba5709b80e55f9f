"""LPIPS and ST-LPIPS: how far apart two pictures are in the features of a trained network.

`lpips-alex` and `lpips-vgg` (Zhang, Isola, Efros, Shechtman and Wang, "The Unreasonable
Effectiveness of Deep Features as a Perceptual Metric", CVPR 2018; version 0.1) need the official
ImageNet weights of torchvision, which the user puts in place, and the linear heads in the package
`lpips`. `st-lpips-alex` (Ghildyal and Liu, "Shift-tolerant Perceptual Similarity Metric", ECCV
2022) needs the package `stlpips-pytorch`, which holds all of its weights. Neither package is
imported: weights are read from them, and checked. Nothing is ever downloaded.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float32

from peaking.checkpoints import checkpoints_folder
from peaking.errors import BackendUnavailable, ToolMissing

LpipsName = Literal["lpips-alex", "lpips-vgg", "st-lpips-alex"]
Distance = Callable[[np.ndarray, np.ndarray], float]
"""From (image, reference), float32 (h, w, 3) of encoded sRGB values in 0…1; less is better."""

DIGITS = 8
"""So many hex digits of the SHA-256 say which file it is, as in torchvision's file names."""

MEAN = np.array([-0.030, -0.088, -0.188], dtype=np.float32)
DEVIATION = np.array([0.458, 0.448, 0.450], dtype=np.float32)
"""Of ImageNet's colours in -1…1: the scaling layer of LPIPS."""

LENGTH_FLOOR = 1e-10
"""Added to the length of a feature before it divides."""

SMALLEST_PX = 32
"""VGG16 halves the picture four times, AlexNet has filters of 11 px and steps of 4 and 2."""


@dataclass(frozen=True)
class _Conv:
    """A convolution (with bias) and its place in the file: `key`.weight, `key`.bias."""

    key: str
    padding: int
    stride: int = 1


@dataclass(frozen=True)
class _MaxPool:
    size: int
    stride: int


_Step = _Conv | _MaxPool | Literal["relu", "blur", "tap"]
"""`blur`: 1 2 1 in both directions, every second pixel, two pixels of mirrored rim (Zhang,
"Making Convolutional Networks Shift-Invariant Again", ICML 2019); `tap`: features are compared."""


def _vgg16() -> tuple[_Step, ...]:
    """Return the convolutional layers of VGG16; blocks end in a tap, and start with a pool."""
    steps: list[_Step] = []
    index = 0
    for block in (2, 2, 3, 3, 3):
        if steps:
            steps.append(_MaxPool(2, 2))
            index += 1
        for _ in range(block):
            steps.append(_Conv(f"features.{index}", padding=1))
            steps.append("relu")
            index += 2
        steps.append("tap")
    return tuple(steps)


_ALEXNET: tuple[_Step, ...] = (
    *(_Conv("features.0", padding=2, stride=4), "relu", "tap", _MaxPool(3, 2)),
    *(_Conv("features.3", padding=2), "relu", "tap", _MaxPool(3, 2)),
    *(_Conv("features.6", padding=1), "relu", "tap"),
    *(_Conv("features.8", padding=1), "relu", "tap"),
    *(_Conv("features.10", padding=1), "relu", "tap"),
)

_SHIFT_TOLERANT_ALEXNET: tuple[_Step, ...] = (
    *(_Conv("net.slice1.0", padding=2), "blur", "relu", "tap", _MaxPool(3, 1), "blur"),
    *(_Conv("net.slice2.5", padding=2), "relu", "tap", _MaxPool(3, 1), "blur"),
    *(_Conv("net.slice3.9", padding=1), "relu", "tap"),
    *(_Conv("net.slice4.11", padding=1), "relu", "tap"),
    *(_Conv("net.slice5.13", padding=1), "relu", "tap"),
)


@dataclass(frozen=True)
class _Metric:
    """What a metric is made of.

    Attributes:
        steps: The layers of its network.
        package: Name of the package with the heads, as imported.
        install: Name of the package, as installed.
        heads: The file in the package that has lin0…lin4.
        heads_sha256: First digits of its SHA-256.
        backbone: torchvision's file, whose name ends in those digits; None: `heads` has all.
    """

    steps: tuple[_Step, ...]
    package: str
    install: str
    heads: str
    heads_sha256: str
    backbone: str | None


METRICS: dict[str, _Metric] = {
    "lpips-alex": _Metric(
        steps=_ALEXNET,
        package="lpips",
        install="lpips",
        heads="weights/v0.1/alex.pth",
        heads_sha256="df73285e",
        backbone="alexnet-owt-7be5be79.pth",
    ),
    "lpips-vgg": _Metric(
        steps=_vgg16(),
        package="lpips",
        install="lpips",
        heads="weights/v0.1/vgg.pth",
        heads_sha256="a78928a0",
        backbone="vgg16-397923af.pth",
    ),
    "st-lpips-alex": _Metric(
        steps=_SHIFT_TOLERANT_ALEXNET,
        package="stlpips_pytorch",
        install="stlpips-pytorch",
        heads="weights/vST0.0/alex_shift_tolerant.pth",
        heads_sha256="b356b382",
        backbone=None,
    ),
}


def available(name: LpipsName, *, folder: Path | None = None) -> bool:
    """Return whether PyTorch, the package and the weights of a metric are there (not yet read)."""
    metric = _metric(name)
    try:
        _torch()
        _heads_file(metric)
        if metric.backbone is not None:
            _backbone_file(metric.backbone, folder)
    except (BackendUnavailable, ToolMissing):
        return False
    return True


def open_lpips(name: LpipsName, *, folder: Path | None = None) -> Distance:
    """Return the metric as a function of (image, reference).

    The backbone's file is looked for in `folder`, in `checkpoints_folder()` and in torch.hub's
    checkpoints, in this order. The function raises ValueError for pictures of two sizes or below
    32×32 px.

    Raises:
        BackendUnavailable: PyTorch is not installed.
        ToolMissing: A package or a file is missing, or a file is not what its name says.
    """
    metric = _metric(name)
    try:
        weights = _load(_heads_file(metric), metric.heads_sha256)
        if metric.backbone is not None:
            digits = Path(metric.backbone).stem.rsplit("-", 1)[1]
            weights |= _load(_backbone_file(metric.backbone, folder), digits)
    except ToolMissing as error:
        raise ToolMissing(f"{name}: {error}") from error
    return _Network(metric.steps, weights)


def _metric(name: str) -> _Metric:
    if name not in METRICS:
        raise ValueError(f"need one of {', '.join(METRICS)}, got {name!r}")
    return METRICS[name]


class _Network:
    """A metric with its weights; calling it compares two pictures."""

    def __init__(self, steps: tuple[_Step, ...], weights: Mapping[str, Any]) -> None:
        torch = _torch()
        self._steps = steps
        keys = [step.key for step in steps if isinstance(step, _Conv)]
        self._convolutions = {
            key: (
                weights[f"{key}.weight"].contiguous(memory_format=torch.channels_last),
                weights[f"{key}.bias"],
            )
            for key in keys
        }
        self._heads = [weights[f"lin{i}.model.1.weight"] for i in range(steps.count("tap"))]
        binomial = torch.tensor([1.0, 2.0, 1.0]) / 4
        self._blur = torch.outer(binomial, binomial)[None, None]

    def __call__(
        self, image: Float32[np.ndarray, "h w 3"], reference: Float32[np.ndarray, "h w 3"]
    ) -> float:
        if image.shape != reference.shape or min(image.shape[:2]) < SMALLEST_PX:
            raise ValueError(
                f"need two pictures of one shape (h, w, 3), at least {SMALLEST_PX} px high and "
                f"wide, got {image.shape} and {reference.shape}"
            )
        torch = _torch()
        pair = (np.stack([image, reference]) * 2 - 1 - MEAN) / DEVIATION
        with torch.inference_mode():
            features = torch.from_numpy(pair).permute(0, 3, 1, 2)  # stays channels-last
            heads = iter(self._heads)
            distance = 0.0
            for step in self._steps:
                if step == "tap":
                    distance += self._compare(features, next(heads))
                else:
                    features = self._apply(step, features)
        return distance

    def _apply(self, step: _Step, features: Any) -> Any:
        """Return the features after one layer."""
        torch = _torch()
        functional = torch.nn.functional
        if isinstance(step, _Conv):
            weight, bias = self._convolutions[step.key]
            return functional.conv2d(
                features, weight, bias, stride=step.stride, padding=step.padding
            )
        if isinstance(step, _MaxPool):
            return functional.max_pool2d(features, step.size, step.stride)
        if step == "blur":
            channels = features.shape[1]
            padded = functional.pad(features, (2, 2, 2, 2), mode="reflect")
            kernel = self._blur.expand(channels, 1, 3, 3)
            return functional.conv2d(padded, kernel, stride=2, groups=channels)
        return torch.relu_(features)

    @staticmethod
    def _compare(features: Any, head: Any) -> float:
        """Return the mean weighted square difference of the two pictures' unit features."""
        length = features.square().sum(dim=1, keepdim=True).sqrt()
        unit = features / (length + LENGTH_FLOOR)
        return float(((unit[:1] - unit[1:]).square() * head).sum(dim=1).mean())


def _torch() -> Any:
    """Return PyTorch."""
    try:
        return importlib.import_module("torch")
    except ImportError as error:
        raise BackendUnavailable(
            "LPIPS needs PyTorch, which is not installed; pip install 'peaking[torch]'"
        ) from error


def _heads_file(metric: _Metric) -> Path:
    """Return the file in the package of a metric; the package is found, not imported."""
    spec = find_spec(metric.package)
    if spec is None or not spec.submodule_search_locations:
        raise ToolMissing(
            f"needs weights of the package {metric.install}, which is not installed; "
            f"pip install --no-deps {metric.install}"
        )
    path = Path(next(iter(spec.submodule_search_locations))) / metric.heads
    if not path.is_file():
        raise ToolMissing(
            f"{path}: not in this version of {metric.install}; "
            f"pip install --no-deps --force-reinstall {metric.install}"
        )
    return path


def _backbone_file(backbone: str, folder: Path | None) -> Path:
    """Return torchvision's file in the first folder that has it."""
    hub = Path(_torch().hub.get_dir()) / "checkpoints"
    folders = [*([folder] if folder else []), checkpoints_folder(), hub]
    for place in folders:
        if (place / backbone).is_file():
            return place / backbone
    raise ToolMissing(
        f"needs torchvision's file {backbone}, which is not in {', '.join(map(str, folders))}; "
        "put it into one of them, or set PEAKING_CHECKPOINTS to its folder"
    )


def _load(path: Path, digits: str) -> dict[str, Any]:
    """Return the tensors of a file whose SHA-256 begins with `digits`."""
    try:
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()[:DIGITS]
    except OSError as error:
        raise ToolMissing(f"{path}: cannot be read ({error.strerror}); mend its rights") from error
    if found != digits:
        raise ToolMissing(
            f"{path}: its SHA-256 begins with {found}, that of the published weights with "
            f"{digits}; replace it by the published file"
        )
    return _torch().load(path, map_location="cpu", weights_only=True)
