"""AdaMPI: one picture with disparity to a multi-plane image (Han et al., SIGGRAPH 2022).

Written from the paper and the names and shapes of the official checkpoints, so that these load; not
from the authors' code. Planes are nearest first here, as in the checkpoints' world; `layers.py`
turns them to our order.

    picture, disparity ──► plane adjustment ──► disparities of planes
            │                                          │
            ├─────────► feature mask ◄─────────────────┘  (softmax over planes)
            │                │
            └──► encoder ──► decoder ──► colour and density of every plane
"""

# PyTorch is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from peaking.generators.adampi.decoder import Decoder, GatedConv, cumulative_masks, key_of
from peaking.generators.adampi.encoder import Encoder
from peaking.generators.adampi.feature_mask import FeatureMask, shares
from peaking.generators.adampi.inputs import MULTIPLE_PX
from peaking.generators.adampi.plane_adjustment import (
    FARTHEST,
    NEAREST,
    PlaneAdjustment,
    per_plane,
)

RANDOM_GAIN = 1.2
"""Of random weights: the picture makes a difference, and rounding errors do not grow."""

RANDOM_CONTRAST = 8.0
"""Of the head of random networks, so that pixels and planes differ."""

OPAQUE = 4.0
"""Bias of the density of random networks: their planes are opaque together, as trained ones are."""


class Layers(NamedTuple):
    """What the network says.

    Attributes:
        disparities: Of the planes, 0…1, clamped but in no order.
        colour_density: Colour 0…1 and density ≥ 1e-4 per unit of 1/disparity.
    """

    disparities: Float[Tensor, "planes"]
    colour_density: Float[Tensor, "planes 4 h w"]


class AdaMpiNetwork(nn.Module):
    """The network, with the names of the official checkpoints.

    Its `forward` is the method; `chunked.py` gets the same with less memory, `cpu.py` in less time.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        self.decoder = Decoder()
        self.fmn = FeatureMask()
        self.dpn = PlaneAdjustment()

    def plane_disparities(
        self, rgb: Float[Tensor, "1 3 h w"], disparity: Float[Tensor, "1 1 h w"], num_planes: int
    ) -> Float[Tensor, "planes"]:
        """Return where the planes are, clamped to the range that the network was trained for."""
        return self.dpn(rgb, disparity, num_planes).clamp(FARTHEST, NEAREST)

    def forward(
        self, rgb: Float[Tensor, "1 3 h w"], disparity: Float[Tensor, "1 1 h w"], num_planes: int
    ) -> Layers:
        """Make all planes at once.

        Args:
            rgb: The picture, 0…1; sides are multiples of 128.
            disparity: Relative disparity, 0 (farthest) … 1 (nearest).
            num_planes: How many planes; the weights of a checkpoint are made for one number.

        Raises:
            ValueError: A side is not a multiple of 128.
        """
        need_legal_size(rgb)
        planes = self.plane_disparities(rgb, disparity, num_planes)
        masks = cumulative_masks(shares(self.fmn(per_plane(rgb, disparity, planes))))
        features = self.encoder(rgb, disparity)
        return Layers(planes, self.decoder(self.decoder.neck(features), features, masks))


def need_legal_size(rgb: Float[Tensor, "1 3 h w"]) -> None:
    """Refuse what the network cannot take.

    Raises:
        ValueError: A side is not a multiple of 128.
    """
    height, width = rgb.shape[-2:]
    if height % MULTIPLE_PX or width % MULTIPLE_PX:
        raise ValueError(f"need sides that are multiples of {MULTIPLE_PX}, got {width}x{height}")


def random_network(seed: int) -> AdaMpiNetwork:
    """Return a network whose weights and statistics are random: for tests and for timing.

    Takes and restores the state of PyTorch's own generator, from which its initialisers draw.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = AdaMpiNetwork().eval()
        for module in network.modules():
            if isinstance(module, nn.BatchNorm2d):
                assert module.running_mean is not None
                assert module.running_var is not None
                nn.init.uniform_(module.weight, 0.8, 1.2)
                nn.init.uniform_(module.bias, -0.2, 0.2)
                nn.init.uniform_(module.running_mean, -0.2, 0.2)
                nn.init.uniform_(module.running_var, 0.5, 1.0)
            elif isinstance(module, nn.Conv2d):
                nn.init.normal_(module.weight, 0.0, RANDOM_GAIN / module.weight[0].numel() ** 0.5)
        head = network.decoder.convs[key_of("dispconv", 0)]
        assert isinstance(head, GatedConv)
        with torch.no_grad():
            head.conv2d.weight *= RANDOM_CONTRAST
        for bias in (head.conv2d.bias, head.mask_conv2d.bias):
            assert bias is not None
            nn.init.constant_(bias[3], OPAQUE)
    return network
