"""The encoder: a ResNet-18 (He et al., CVPR 2016) that reads colour and disparity.

Names of parameters are torchvision's, as in the official checkpoints; the classifier `fc` is in
them, and is not used.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


class Features(NamedTuple):
    """What the encoder makes of a picture, finest first: 1/2, 1/4, 1/8, 1/16, 1/32 of its size."""

    conv1: Float[Tensor, "b 64 h2 w2"]
    block1: Float[Tensor, "b 64 h4 w4"]
    block2: Float[Tensor, "b 128 h8 w8"]
    block3: Float[Tensor, "b 256 h16 w16"]
    block4: Float[Tensor, "b 512 h32 w32"]


class BasicBlock(nn.Module):
    """Two 3×3 convolutions and a shortcut."""

    def __init__(self, inputs: int, outputs: int, *, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.downsample = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride=stride, bias=False), nn.BatchNorm2d(outputs)
            )

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        """Return relu(shortcut + residual)."""
        shortcut = x if self.downsample is None else self.downsample(x)
        x = functional.relu(self.bn1(self.conv1(x)))
        return functional.relu(shortcut + self.bn2(self.conv2(x)))


class ResNet18(nn.Module):
    """The layers, with torchvision's names."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(4, 64, 7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.layer1 = self._layer(64, 64, stride=1)
        self.layer2 = self._layer(64, 128, stride=2)
        self.layer3 = self._layer(128, 256, stride=2)
        self.layer4 = self._layer(256, 512, stride=2)
        self.fc = nn.Linear(512, 1000)

    @staticmethod
    def _layer(inputs: int, outputs: int, *, stride: int) -> nn.Sequential:
        return nn.Sequential(
            BasicBlock(inputs, outputs, stride=stride), BasicBlock(outputs, outputs, stride=1)
        )


class Encoder(nn.Module):
    """Colour (normalised as ImageNet is, here and nowhere else) and disparity to features."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = ResNet18()

    def forward(
        self, rgb: Float[Tensor, "b 3 h w"], disparity: Float[Tensor, "b 1 h w"]
    ) -> Features:
        """Return the features of five sizes."""
        net = self.encoder
        mean, std = rgb.new_tensor([IMAGENET_MEAN, IMAGENET_STD])[..., None, None]
        x = torch.cat([(rgb - mean) / std, disparity], dim=1)
        conv1 = functional.relu(net.bn1(net.conv1(x)))
        block1 = net.layer1(functional.max_pool2d(conv1, 3, stride=2, padding=1))
        block2 = net.layer2(block1)
        block3 = net.layer3(block2)
        return Features(conv1, block1, block2, block3, net.layer4(block3))
