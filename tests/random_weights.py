"""Weights of a fixed seed in the layouts of AlexNet, VGG16 and shift-tolerant AlexNet."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

Weights = dict[str, Float32[np.ndarray, "..."]]

ALEXNET = {
    "features.0": (64, 3, 11),
    "features.3": (192, 64, 5),
    "features.6": (384, 192, 3),
    "features.8": (256, 384, 3),
    "features.10": (256, 256, 3),
}
VGG16 = {
    f"features.{index}": (channels, before, 3)
    for index, channels, before in zip(
        (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28),
        (64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512),
        (3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512),
        strict=True,
    )
}
SHIFT_TOLERANT_ALEXNET = dict(
    zip(
        ("net.slice1.0", "net.slice2.5", "net.slice3.9", "net.slice4.11", "net.slice5.13"),
        ALEXNET.values(),
        strict=True,
    )
)
LAYOUTS = {
    "lpips-alex": (ALEXNET, (64, 192, 384, 256, 256)),
    "lpips-vgg": (VGG16, (64, 128, 256, 512, 512)),
    "st-lpips-alex": (SHIFT_TOLERANT_ALEXNET, (64, 192, 384, 256, 256)),
}


def random_weights(name: str) -> tuple[Weights, Weights]:
    """Return (backbone, heads) of a metric: evenly distributed, scaled to keep the variance."""
    rng = np.random.default_rng(2018)
    shapes, taps = LAYOUTS[name]
    backbone: Weights = {}
    for key, (channels, before, size) in shapes.items():
        limit = np.float32(np.sqrt(6 / (before * size**2)))
        weight = rng.random((channels, before, size, size), dtype=np.float32)
        backbone[f"{key}.weight"] = (2 * weight - 1) * limit
        backbone[f"{key}.bias"] = rng.random(channels, dtype=np.float32) * np.float32(0.1)
    heads = {
        f"lin{i}.model.1.weight": rng.random((1, channels, 1, 1), dtype=np.float32)
        for i, channels in enumerate(taps)
    }
    return backbone, heads
