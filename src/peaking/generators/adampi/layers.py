"""What the network says, to an `Mpi`: opacities, the picture itself, 8 bits, tiles.

    Layers ──► in order ──► opacity ──► picture blended in ──► cut and rounded ──► metric ──► Mpi

Opacity belongs to the network's own unit of length: it is made before planes become metric.
"""

# PyTorch is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float64, UInt8
from torch import Tensor

from peaking.generators.adampi.network import Layers
from peaking.geometry import Camera, Pinhole
from peaking.mpi import Mpi

LAST_DELTA = 1e3
"""Distance behind the last plane: what is left of the ray belongs to it."""

MIN_STEP = 1e-5
"""Of disparity between two planes; those that the network puts on one spot are moved apart."""


HIDDEN = 1 / 16
"""A texel that less of the light reaches is kept for when the camera moves, and is as it is."""


class Planes(NamedTuple):
    """Planes in the order of CONVENTIONS.md, farthest first.

    Attributes:
        disparities: Strictly ascending, in the network's unit.
        colour: Straight, 0…1.
        alpha: Opacity, 0…1.
    """

    disparities: Float[Tensor, "planes"]
    colour: Float[Tensor, "planes 3 h w"]
    alpha: Float[Tensor, "planes h w"]


def in_order(layers: Layers) -> Layers:
    """Sort planes together with what is on them, farthest first, and move equal ones apart."""
    disparities, order = torch.sort(layers.disparities, stable=True)
    steps = MIN_STEP * torch.arange(len(order), device=order.device)
    apart = torch.cummax(disparities - steps, dim=0).values + steps
    return Layers(apart, layers.colour_density[order])


def ray_lengths(pinhole: Pinhole) -> Float64[np.ndarray, "h w"]:
    """Return the length of each pixel's ray between two planes that are 1 apart."""
    return np.linalg.norm(pinhole.rays(), axis=-1)


def opacity(
    disparities: Float[Tensor, "planes"],
    density: Float[Tensor, "planes h w"],
    lengths: Float[Tensor, "h w"],
) -> Float[Tensor, "planes h w"]:
    """Return α = 1 - exp(-δσ), δ along the ray to the next plane behind, in the network's unit.

    Args:
        disparities: Strictly ascending (farthest first).
        density: σ.
        lengths: Of the rays, as `ray_lengths` gives them.
    """
    distances = 1.0 / disparities
    gaps = torch.cat([distances.new_tensor([LAST_DELTA]), distances[:-1] - distances[1:]])
    deltas = gaps[:, None, None] * lengths
    deltas[0] = LAST_DELTA
    return -torch.expm1(-deltas * density)


def transmittance(alpha: Float[Tensor, "planes h w"]) -> Float[Tensor, "planes h w"]:
    """Return how much of each plane is seen through all nearer ones: the product of 1 - α."""
    through = torch.flip(torch.cumprod(torch.flip(1.0 - alpha, [0]), dim=0), [0])
    return torch.cat([through[1:], torch.ones_like(through[:1])])


def with_picture(
    colour: Float[Tensor, "planes 3 h w"],
    alpha: Float[Tensor, "planes h w"],
    picture: Float[Tensor, "3 h w"],
) -> Float[Tensor, "planes 3 h w"]:
    """Give every plane the picture's own colour where it is seen: T·picture + (1 - T)·colour."""
    seen = transmittance(alpha)[:, None]
    return seen * picture + (1.0 - seen) * colour


def planes_of(layers: Layers, picture: Float[Tensor, "3 h w"], pinhole: Pinhole) -> Planes:
    """Return planes farthest first, with opacities and the picture blended in."""
    layers = in_order(layers)
    lengths = torch.from_numpy(ray_lengths(pinhole)).to(picture)
    alpha = opacity(layers.disparities, layers.colour_density[:, 3], lengths)
    colour = with_picture(layers.colour_density[:, :3], alpha, picture)
    return Planes(layers.disparities, colour, alpha)


def rounded(planes: Planes, *, alpha_cut: float) -> UInt8[Tensor, "planes h w 4"]:
    """Round to premultiplied 8 bits; what is fainter than `alpha_cut` joins the next plane behind.

    Networks leave a haze on all planes. Rounded away plane by plane its sum would be missing; so
    what rounding and cutting take from a plane is handed on, and from where the picture was taken
    the planes together stay as opaque, and of the same colour, as they were.

    Args:
        planes: What to round.
        alpha_cut: Opacity that a texel needs to be kept, 0…1.
    """
    num_planes, height, width = planes.alpha.shape
    result = torch.zeros(
        (num_planes, height, width, 4), dtype=torch.uint8, device=planes.alpha.device
    )
    left_before = torch.ones_like(planes.alpha[0])  # light that passes, without rounding
    left = left_before.clone()  # and with it
    owed = torch.zeros_like(planes.colour[0])
    for i in reversed(range(num_planes)):  # nearest first
        own, colour = planes.alpha[i], planes.alpha[i] * planes.colour[i]
        left_after = left_before * (1.0 - own)
        owed += left_before * colour
        seen = (left_before > HIDDEN) & (left > HIDDEN)
        share = left.clamp_min(HIDDEN)
        alpha = torch.where(seen, (1.0 - left_after / share).clamp(0.0, 1.0), own)
        colour = torch.where(seen, (owed / share).clamp_min(0.0), colour)
        alpha = torch.where(alpha < alpha_cut, 0.0, torch.round(255.0 * alpha))
        colour = torch.minimum(torch.round(255.0 * colour), alpha)
        owed -= left * colour / 255.0
        left = left * (1.0 - alpha / 255.0)
        left_before = left_after
        result[i, ..., :3] = colour.permute(1, 2, 0).to(torch.uint8)
        result[i, ..., 3] = alpha.to(torch.uint8)
    return result


def to_mpi(
    planes: Planes,
    camera: Camera,
    *,
    disparity_range_per_m: tuple[float, float],
    alpha_cut: float,
    generator: str,
) -> Mpi:
    """Return the sparse MPI, in metres.

    Args:
        planes: What the network says.
        camera: That took the picture.
        disparity_range_per_m: Disparities, in 1/m, that the network was shown as 0 and as 1.
        alpha_cut: As in `rounded`.
        generator: Who made it.
    """
    texels = rounded(planes, alpha_cut=alpha_cut).cpu().numpy()
    farthest, nearest = disparity_range_per_m
    disparities = planes.disparities.double().cpu().numpy()
    metric_per_m = farthest + (nearest - farthest) * disparities
    return Mpi.from_dense(texels, 1.0 / metric_per_m, camera, generator=generator)
