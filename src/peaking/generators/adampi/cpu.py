"""The network on a processor: the same numbers with a third of the arithmetic and little memory.

Three identities, none an approximation:

- **What planes share is computed once.** A plane sees features times its context, `f_c(x)·m(x)`. A
  convolution of it is `Σ_k m(x+k) · (Σ_c W_kc f_c(x+k))`, and what stands in brackets is the same
  for all planes: 9 products per output instead of 9 per channel. The first layer of the feature
  mask network is the same picture plus a constant for every plane.
- **A convolution of what was doubled in size** (nearest neighbour) is four convolutions of 2×2 taps
  of what was there before, one for each of the four pixels (Shi et al., 2016, read backwards).
  Reflection at the rim of the large one is repetition at the rim of the small one.
- **Normalisation** is folded into the weights, and the two halves of a gated convolution are one.

Planes go through one by one, so that blocks of memory are small enough to be used again instead of
being fetched from the system and zeroed each time: by itself half of the plain module's time. And
channels lie innermost, with which convolutions of few channels take half the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from peaking.generators.adampi.decoder import (
    WIDTHS,
    Decoder,
    GatedConv,
    GatedConvBlock,
    Masks,
    colour_and_density,
    cumulative_masks,
    key_of,
    pooled,
)
from peaking.generators.adampi.encoder import Features
from peaking.generators.adampi.feature_mask import ConvBnRelu, FeatureMask, shares, upsample
from peaking.generators.adampi.network import AdaMpiNetwork, Layers, need_legal_size

Weights = Float[Tensor, "out c kh kw"]
Bias = Float[Tensor, "out"]


@dataclass(frozen=True)
class GatedWeights:
    """A gated convolution with its normalisation: `elu(a(x)·sigmoid(m(x)) + shift)`.

    Attributes:
        weight: Of `a`, scaled, and of `m` below it.
        bias: The same.
        shift: What the normalisation adds; None for the head, which has neither it nor an ELU.
    """

    weight: Weights
    bias: Bias
    shift: Float[Tensor, "half 1 1"] | None

    @staticmethod
    def of(conv: GatedConv, norm: nn.BatchNorm2d | None) -> GatedWeights:
        """Fold a normalisation into a gated convolution."""
        scale, shift = torch.ones(conv.conv2d.out_channels), None
        if norm is not None:
            scale, shift = scale_and_shift(norm)
            shift = shift[:, None, None]
        a, m = conv.conv2d, conv.mask_conv2d
        assert a.bias is not None
        assert m.bias is not None
        return GatedWeights(
            channels_inner(torch.cat([a.weight * scale[:, None, None, None], m.weight])),
            torch.cat([a.bias * scale, m.bias]),
            shift,
        )

    def gate(self, both: Float[Tensor, "b out2 h w"]) -> Float[Tensor, "b out h w"]:
        """Join the halves; overwrites them."""
        a, m = both.chunk(2, dim=1)
        m.sigmoid_()
        if self.shift is None:
            return a * m
        return functional.elu_(torch.addcmul(self.shift, a, m))


def channels_inner(x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
    """Return the same numbers with channels innermost in memory."""
    return x.contiguous(memory_format=torch.channels_last)


def empty_like(x: Tensor, shape: tuple[int, int, int, int]) -> Float[Tensor, "b c h w"]:
    """Return room for numbers of the type of `x`, channels innermost."""
    return torch.empty(shape, dtype=x.dtype, memory_format=torch.channels_last)


def scale_and_shift(norm: nn.BatchNorm2d) -> tuple[Bias, Bias]:
    """Return what a normalisation multiplies by, and adds, when it is not being trained."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return scale, norm.bias - norm.running_mean * scale


def shared_taps(
    features: Float[Tensor, "1 c h w"], weight: Float[Tensor, "out c1 3 3"]
) -> Float[Tensor, "9 out h w"]:
    """Return what every tap of a convolution of `[features · m, m]` multiplies m with.

    Args:
        features: The same for all planes.
        weight: Of the convolution, over the features and one more channel for m itself.
    """
    channels = features.shape[1]
    height, width = features.shape[-2:]
    around = functional.pad(features, (1, 1, 1, 1), mode="reflect")
    taps = empty_like(features, (9, weight.shape[0], height, width))
    for k in range(9):
        row, col = divmod(k, 3)
        window = around[:, :, row : row + height, col : col + width]
        tap = weight[:, :, row, col, None, None]
        taps[k] = functional.conv2d(window, tap[:, :channels])[0] + tap[:, channels]
    return taps


