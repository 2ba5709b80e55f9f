"""The feature mask network: which plane each pixel belongs to (AdaMPI, section 3.3).

A small U-Net looks at every plane; a softmax over planes makes shares of it.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional


class ConvBnRelu(nn.Module):
    """3×3 convolution, normalisation, relu."""

    def __init__(self, inputs: int, outputs: int, *, stride: int = 1) -> None:
        super().__init__()
        self.layer = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1),
            nn.BatchNorm2d(outputs),
            nn.ReLU(),
        )

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        """Apply them."""
        return self.layer(x)


class FeatureMask(nn.Module):
    """Each plane's view of the picture to a number per pixel."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = ConvBnRelu(5, 16)
        self.conv2 = ConvBnRelu(16, 32, stride=2)
        self.conv3 = ConvBnRelu(32, 64, stride=2)
        self.conv4 = ConvBnRelu(64, 128, stride=2)
        self.conv5 = ConvBnRelu(128, 128)
        self.conv6 = ConvBnRelu(128 + 64, 64)
        self.conv7 = ConvBnRelu(64 + 32, 32)
        self.conv8 = ConvBnRelu(32 + 16, 16)
        self.conv9 = ConvBnRelu(16, 1)

    def forward(self, x: Float[Tensor, "planes 5 h w"]) -> Float[Tensor, "planes h w"]:
        """Return scores ≥ 0; `shares` makes masks of those of all planes."""
        full = self.conv1(x)
        half = self.conv2(full)
        quarter = self.conv3(half)
        x = self.conv5(self.conv4(quarter))
        x = self.conv6(torch.cat([upsample(x), quarter], dim=1))
        x = self.conv7(torch.cat([upsample(x), half], dim=1))
        x = self.conv8(torch.cat([upsample(x), full], dim=1))
        return self.conv9(x)[:, 0]


def upsample(x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h2 w2"]:
    """Double the size, bilinearly, corner on corner."""
    return functional.interpolate(x, scale_factor=2, mode="bilinear", align_corners=True)


def shares(scores: Float[Tensor, "planes h w"]) -> Float[Tensor, "planes h w"]:
    """Return each plane's share of every pixel: ≥ 0, and 1 in sum over the planes."""
    return torch.softmax(scores, dim=0)
