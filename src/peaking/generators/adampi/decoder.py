"""The decoder: features and masks to colour and density of every plane (AdaMPI, section 3.3).

Every plane sees the features of what lies on it or behind it, and gated convolutions (Yu et al.,
ICCV 2019) fill in what nearer planes hide.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from peaking.generators.adampi.encoder import Features

MIN_DENSITY = 1e-4
WIDTHS = (12, 24, 48, 96, 192)
"""Channels of the blocks, finest first."""

SKIPS = (0, 64, 64, 128, 256)
"""Channels of the encoder that a block is given after its upsampling, finest first; 0 for none."""

NECK = 512
MASKS = 2
"""Maps that stand beside features: context and share."""


class Masks(NamedTuple):
    """What planes hold and hide, at every pixel.

    Attributes:
        share: Share of the plane.
        context: 1 minus the shares of all nearer planes: what the plane may look at.
        reached: Shares of this and all nearer planes.
    """

    share: Float[Tensor, "planes h w"]
    context: Float[Tensor, "planes h w"]
    reached: Float[Tensor, "planes h w"]

    def of(self, planes: slice) -> Masks:
        """Return those of some planes."""
        return Masks(self.share[planes], self.context[planes], self.reached[planes])


def cumulative_masks(share: Float[Tensor, "planes h w"]) -> Masks:
    """Add shares up from the nearest plane to the farthest."""
    reached = torch.cumsum(share, dim=0)
    return Masks(share, 1.0 - (reached - share), reached)


def pooled(
    masks: Float[Tensor, "planes h w"], size: tuple[int, int]
) -> Float[Tensor, "planes 1 h2 w2"]:
    """Return means of a mask at another size."""
    return functional.adaptive_avg_pool2d(masks[:, None], size)


def masked(features: Float[Tensor, "1 c h w"], masks: Masks) -> Float[Tensor, "planes c2 h w"]:
    """Return each plane's features: [features · context, context, share]."""
    size = (features.shape[2], features.shape[3])
    context = pooled(masks.context, size)
    return torch.cat([features * context, context, pooled(masks.share, size)], dim=1)


class GatedConv(nn.Module):
    """Convolution times sigmoid of another: Yu et al., equation 2, without the activation."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv2d = nn.Conv2d(inputs, outputs, 3, padding=1, padding_mode="reflect")
        self.mask_conv2d = nn.Conv2d(inputs, outputs, 3, padding=1, padding_mode="reflect")

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h w"]:
        """Apply it."""
        return self.conv2d(x) * torch.sigmoid(self.mask_conv2d(x))


class GatedConvBlock(nn.Module):
    """Gated convolution, normalisation, ELU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.gated_conv = GatedConv(inputs, outputs)
        self.bn = nn.BatchNorm2d(outputs)

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h w"]:
        """Apply them."""
        return functional.elu(self.bn(self.gated_conv(x)))


def key_of(*parts: object) -> str:
    """Return a name as the official checkpoints have it: a tuple's text, joined by '-'."""
    return "-".join(str(parts))


class Decoder(nn.Module):
    """Features and masks to colours and densities."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_down1 = _conv_bn(NECK, NECK, 1)
        self.conv_down2 = _conv_bn(NECK, NECK // 2, 3)
        self.conv_up1 = _conv_bn(NECK // 2, NECK // 2, 3)
        self.conv_up2 = _conv_bn(NECK // 2, NECK, 1)
        convs: dict[str, nn.Module] = {}
        inputs = NECK + MASKS
        for i in reversed(range(len(WIDTHS))):
            skip = SKIPS[i] + MASKS if SKIPS[i] else 0
            convs[key_of("upconv", i, 0)] = GatedConvBlock(inputs, WIDTHS[i])
            convs[key_of("upconv", i, 1)] = GatedConvBlock(WIDTHS[i] + skip, WIDTHS[i])
            inputs = WIDTHS[i]
        for scale in range(4):  # only scale 0 is used; the others are in the checkpoints
            convs[key_of("dispconv", scale)] = GatedConv(WIDTHS[scale], 4)
        self.convs = nn.ModuleDict(convs)

    def neck(self, features: Features) -> Float[Tensor, "b 512 h w"]:
        """Return the coarsest features after a look from farther away (to 1/128 and back)."""
        x = self.conv_down1(functional.max_pool2d(features.block4, 3, stride=2, padding=1))
        x = self.conv_down2(functional.max_pool2d(x, 3, stride=2, padding=1))
        x = self.conv_up1(functional.interpolate(x, scale_factor=2, mode="nearest"))
        return self.conv_up2(functional.interpolate(x, scale_factor=2, mode="nearest"))

    def forward(
        self, neck: Float[Tensor, "1 512 hn wn"], features: Features, masks: Masks
    ) -> Float[Tensor, "planes 4 h w"]:
        """Return colour (0…1) and density (≥ 1e-4) of some planes.

        Args:
            neck: What `neck` returned.
            features: Of the encoder.
            masks: Of these planes.
        """
        skips = (None, features.conv1, features.block1, features.block2, features.block3)
        x = masked(neck, masks)
        for i in reversed(range(len(WIDTHS))):
            x = self.convs[key_of("upconv", i, 0)](x)
            x = functional.interpolate(x, scale_factor=2, mode="nearest")
            skip = skips[i]
            if skip is not None:
                x = torch.cat([x, masked(skip, masks)], dim=1)
            x = self.convs[key_of("upconv", i, 1)](x)
        return colour_and_density(self.convs[key_of("dispconv", 0)](x), masks)


def colour_and_density(
    raw: Float[Tensor, "planes 4 h w"], masks: Masks
) -> Float[Tensor, "planes 4 h w"]:
    """Return sigmoid of the colours, and relu(density · reached) + 1e-4."""
    colour = torch.sigmoid(raw[:, :3])
    density = functional.relu(raw[:, 3:] * masks.reached[:, None]) + MIN_DENSITY
    return torch.cat([colour, density], dim=1)


def _conv_bn(inputs: int, outputs: int, size: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, padding=size // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.LeakyReLU(0.1),
    )
