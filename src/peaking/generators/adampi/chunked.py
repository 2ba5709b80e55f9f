"""The network plane by plane or in chunks of planes: the same result in a fraction of the memory.

On CUDA a chunk that does not fit is halved until it does, and that is said.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import torch
from jaxtyping import Float
from torch import Tensor

from peaking.errors import PeakingError
from peaking.generators.adampi.decoder import cumulative_masks
from peaking.generators.adampi.feature_mask import shares
from peaking.generators.adampi.network import AdaMpiNetwork, Layers, need_legal_size
from peaking.generators.adampi.plane_adjustment import per_plane
from peaking.options import Precision

_log = logging.getLogger("peaking.generators")

T = TypeVar("T")


@dataclass
class Chunks:
    """How many planes are worked on at once; goes down when memory does not do.

    Attributes:
        planes_at_once: At most this many.
    """

    planes_at_once: int

    def __post_init__(self) -> None:
        if self.planes_at_once < 1:
            raise ValueError(f"need planes_at_once >= 1, got {self.planes_at_once}")

    def of(self, num_planes: int) -> Iterator[slice]:
        """Cut planes into chunks."""
        for first in range(0, num_planes, self.planes_at_once):
            yield slice(first, min(first + self.planes_at_once, num_planes))

    def fitting(self, work: Callable[[], T]) -> T:
        """Do the work; where the graphics card has no room, again with half as many planes at once.

        Raises:
            PeakingError: Not even one plane fits.
        """
        while True:
            try:
                return work()
            except torch.cuda.OutOfMemoryError as error:
                if self.planes_at_once == 1:
                    raise PeakingError(
                        "the graphics card has no room for one plane at a time; make room there, "
                        "use fewer pixels (--pixels), or the processor (--device cpu)"
                    ) from error
                fewer = self.planes_at_once // 2
                _log.warning(
                    "the graphics card has no room for %d planes at once; goes on with %d",
                    self.planes_at_once,
                    fewer,
                )
                self.planes_at_once = fewer
            torch.cuda.empty_cache()


def forward_in_chunks(
    network: AdaMpiNetwork,
    rgb: Float[Tensor, "1 3 h w"],
    disparity: Float[Tensor, "1 1 h w"],
    num_planes: int,
    *,
    chunks: Chunks,
    precision: Precision = "float32",
) -> Layers:
    """Return what `network(rgb, disparity, num_planes)` does.

    Args:
        network: In evaluation mode, where `rgb` is.
        rgb: The picture, 0…1; sides are multiples of 128.
        disparity: Relative disparity, 0…1.
        num_planes: How many planes.
        chunks: How many planes at once.
        precision: Of convolutions and products; planes, shares and results are float32 always.

    Raises:
        ValueError: A side is not a multiple of 128.
    """
    need_legal_size(rgb)
    height, width = rgb.shape[-2:]
    planes = network.plane_disparities(rgb, disparity, num_planes)
    scores = rgb.new_empty((num_planes, height, width))
    layers = rgb.new_empty((num_planes, 4, height, width))
    with torch.autocast(rgb.device.type, getattr(torch, precision), enabled=precision != "float32"):
        for chunk in chunks.of(num_planes):
            scores[chunk] = network.fmn(per_plane(rgb, disparity, planes[chunk]))
        masks = cumulative_masks(shares(scores))
        features = network.encoder(rgb, disparity)
        neck = network.decoder.neck(features)
        for chunk in chunks.of(num_planes):
            layers[chunk] = network.decoder(neck, features, masks.of(chunk))
    return Layers(planes, layers)