def add_taps(
    result: Float[Tensor, "1 out h w"],
    taps: Float[Tensor, "9 out h w"],
    mask: Float[Tensor, "1 1 h w"],
) -> None:
    """Add to a result, in place, a convolution of features times a mask."""
    height, width = mask.shape[-2:]
    around = functional.pad(mask, (1, 1, 1, 1), mode="reflect")
    for k in range(9):
        row, col = divmod(k, 3)
        result.addcmul_(taps[k], around[:, :, row : row + height, col : col + width])


def doubling_taps(weight: Weights) -> Float[Tensor, "2 2 out c 2 2"]:
    """Return the four 2×2 kernels that do what 3×3 taps do after doubling (nearest neighbour)."""
    # Of even pixels tap -1 falls on the pixel before, 0 and +1 on its own; of odd ones -1 and 0 on
    # its own, +1 on the next.
    rows = (
        torch.stack([weight[:, :, 0], weight[:, :, 1] + weight[:, :, 2]], dim=2),
        torch.stack([weight[:, :, 0] + weight[:, :, 1], weight[:, :, 2]], dim=2),
    )
    return torch.stack(
        [
            torch.stack(
                [
                    torch.stack([row[..., 0], row[..., 1] + row[..., 2]], dim=3),
                    torch.stack([row[..., 0] + row[..., 1], row[..., 2]], dim=3),
                ]
            )
            for row in rows
        ]
    )


def conv_upsampled(
    x: Float[Tensor, "b c h w"], kernels: Float[Tensor, "2 2 out c 2 2"], bias: Bias
) -> Float[Tensor, "b out h2 w2"]:
    """Return a 3×3 convolution (reflected at the rim) of `x` doubled in size."""
    batch, _, height, width = x.shape
    around = functional.pad(x, (1, 1, 1, 1), mode="replicate")
    result = empty_like(x, (batch, len(bias), 2 * height, 2 * width))
    for row in (0, 1):
        for col in (0, 1):
            window = around[:, :, row : row + height + 1, col : col + width + 1]
            result[:, :, row::2, col::2] = functional.conv2d(window, kernels[row, col], bias)
    return result


class CpuDecoder:
    """The decoder for one picture: what its planes share is made once, then plane by plane."""

    def __init__(self, decoder: Decoder, features: Features) -> None:
        """Make what all planes of a picture share."""
        self._levels = len(WIDTHS)
        self._first: list[GatedWeights] = []
        self._second: list[GatedWeights] = []
        for i in range(self._levels):
            for j, into in ((0, self._first), (1, self._second)):
                block = decoder.convs[key_of("upconv", i, j)]
                assert isinstance(block, GatedConvBlock)
                into.append(GatedWeights.of(block.gated_conv, block.bn))
        head = decoder.convs[key_of("dispconv", 0)]
        assert isinstance(head, GatedConv)
        self._head = GatedWeights.of(head, None)
        neck = decoder.neck(features)
        self._neck_taps = shared_taps(neck, self._first[-1].weight[:, :-1])
        skips = (None, features.conv1, features.block1, features.block2, features.block3)
        self._taps = [
            None if skip is None else shared_taps(skip, second.weight[:, WIDTHS[i] : -1])
            for i, (skip, second) in enumerate(zip(skips, self._second, strict=True))
        ]
        self._doubling = [
            doubling_taps(second.weight[:, : WIDTHS[i]]) for i, second in enumerate(self._second)
        ]

    def __call__(self, masks: Masks) -> Float[Tensor, "1 4 h w"]:
        """Return colour and density of one plane."""
        first = self._first[-1]
        both = self._masked(self._neck_taps, masks, first.weight, first.bias)
        x = first.gate(both)
        for i in reversed(range(self._levels)):
            if i < self._levels - 1:
                first = self._first[i]
                x = first.gate(_reflected(x, first.weight, first.bias))
            second, taps = self._second[i], self._taps[i]
            both = conv_upsampled(x, self._doubling[i], second.bias)
            if taps is not None:
                both += self._masked(taps, masks, second.weight, None)
            x = second.gate(both)
        raw = self._head.gate(_reflected(x, self._head.weight, self._head.bias))
        return colour_and_density(raw, masks)

    @staticmethod
    def _masked(
        taps: Float[Tensor, "9 out h w"], masks: Masks, weight: Weights, bias: Bias | None
    ) -> Float[Tensor, "1 out h w"]:
        """Convolve `[features · context, context, share]`."""
        size = (taps.shape[2], taps.shape[3])
        result = _reflected(pooled(masks.share, size), weight[:, -1:], bias)
        add_taps(result, taps, pooled(masks.context, size))
        return result


