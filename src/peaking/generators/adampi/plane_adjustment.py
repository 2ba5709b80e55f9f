"""The plane adjustment network: where the planes go (Han et al., SIGGRAPH 2022, section 3.2).

Every plane looks at the picture on its own, then all planes look at each other, and each moves from
where it started.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

NEAREST, FARTHEST = 1.0, 0.001
"""Ends of the range of disparities, neither of which is a plane at the start."""

WIDTHS = (8, 16, 32, 64, 128)
HEADS = 4
HEAD_WIDTH = 32
SHRINK = 4
"""The picture is looked at in a quarter of its size per axis."""


def start_disparities(num_planes: int) -> Float[Tensor, "planes"]:
    """Return where planes start: even in disparity within the range, nearest first.

    Raises:
        ValueError: Fewer than 2 planes.
    """
    if num_planes < 2:
        raise ValueError(f"need num_planes >= 2, got {num_planes}")
    return torch.linspace(NEAREST, FARTHEST, num_planes + 2)[1:-1]


def per_plane(
    rgb: Float[Tensor, "1 3 h w"],
    disparity: Float[Tensor, "1 1 h w"],
    planes: Float[Tensor, "planes"],
) -> Float[Tensor, "planes 5 h w"]:
    """Return what a network sees that looks at each plane: picture, disparity and the plane's."""
    height, width = rgb.shape[-2:]
    shared = torch.cat([rgb, disparity], dim=1).expand(len(planes), -1, -1, -1)
    own = planes.to(rgb.dtype)[:, None, None, None].expand(-1, 1, height, width)
    return torch.cat([shared, own], dim=1)


class ResBlock(nn.Module):
    """relu(1×1(x) + 3×3(BN(relu(3×3(x))))): here the normalisation comes after the relu."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1)
        self.conv3 = nn.Conv2d(inputs, outputs, 1)
        self.bn = nn.BatchNorm2d(outputs)

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h w"]:
        """Apply it."""
        return functional.relu(self.conv3(x) + self.conv2(self.bn(functional.relu(self.conv1(x)))))


class ContextEncoder(nn.Module):
    """Five blocks, each followed by halving; then the mean over the picture."""

    def __init__(self) -> None:
        super().__init__()
        inputs = (5, *WIDTHS)
        self.res_blocks = nn.ModuleList(
            ResBlock(i, o) for i, o in zip(inputs, WIDTHS, strict=False)
        )

    def forward(self, x: Float[Tensor, "planes 5 h w"]) -> Float[Tensor, "planes 128"]:
        """Return one vector per plane."""
        for block in self.res_blocks:
            x = functional.avg_pool2d(block(x), 2)
        return x.mean(dim=(2, 3))


class SelfAttention(nn.Module):
    """Attention of planes to planes (Vaswani et al., 2017), without a way around it."""

    def __init__(self) -> None:
        super().__init__()
        width = WIDTHS[-1]
        self.wQs = nn.ModuleList(nn.Linear(width, HEAD_WIDTH) for _ in range(HEADS))
        self.wKs = nn.ModuleList(nn.Linear(width, HEAD_WIDTH) for _ in range(HEADS))
        self.wVs = nn.ModuleList(nn.Linear(width, HEAD_WIDTH) for _ in range(HEADS))
        self.fusion = nn.Linear(HEADS * HEAD_WIDTH, width)

    def forward(self, x: Float[Tensor, "planes 128"]) -> Float[Tensor, "planes 128"]:
        """Return softmax(Q Kᵀ / √32) V of every head, joined."""
        heads: list[Tensor] = []
        for query, key, value in zip(self.wQs, self.wKs, self.wVs, strict=True):
            likeness = query(x) @ key(x).T / HEAD_WIDTH**0.5
            heads.append(torch.softmax(likeness, dim=-1) @ value(x))
        return self.fusion(torch.cat(heads, dim=-1))


class ToDisparity(nn.Module):
    """A linear layer to one number."""

    def __init__(self) -> None:
        super().__init__()
        self.linear = nn.Linear(32, 1)


class PlaneAdjustment(nn.Module):
    """Picture and disparity to the disparities of the planes."""

    def __init__(self) -> None:
        super().__init__()
        self.context_encoder = ContextEncoder()
        self.self_attention = SelfAttention()
        self.embed = nn.Sequential(nn.Linear(WIDTHS[-1], 32), nn.ReLU())
        self.to_disp = ToDisparity()

    def forward(
        self,
        rgb: Float[Tensor, "1 3 h w"],
        disparity: Float[Tensor, "1 1 h w"],
        num_planes: int,
    ) -> Float[Tensor, "planes"]:
        """Return disparities as the network says them: neither in the range nor in order."""
        height, width = rgb.shape[-2:]
        small = functional.interpolate(
            torch.cat([rgb, disparity], dim=1),
            size=(height // SHRINK, width // SHRINK),
            mode="bilinear",
            align_corners=True,
        )
        start = start_disparities(num_planes).to(rgb)
        context = self.context_encoder(per_plane(small[:, :3], small[:, 3:], start))
        moved = self.to_disp.linear(self.embed(self.self_attention(context)))[:, 0]
        return start + moved / num_planes
