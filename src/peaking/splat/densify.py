"""Where there are too few Gaussians, and where one is of no use (Kerbl et al. 2023, section 5)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from peaking.splat.gaussians import Parameters
from peaking.splat.optimiser import Moments
from peaking.splat.options import SplatOptions

SPLIT_FACTOR = 1.6
"""The halves of a Gaussian are smaller by this (Kerbl et al.)."""


def densify(
    moments: Moments,
    pulls: Float32[np.ndarray, "n"],
    options: SplatOptions,
    *,
    extent_m: float,
    rng: np.random.Generator,
) -> Moments:
    """Double or split what the loss pulls about, and drop what is transparent or broken."""
    p = moments.parameters
    opacity = 1 / (1 + np.exp(-p[:, 10].astype(np.float64)))
    sound = np.isfinite(p).all(axis=1) & (opacity > options.prune_opacity)
    hot = sound & (pulls > options.densify_gradient)
    room = max(0, options.max_count - int(sound.sum()))
    if hot.sum() > room:
        strongest = np.argsort(np.where(hot, -pulls, np.inf), kind="stable")[:room]
        hot = np.zeros_like(hot)
        hot[strongest] = True
    large = np.exp(p[:, 3:6]).max(axis=1) > options.split_size * extent_m
    split, kept = hot & large, sound & ~(hot & large)
    new = np.concatenate([p[hot & ~large], *(_half(p[split], rng) for _ in range(2))])
    fresh = np.zeros_like(new)
    return Moments(
        np.concatenate([p[kept], new]),
        np.concatenate([moments.first[kept], fresh]),
        np.concatenate([moments.second[kept], fresh]),
    )


def _half(rows: Parameters, rng: np.random.Generator) -> Parameters:
    """Return smaller Gaussians at places drawn from the given ones."""
    halves = rows.copy()
    length = np.linalg.norm(rows[:, 6:10], axis=1, keepdims=True)
    w, a, b, c = (rows[:, 6:10] / np.maximum(length, 1e-12)).T
    rotation = np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    away = rng.normal(size=(len(rows), 3)) * np.exp(rows[:, 3:6])
    halves[:, :3] += np.einsum("ijn,nj->ni", rotation, away).astype(np.float32)
    halves[:, 3:6] -= np.float32(np.log(SPLIT_FACTOR))
    return halves