class CpuFeatureMask:
    """The feature mask network, plane by plane."""

    def __init__(
        self,
        network: FeatureMask,
        rgb: Float[Tensor, "1 3 h w"],
        disparity: Float[Tensor, "1 1 h w"],
    ) -> None:
        """Make what all planes of a picture share."""
        blocks = [getattr(network, f"conv{n}") for n in range(1, 10)]
        folded = [_folded(block) for block in blocks]
        (weight, bias), self._rest = folded[0], folded[1:]
        picture = channels_inner(torch.cat([rgb, disparity], dim=1))
        self._picture = functional.conv2d(picture, weight[:, :4], bias, padding=1)
        ones = channels_inner(torch.ones_like(disparity))
        self._plane = functional.conv2d(ones, weight[:, 4:], padding=1)

    def __call__(self, plane: Float[Tensor, ""]) -> Float[Tensor, "h w"]:
        """Return the scores of one plane."""
        full = torch.addcmul(self._picture, self._plane, plane).relu_()
        half = self._layer(0, full, stride=2)
        quarter = self._layer(1, half, stride=2)
        x = self._layer(3, self._layer(2, quarter, stride=2))
        x = self._joined(4, x, quarter)
        x = self._joined(5, x, half)
        x = self._joined(6, x, full)
        return self._layer(7, x)[0, 0]

    def _layer(
        self, number: int, x: Float[Tensor, "b c h w"], *, stride: int = 1
    ) -> Float[Tensor, "b c2 h2 w2"]:
        weight, bias = self._rest[number]
        return functional.conv2d(x, weight, bias, stride=stride, padding=1).relu_()

    def _joined(
        self, number: int, x: Float[Tensor, "b c h w"], skip: Float[Tensor, "b c2 h2 w2"]
    ) -> Float[Tensor, "b c3 h2 w2"]:
        """Convolve `[upsample(x), skip]` without putting them side by side."""
        weight, bias = self._rest[number]
        channels = x.shape[1]
        result = functional.conv2d(upsample(x), weight[:, :channels], bias, padding=1)
        result += functional.conv2d(skip, weight[:, channels:], padding=1)
        return result.relu_()


def forward_on_cpu(
    network: AdaMpiNetwork,
    rgb: Float[Tensor, "1 3 h w"],
    disparity: Float[Tensor, "1 1 h w"],
    num_planes: int,
) -> Layers:
    """Return what `network(rgb, disparity, num_planes)` does, on the processor.

    Raises:
        ValueError: A side is not a multiple of 128.
    """
    need_legal_size(rgb)
    height, width = rgb.shape[-2:]
    planes = network.plane_disparities(rgb, disparity, num_planes)
    scores = rgb.new_empty((num_planes, height, width))
    score = CpuFeatureMask(network.fmn, rgb, disparity)
    for i in range(num_planes):
        scores[i] = score(planes[i])
    masks = cumulative_masks(shares(scores))
    decode = CpuDecoder(network.decoder, network.encoder(rgb, disparity))
    layers = rgb.new_empty((num_planes, 4, height, width))
    for i in range(num_planes):
        layers[i] = decode(masks.of(slice(i, i + 1)))[0]
    return Layers(planes, layers)


def _folded(block: ConvBnRelu) -> tuple[Weights, Bias]:
    """Return weights and bias of a convolution with its normalisation in them."""
    conv, norm = block.layer[0], block.layer[1]
    assert isinstance(conv, nn.Conv2d)
    assert isinstance(norm, nn.BatchNorm2d)
    assert conv.bias is not None
    scale, shift = scale_and_shift(norm)
    weight = channels_inner(conv.weight * scale[:, None, None, None])
    return weight, conv.bias * scale + shift


def _reflected(
    x: Float[Tensor, "b c h w"], weight: Weights, bias: Bias | None
) -> Float[Tensor, "b out h w"]:
    """Convolve 3×3, reflected at the rim."""
    return functional.conv2d(functional.pad(x, (1, 1, 1, 1), mode="reflect"), weight, bias)
