"""Every stage of the network: names and shapes, by hand, laws."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from peaking.generators.adampi.decoder import (
    MIN_DENSITY,
    Decoder,
    GatedConv,
    GatedConvBlock,
    Masks,
    colour_and_density,
    cumulative_masks,
    key_of,
    masked,
)
from peaking.generators.adampi.encoder import Encoder
from peaking.generators.adampi.feature_mask import FeatureMask, shares, upsample
from peaking.generators.adampi.network import AdaMpiNetwork, random_network
from peaking.generators.adampi.plane_adjustment import (
    PlaneAdjustment,
    ResBlock,
    SelfAttention,
    per_plane,
    start_disparities,
)

OFFICIAL = Path(__file__).with_name("adampi_state_dict.txt")


@pytest.fixture(autouse=True)
def _no_gradients() -> object:
    with torch.inference_mode():
        yield


@pytest.fixture(scope="module")
def network() -> AdaMpiNetwork:
    return random_network(1)


def official_entries() -> dict[str, tuple[tuple[int, ...], str]]:
    entries: dict[str, tuple[tuple[int, ...], str]] = {}
    for line in OFFICIAL.read_text(encoding="utf-8").splitlines():
        if found := re.fullmatch(r"([^#].*) (\([\d, ]*\)) (\w+)", line):
            entries[found[1]] = (ast.literal_eval(found[2]), found[3])
    return entries


def test_names_shapes_and_types_are_those_of_the_official_checkpoints(
    network: AdaMpiNetwork,
) -> None:
    ours = {
        name: (tuple(value.shape), str(value.dtype).removeprefix("torch."))
        for name, value in network.state_dict().items()
    }
    assert len(ours) == 400
    assert ours == official_entries()
    assert sum(parameter.numel() for parameter in network.parameters()) == 18_945_844


def test_keys_are_a_tuple_spelt_out() -> None:
    assert key_of("upconv", 4, 0) == "(-'-u-p-c-o-n-v-'-,- -4-,- -0-)"
    assert key_of("dispconv", 2) == "(-'-d-i-s-p-c-o-n-v-'-,- -2-)"


# Planes


def test_two_planes_start_at_thirds_of_the_range() -> None:
    expected = torch.tensor([1 - 0.999 / 3, 1 - 2 * 0.999 / 3])
    torch.testing.assert_close(start_disparities(2), expected)


def test_thirty_two_planes_start_as_the_reference_says() -> None:
    start = start_disparities(32)
    assert start[0].item() == pytest.approx(0.970, abs=5e-4)
    assert start[-1].item() == pytest.approx(0.031, abs=5e-4)


@pytest.mark.parametrize("num_planes", [-1, 0, 1])
def test_fewer_than_two_planes_are_refused(num_planes: int) -> None:
    with pytest.raises(ValueError, match="num_planes >= 2"):
        start_disparities(num_planes)


def test_planes_see_the_picture_and_their_own_disparity() -> None:
    rgb, disparity = torch.rand(1, 3, 4, 6), torch.rand(1, 1, 4, 6)
    seen = per_plane(rgb, disparity, torch.tensor([0.9, 0.1]))
    assert seen.shape == (2, 5, 4, 6)
    assert torch.equal(seen[1, :3], rgb[0])
    assert torch.equal(seen[0, 3], disparity[0, 0])
    assert torch.equal(seen[:, 4, 2, 3], torch.tensor([0.9, 0.1]))


def test_a_residual_block_normalises_after_the_relu() -> None:
    block = ResBlock(1, 1).eval()
    for conv in (block.conv1, block.conv2):
        conv.weight.zero_()
        conv.weight[0, 0, 1, 1] = 1.0
        assert conv.bias is not None
        conv.bias.zero_()
    block.conv3.weight.fill_(2.0)
    assert block.conv3.bias is not None
    block.conv3.bias.zero_()
    assert block.bn.running_mean is not None
    block.bn.running_mean.fill_(0.5)
    x = torch.tensor([[[[1.0, -1.0]]]])
    # 1: 2·1 + (1 - 0.5); -1: 2·(-1) + (0 - 0.5), which the last relu cuts. √(1+eps) is 1.000005.
    torch.testing.assert_close(block(x), torch.tensor([[[[2.5, 0.0]]]]), atol=1e-5, rtol=0)


def test_attention_without_questions_is_the_mean_of_values() -> None:
    attention = SelfAttention()
    for head in range(4):
        for linears in (attention.wQs, attention.wKs, attention.wVs):
            linear = linears[head]
            assert isinstance(linear, torch.nn.Linear)
            linear.weight.zero_()
            linear.bias.zero_()
        value = attention.wVs[head]
        assert isinstance(value, torch.nn.Linear)
        value.weight[:, 32 * head : 32 * head + 32] = torch.eye(32)
    attention.fusion.weight.copy_(torch.eye(128))
    attention.fusion.bias.zero_()
    x = torch.rand(3, 128)
    torch.testing.assert_close(attention(x), x.mean(dim=0).expand(3, -1))


def test_attention_does_not_care_about_the_order_of_planes() -> None:
    torch.manual_seed(2)
    attention, x = SelfAttention(), torch.rand(5, 128)
    order = torch.tensor([3, 0, 4, 1, 2])
    torch.testing.assert_close(attention(x[order]), attention(x)[order])


def test_without_a_last_layer_planes_stay_where_they_start() -> None:
    net = PlaneAdjustment().eval()
    net.to_disp.linear.weight.zero_()
    net.to_disp.linear.bias.fill_(0.8)
    rgb, disparity = torch.rand(1, 3, 128, 128), torch.rand(1, 1, 128, 128)
    torch.testing.assert_close(net(rgb, disparity, 4), start_disparities(4) + 0.2)


def test_planes_are_clamped_to_the_range_of_the_training() -> None:
    net = random_network(1)
    net.dpn.to_disp.linear.bias.fill_(99.0)
    pictures = torch.rand(1, 3, 128, 128), torch.rand(1, 1, 128, 128)
    assert net.plane_disparities(*pictures, 4).tolist() == [1.0] * 4
    net.dpn.to_disp.linear.bias.fill_(-99.0)
    torch.testing.assert_close(net.plane_disparities(*pictures, 4), torch.full((4,), 0.001))


# Masks


def test_shares_are_a_softmax_over_planes() -> None:
    scores = torch.tensor([0.0, 3.0]).log1p()[:, None, None]  # ln 1 and ln 4
    torch.testing.assert_close(shares(scores), torch.tensor([0.2, 0.8])[:, None, None])


@settings(max_examples=20)
@given(st.integers(2, 6), st.integers(0, 1000))
def test_shares_add_up_to_one_and_follow_their_planes(num_planes: int, seed: int) -> None:
    scores = 9 * torch.randn(num_planes, 2, 3, generator=torch.Generator().manual_seed(seed))
    share = shares(scores)
    torch.testing.assert_close(share.sum(dim=0), torch.ones(2, 3))
    torch.testing.assert_close(shares(scores.flip(0)), share.flip(0))


def test_masks_add_up_from_near_to_far() -> None:
    masks = cumulative_masks(torch.tensor([0.5, 0.3, 0.2])[:, None, None])
    torch.testing.assert_close(masks.context[:, 0, 0], torch.tensor([1.0, 0.5, 0.2]))
    torch.testing.assert_close(masks.reached[:, 0, 0], torch.tensor([0.5, 0.8, 1.0]))


def test_feature_masks_have_the_size_of_the_picture() -> None:
    net = FeatureMask().eval()
    scores = net(torch.rand(2, 5, 16, 24))
    assert scores.shape == (2, 16, 24)
    assert scores.min() >= 0


def test_upsampling_goes_from_corner_to_corner() -> None:
    doubled = upsample(torch.tensor([[[[0.0, 3.0]]]]))
    torch.testing.assert_close(doubled[0, 0, 0], torch.tensor([0.0, 1.0, 2.0, 3.0]))


# Decoder


def test_features_are_masked_by_context_at_their_own_size() -> None:
    share = torch.tensor([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [1.0, 1.0]]])
    both = masked(torch.full((1, 2, 1, 1), 8.0), cumulative_masks(share))
    # The near plane sees all; the far one the three quarters that the near one does not hold.
    assert both[:, :, 0, 0].tolist() == [[8.0, 8.0, 1.0, 0.25], [6.0, 6.0, 0.75, 0.75]]


def test_a_gated_convolution_is_one_times_the_sigmoid_of_the_other() -> None:
    gated = GatedConv(1, 1)
    for conv, centre, bias in ((gated.conv2d, 3.0, 1.0), (gated.mask_conv2d, 0.0, 4.0)):
        conv.weight.zero_()
        conv.weight[0, 0, 1, 1] = centre
        assert conv.bias is not None
        conv.bias.fill_(torch.tensor(bias).log().item())
    x = torch.tensor([[[[1.0, 2.0], [0.0, -1.0]]]])
    torch.testing.assert_close(gated(x), 3.0 * x * 0.8)  # sigmoid(ln 4) = 4/5


def test_a_gated_convolution_reflects_at_the_rim() -> None:
    gated = GatedConv(1, 1)
    gated.conv2d.weight.zero_()
    gated.conv2d.weight[0, 0, 1] = torch.tensor([1.0, 0.0, 0.0])  # takes the left neighbour
    assert gated.conv2d.bias is not None
    gated.conv2d.bias.zero_()
    gated.mask_conv2d.weight.zero_()
    assert gated.mask_conv2d.bias is not None
    gated.mask_conv2d.bias.fill_(99.0)  # open
    x = torch.tensor([[[[5.0, 7.0, 9.0]] * 2]])
    assert gated(x)[0, 0, 0].tolist() == [7.0, 5.0, 7.0]


def test_a_block_normalises_and_bends() -> None:
    block = GatedConvBlock(1, 1).eval()
    for conv, bias in ((block.gated_conv.conv2d, -1.0), (block.gated_conv.mask_conv2d, 99.0)):
        conv.weight.zero_()
        assert conv.bias is not None
        conv.bias.fill_(bias)
    bent = block(torch.zeros(1, 1, 2, 2))
    torch.testing.assert_close(bent, torch.full((1, 1, 2, 2), -0.6321), atol=1e-4, rtol=0)


def test_density_grows_with_what_is_reached_and_is_never_zero() -> None:
    raw = torch.tensor([[0.0, 0.0, 0.0, 2.0], [0.0, 0.0, 0.0, -2.0]])[:, :, None, None]
    masks = Masks(*torch.full((3, 2, 1, 1), 0.25))
    made = colour_and_density(raw, masks)
    assert made[:, :3].unique().tolist() == [0.5]
    torch.testing.assert_close(made[:, 3, 0, 0], torch.tensor([0.5 + MIN_DENSITY, MIN_DENSITY]))


def test_every_size_of_feature_is_half_of_the_one_before() -> None:
    features = Encoder().eval()(torch.rand(1, 3, 64, 96), torch.rand(1, 1, 64, 96))
    assert [tuple(x.shape[1:]) for x in features] == [
        (64, 32, 48),
        (64, 16, 24),
        (128, 8, 12),
        (256, 4, 6),
        (512, 2, 3),
    ]


def test_the_encoder_normalises_colours_as_imagenet_does() -> None:
    encoder = Encoder().eval()
    encoder.encoder.conv1.weight.zero_()
    encoder.encoder.conv1.weight[:3, :3, 3, 3] = torch.eye(3)
    rgb = torch.tensor([0.485, 0.456 + 0.224, 0.406 + 2 * 0.225]).view(1, 3, 1, 1)
    seen = encoder(rgb.expand(1, 3, 64, 64), torch.zeros(1, 1, 64, 64)).conv1
    torch.testing.assert_close(seen[0, :3, 0, 0], torch.tensor([0.0, 1.0, 2.0]), atol=2e-5, rtol=0)


def test_the_neck_looks_from_farther_away_and_comes_back() -> None:
    features = Encoder().eval()(torch.rand(1, 3, 128, 256), torch.rand(1, 1, 128, 256))
    assert Decoder().eval().neck(features).shape == (1, 512, 4, 8)


# All of it


def test_only_the_first_scale_is_used(network: AdaMpiNetwork) -> None:
    pictures = torch.rand(1, 3, 128, 128), torch.rand(1, 1, 128, 128)
    before = network(*pictures, 2)
    other = AdaMpiNetwork().eval()
    other.load_state_dict(network.state_dict())
    for scale in (1, 2, 3):
        head = other.decoder.convs[key_of("dispconv", scale)]
        assert isinstance(head, GatedConv)
        head.conv2d.weight.zero_()
    other.encoder.encoder.fc.weight.zero_()
    assert torch.equal(other(*pictures, 2).colour_density, before.colour_density)


def test_colours_and_densities_are_in_range(network: AdaMpiNetwork) -> None:
    made = network(torch.rand(1, 3, 128, 256), torch.rand(1, 1, 128, 256), 3)
    assert made.colour_density.shape == (3, 4, 128, 256)
    assert made.colour_density[:, :3].min() >= 0
    assert made.colour_density[:, :3].max() <= 1
    assert made.colour_density[:, 3].min() >= MIN_DENSITY


def test_sides_that_are_no_multiples_are_refused(network: AdaMpiNetwork) -> None:
    with pytest.raises(ValueError, match="multiples of 128, got 294x639"):
        network(torch.rand(1, 3, 639, 294), torch.rand(1, 1, 639, 294), 2)


def test_drawing_weights_leaves_the_generator_of_others_alone() -> None:
    torch.manual_seed(5)
    state = torch.random.get_rng_state()
    first, second = random_network(3), random_network(3)
    assert torch.equal(torch.random.get_rng_state(), state)
    for a, b in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(a, b)
