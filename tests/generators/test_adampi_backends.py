"""What is fast says what the reference says."""

from __future__ import annotations

import logging

import pytest
import torch
from torch import nn
from torch.nn import functional

from peaking.errors import PeakingError
from peaking.generators.adampi.chunked import Chunks, forward_in_chunks
from peaking.generators.adampi.cpu import (
    add_taps,
    conv_upsampled,
    doubling_taps,
    forward_on_cpu,
    shared_taps,
)
from peaking.generators.adampi.network import AdaMpiNetwork, random_network

SAME_IN_DOUBLE = 1e-10
"""Worst measured: 7e-13, of densities up to 11."""

SAME_IN_SINGLE = 2e-3
"""Worst measured: 1.5e-4, of densities up to 11."""

NUM_PLANES = 3


@pytest.fixture(autouse=True)
def _no_gradients() -> object:
    with torch.inference_mode():
        yield


@pytest.fixture(scope="module")
def network() -> AdaMpiNetwork:
    return random_network(1)


def drawn_pictures(height_px: int, width_px: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return colours and disparities."""
    generator = torch.Generator().manual_seed(4)
    drawn = torch.rand(1, 4, height_px, width_px, generator=generator)
    return drawn[:, :3], drawn[:, 3:]


@pytest.fixture(scope="module")
def pictures() -> tuple[torch.Tensor, torch.Tensor]:
    """Return the smallest that the network takes."""
    return drawn_pictures(128, 128)


@pytest.fixture(scope="module")
def expected(network: AdaMpiNetwork, pictures: tuple[torch.Tensor, torch.Tensor]) -> torch.Tensor:
    """The reference's answer in single precision."""
    with torch.inference_mode():
        return network(*pictures, NUM_PLANES)


def test_the_processor_s_way_is_the_reference_s(network: AdaMpiNetwork) -> None:
    double = AdaMpiNetwork().eval().double()
    double.load_state_dict(network.state_dict())
    rgb, disparity = (picture.double() for picture in drawn_pictures(128, 256))
    expected = double(rgb, disparity, NUM_PLANES)
    made = forward_on_cpu(double, rgb, disparity, NUM_PLANES)
    torch.testing.assert_close(made, expected, atol=SAME_IN_DOUBLE, rtol=0)


def test_in_single_precision_too(
    network: AdaMpiNetwork, pictures: tuple[torch.Tensor, torch.Tensor], expected: torch.Tensor
) -> None:
    made = forward_on_cpu(network, *pictures, NUM_PLANES)
    torch.testing.assert_close(made, expected, atol=SAME_IN_SINGLE, rtol=0)


@pytest.mark.parametrize("planes_at_once", [1, 2, 3, 9])
def test_chunks_do_not_change_the_result(
    network: AdaMpiNetwork,
    pictures: tuple[torch.Tensor, torch.Tensor],
    expected: torch.Tensor,
    planes_at_once: int,
) -> None:
    made = forward_in_chunks(network, *pictures, NUM_PLANES, chunks=Chunks(planes_at_once))
    torch.testing.assert_close(made, expected, atol=SAME_IN_SINGLE, rtol=0)


def test_a_convolution_of_what_was_doubled_in_size() -> None:
    x, bias = torch.rand(2, 3, 4, 5, dtype=torch.float64), torch.rand(6, dtype=torch.float64)
    conv = nn.Conv2d(3, 6, 3, padding=1, padding_mode="reflect").double()
    conv.bias = nn.Parameter(bias)
    expected = conv(functional.interpolate(x, scale_factor=2, mode="nearest"))
    made = conv_upsampled(x, doubling_taps(conv.weight), bias)
    torch.testing.assert_close(made, expected)


def test_taps_of_even_and_odd_pixels_by_hand() -> None:
    weight = torch.arange(1.0, 10.0).view(1, 1, 3, 3)  # 1 2 3 / 4 5 6 / 7 8 9
    taps = doubling_taps(weight)[:, :, 0, 0]
    assert taps[0, 0].tolist() == [[1, 2 + 3], [4 + 7, 5 + 6 + 8 + 9]]
    assert taps[1, 1].tolist() == [[1 + 2 + 4 + 5, 3 + 6], [7 + 8, 9]]


def test_a_convolution_of_features_times_a_mask() -> None:
    features, mask = (torch.rand(1, c, 5, 4, dtype=torch.float64) for c in (3, 1))
    conv = nn.Conv2d(4, 2, 3, padding=1, padding_mode="reflect", bias=False).double()
    expected = conv(torch.cat([features * mask, mask], dim=1))
    made = torch.zeros_like(expected)
    add_taps(made, shared_taps(features, conv.weight), mask)
    torch.testing.assert_close(made, expected)


# Memory


def test_chunks_cover_all_planes_once() -> None:
    assert [(c.start, c.stop) for c in Chunks(4).of(10)] == [(0, 4), (4, 8), (8, 10)]
    with pytest.raises(ValueError, match="planes_at_once >= 1"):
        Chunks(0)


def test_where_there_is_no_room_it_goes_on_in_smaller_chunks_and_says_so(
    caplog: pytest.LogCaptureFixture,
) -> None:
    chunks, tried = Chunks(32), list[int]()

    def work() -> str:
        tried.append(chunks.planes_at_once)
        if chunks.planes_at_once > 8:
            raise torch.cuda.OutOfMemoryError("no room")
        return "done"

    with caplog.at_level(logging.WARNING, "peaking.generators"):
        assert chunks.fitting(work) == "done"
        assert chunks.fitting(work) == "done"
    assert tried == [32, 16, 8, 8]
    assert "no room for 16 planes at once; goes on with 8" in caplog.text


def test_where_not_even_one_plane_fits_it_says_what_to_do() -> None:
    def work() -> None:
        raise torch.cuda.OutOfMemoryError("no room")

    with pytest.raises(PeakingError, match="--device cpu"):
        Chunks(4).fitting(work)
