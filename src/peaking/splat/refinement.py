"""Duplicate, split and prune Gaussians (Kerbl et al. 2023, section 5), in gsplat's words."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from peaking.splat.columns import LOG_SCALES, MEANS, OPACITY_LOGIT, QUATS
from peaking.splat.gaussians import Parameters
from peaking.splat.optimiser import AdamState
from peaking.splat.options import SplatOptions

SPLIT_FACTOR = 1.6
"""The halves of a split Gaussian are smaller by this (Kerbl et al.)."""


def refine(
    state: AdamState,
    mean_grad2d: Float32[np.ndarray, "n"],
    options: SplatOptions,
    *,
    scene_scale_m: float,
    rng: np.random.Generator,
) -> AdamState:
    """Grow Gaussians whose projected centre has a large gradient; prune useless ones.

    Small ones are duplicated, large ones split in two. Pruned are those that are nearly transparent
    or not finite. Where `max_gaussians` leaves no room for all, those with the largest gradients
    grow.
    """
    p = state.parameters
    opacity = 1 / (1 + np.exp(-p[:, OPACITY_LOGIT].astype(np.float64)))
    kept = np.isfinite(p).all(axis=1) & (opacity > options.prune_opacity)
    grown = kept & (mean_grad2d > options.grow_grad2d)
    room = max(0, options.max_gaussians - int(kept.sum()))
    if grown.sum() > room:
        strongest = np.argsort(np.where(grown, -mean_grad2d, np.inf), kind="stable")[:room]
        grown = np.zeros_like(grown)
        grown[strongest] = True
    large = np.exp(p[:, LOG_SCALES]).max(axis=1) > options.grow_scale3d * scene_scale_m
    duplicated, split = grown & ~large, grown & large
    unsplit = kept & ~split
    new = np.concatenate([p[duplicated], *(_half(p[split], rng) for _ in range(2))])
    no_moment = np.zeros_like(new)
    return AdamState(
        np.concatenate([p[unsplit], new]),
        np.concatenate([state.first_moment[unsplit], no_moment]),
        np.concatenate([state.second_moment[unsplit], no_moment]),
    )


def _half(rows: Parameters, rng: np.random.Generator) -> Parameters:
    """Return a smaller Gaussian for each given one, its centre drawn from it."""
    halves = rows.copy()
    length = np.linalg.norm(rows[:, QUATS], axis=1, keepdims=True)
    w, a, b, c = (rows[:, QUATS] / np.maximum(length, 1e-12)).T
    rotation = np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    offset = rng.normal(size=(len(rows), 3)) * np.exp(rows[:, LOG_SCALES])
    halves[:, MEANS] += np.einsum("ijn,nj->ni", rotation, offset).astype(np.float32)
    halves[:, LOG_SCALES] -= np.float32(np.log(SPLIT_FACTOR))
    return halves
