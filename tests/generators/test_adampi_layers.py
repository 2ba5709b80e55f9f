"""From what the network says to tiles: by hand, laws, and what rounding costs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float64
from torch.nn import functional

from peaking.generators.adampi.generator import ALPHA_CUT
from peaking.generators.adampi.layers import (
    LAST_DELTA,
    Planes,
    in_order,
    opacity,
    planes_of,
    ray_lengths,
    rounded,
    to_mpi,
    transmittance,
    with_picture,
)
from peaking.generators.adampi.network import Layers, random_network
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.rendering import plane_homographies, render

MIN_PSNR_DB = 45.0
"""Of the sparse MPI against the dense layers in floating point. Least measured: 57.8 dB."""

CAMERA = Camera(Pinhole(96, 80, 90.0, 90.0, 48.0, 40.0), Rigid.identity())


def layers_of(disparities: list[float]) -> Layers:
    """Return planes of 1×1 pixels that have their disparity as red."""
    values = torch.tensor(disparities)
    colour_density = torch.zeros(len(disparities), 4, 1, 1)
    colour_density[:, 0, 0, 0] = values
    return Layers(values, colour_density)


def test_planes_are_sorted_together_with_what_is_on_them() -> None:
    ordered = in_order(layers_of([0.5, 0.9, 0.1]))
    assert ordered.disparities.tolist() == pytest.approx([0.1, 0.5, 0.9], abs=1e-4)
    assert ordered.colour_density[:, 0, 0, 0].tolist() == pytest.approx([0.1, 0.5, 0.9])


@given(st.lists(st.sampled_from([0.001, 0.3, 0.30001, 1.0]), min_size=2, max_size=9))
def test_planes_on_one_spot_are_moved_apart(disparities: list[float]) -> None:
    ordered = in_order(layers_of(disparities)).disparities.double()
    assert (ordered.diff() > 0).all()
    assert (ordered - torch.tensor(sorted(disparities))).abs().max() < 2e-4


def test_rays_are_longer_away_from_the_middle() -> None:
    lengths = ray_lengths(Pinhole(2, 1, 0.5, 0.5, 0.5, 0.5))
    np.testing.assert_allclose(lengths, [[1.0, 5**0.5]])  # x = 0 and x = 2


def test_opacity_by_hand() -> None:
    disparities = torch.tensor([0.25, 0.5, 1.0])  # distances 4, 2, 1
    density = torch.tensor([1e-3, 0.5, 2.0])[:, None, None]
    alpha = opacity(disparities, density.expand(3, 1, 2), torch.tensor([[1.0, 1.5]]))
    expected = 1 - np.exp(
        [[-1e-3 * LAST_DELTA, -1e-3 * LAST_DELTA], [-0.5 * 2, -0.5 * 3], [-2 * 1, -2 * 1.5]]
    )
    np.testing.assert_allclose(alpha[:, 0], expected, rtol=1e-6)


def test_an_empty_plane_is_transparent() -> None:
    alpha = opacity(torch.tensor([0.5, 1.0]), torch.zeros(2, 1, 1), torch.ones(1, 1))
    assert alpha.max() == 0


def test_transmittance_is_the_product_of_what_nearer_planes_let_through() -> None:
    alpha = torch.tensor([0.7, 0.5, 0.2])[:, None, None]  # farthest first
    through = transmittance(alpha)[:, 0, 0]
    torch.testing.assert_close(through, torch.tensor([0.4, 0.8, 1.0]))


def test_the_picture_is_on_every_plane_where_it_is_seen() -> None:
    colour = torch.full((2, 3, 1, 1), 0.5)
    alpha = torch.tensor([1.0, 0.25])[:, None, None]
    blended = with_picture(colour, alpha, torch.ones(3, 1, 1))
    assert blended[:, 0, 0, 0].tolist() == [0.75 * 1 + 0.25 * 0.5, 1.0]


def test_opacity_does_not_change_when_planes_become_metric() -> None:
    planes = drawn_planes(0)
    near, far = (
        to_mpi(planes, CAMERA, disparity_range_per_m=r, alpha_cut=0.0, generator="test")
        for r in ((0.5, 2.0), (0.05, 0.2))
    )
    np.testing.assert_array_equal(near.texels, far.texels)
    np.testing.assert_allclose(far.plane_depths_m, 10 * near.plane_depths_m)


def test_planes_become_metric_by_scale_and_shift() -> None:
    planes = Planes(torch.tensor([0.0, 0.5, 1.0]), torch.ones(3, 3, 80, 96), torch.ones(3, 80, 96))
    mpi = to_mpi(planes, CAMERA, disparity_range_per_m=(0.5, 2.0), alpha_cut=0.0, generator="test")
    np.testing.assert_allclose(mpi.plane_depths_m, [2.0, 0.8, 0.5])


# Rounding


def composite(alpha: torch.Tensor, colour: torch.Tensor) -> torch.Tensor:
    return (transmittance(alpha)[:, None] * alpha[:, None] * colour).sum(dim=0)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.sampled_from([0.0, ALPHA_CUT, 0.05]))
def test_what_is_cut_off_a_plane_is_on_the_next(seed: int, cut: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    alpha = torch.rand(12, 4, 5, generator=generator) ** 4
    alpha[0] = 1.0
    planes = Planes(torch.linspace(0.1, 1, 12), torch.rand(12, 3, 4, 5, generator=generator), alpha)
    texels = rounded(planes, alpha_cut=cut).float() / 255
    assert ((texels[..., 3] == 0) | (texels[..., 3] > cut - 1 / 500)).all()
    assert (texels[..., :3] <= texels[..., 3:]).all()
    through = transmittance(texels[..., 3])
    got = (through[..., None] * texels[..., :3]).sum(dim=0).permute(2, 0, 1)
    # A half step of rounding per plane that is left, of what still shines through.
    assert (got - composite(alpha, planes.colour)).abs().max() < 0.02
    assert (1 - (1 - texels[..., 3]).prod(dim=0)).min() > 0.98


def test_haze_is_kept_though_each_plane_of_it_rounds_to_nothing() -> None:
    alpha = torch.full((32, 1, 1), 0.0015)  # 0.38 of a step of 8 bits
    planes = Planes(torch.linspace(0.1, 1, 32), torch.ones(32, 3, 1, 1), alpha)
    texels = rounded(planes, alpha_cut=ALPHA_CUT)[:, 0, 0, 3]
    kept = 1 - (1 - texels.double() / 255).prod()
    assert kept.item() == pytest.approx(1 - (1 - 0.0015) ** 32, abs=ALPHA_CUT)
    assert (texels > 0).sum() <= 3


def test_hidden_texels_stay_as_they_are() -> None:
    alpha = torch.tensor([1.0, 0.6, 1.0])[:, None, None]
    colour = torch.tensor([0.2, 0.4, 0.9]).view(3, 1, 1, 1).expand(3, 3, 1, 1)
    texels = rounded(Planes(torch.tensor([0.1, 0.5, 1.0]), colour, alpha), alpha_cut=ALPHA_CUT)
    assert texels[:, 0, 0, 3].tolist() == [255, 153, 255]
    assert texels[:, 0, 0, 0].tolist() == [51, round(0.4 * 153), 230]


def drawn_planes(seed: int) -> Planes:
    """Return soft blobs of many opacities on eight planes, and a background."""
    generator = torch.Generator().manual_seed(seed)
    coarse = torch.rand(8, 4, 6, 7, generator=generator)
    smooth = functional.interpolate(coarse, size=(80, 96), mode="bicubic").clamp(0, 1)
    alpha = (4 * smooth[:, 3] - 2).clamp(0, 1)
    alpha[0] = 1.0
    return Planes(torch.linspace(0.05, 1.0, 8), smooth[:, :3].contiguous(), alpha)


@cache
def network_planes() -> Planes:
    """Return what a network with random weights says of a drawn picture."""
    generator = torch.Generator().manual_seed(7)
    coarse = torch.rand(1, 4, 5, 6, generator=generator)
    picture = functional.interpolate(coarse, size=(128, 128), mode="bilinear")
    with torch.inference_mode():
        layers = random_network(1)(picture[:, :3], picture[:, 3:], 16)
        cropped = Layers(layers.disparities, layers.colour_density[..., :80, :96])
        return planes_of(cropped, picture[0, :3, :80, :96], CAMERA.pinhole)


def dense_view(planes: Planes, mpi: Mpi, camera: Camera) -> Float64[np.ndarray, "h w 3"]:
    """Render layers in floating point, without cutting and rounding."""
    homographies, _ = plane_homographies(mpi, camera)
    width, height = CAMERA.pinhole.size_px
    size = torch.tensor([width, height], dtype=torch.float64)
    centres = np.dstack([camera.pinhole.pixel_centers(), np.ones((height, width))])
    view = torch.zeros(3, height, width, dtype=torch.float64)
    for alpha, colour, homography in zip(planes.alpha, planes.colour, homographies, strict=True):
        warped = torch.from_numpy(centres @ homography.T)
        grid = warped[..., :2] / warped[..., 2:] / size * 2 - 1
        layer = torch.cat([colour * alpha, alpha[None]])[None].double()
        seen = functional.grid_sample(layer, grid[None], align_corners=False)[0]
        view = seen[:3] + (1 - seen[3]) * view
    return view.permute(1, 2, 0).numpy()


@pytest.mark.parametrize("made_by", ["network", "drawn"])
@pytest.mark.parametrize("moved_m", [0.0, 0.05])
def test_cutting_and_rounding_cost_little(made_by: str, moved_m: float) -> None:
    planes = network_planes() if made_by == "network" else drawn_planes(3)
    mpi = to_mpi(
        planes,
        CAMERA,
        disparity_range_per_m=(0.3, 1.5),
        alpha_cut=ALPHA_CUT,
        generator="test",
    )
    camera = Camera(CAMERA.pinhole, Rigid(np.eye(3), np.array([moved_m, moved_m / 2, 0.0])))
    expected = dense_view(planes, mpi, camera)
    got = render(mpi, camera, backend="numpy").rgba[..., :3]
    psnr_db = -10 * np.log10(np.mean((got - expected) ** 2))
    assert psnr_db > MIN_PSNR_DB
