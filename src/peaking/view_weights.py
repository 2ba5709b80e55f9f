"""Which captured views to render from, and how much each counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int

from peaking.geometry import Camera, seen_by

GRID = 5
"""Points per axis of the target picture that are asked whether another view sees them."""

MIN_OVERLAP = 0.05
"""Overlap at which a view counts as if it saw nothing."""

CLOSE_M = 0.002
"""Distances below this are all the same: it is what phones' tracking jitters by."""

CANDIDATES = 64
"""So many of the closest views are looked at, at least."""

RANGE = 1.3
"""How much farther than the farthest chosen view the weights reach zero, when none is left over."""


@dataclass(frozen=True)
class Neighbour:
    """A captured view that takes part in a rendering.

    Attributes:
        index: Which of the captured views.
        weight: Its share; the weights of all neighbours sum to 1.
        distance_m: From the target camera to where the view was taken.
    """

    index: int
    weight: float
    distance_m: float


def nearest_by_distance(
    cameras: Sequence[Camera], target: Camera, *, count: int = 4
) -> tuple[Neighbour, ...]:
    """Choose and weigh views as the paper does: K nearest, w ∝ exp(-l/γ), γ the largest of the K.

    Of views at the same distance the one captured first comes first. If all chosen views are at
    the target itself (γ = 0), they count the same.

    Raises:
        ValueError: There is no view, or `count` < 1.
    """
    distance_m = _distances_m(cameras, target, count)
    chosen = np.argsort(distance_m, kind="stable")[:count]
    l_m = distance_m[chosen]
    gamma_m = l_m.max()
    weights = np.exp(-l_m / gamma_m) if gamma_m > 0 else np.ones(len(chosen))
    return _neighbours(chosen, weights, distance_m)


def nearest_by_overlap(
    cameras: Sequence[Camera], target: Camera, scene_depth_m: float, *, count: int = 4
) -> tuple[Neighbour, ...]:
    """Choose and weigh views by distance and by how much of the target's picture they saw.

    The cost of a view is its distance divided by the overlap, the part of the target's picture
    that the view has seen too, if everything were at `scene_depth_m`. So a near view that looks
    elsewhere loses against a farther one that looks the same way. The weights are those of
    unstructured lumigraphs (Buehler et al. 2001), w ∝ (1/cost)(1 - cost/limit) with the cost of
    the best view left out as the limit: the view at the target itself takes all, and a view fades
    out before another takes its place, so nothing jumps.

    Args:
        cameras: Where the views were taken.
        target: The camera to render for.
        scene_depth_m: A typical depth of the scene, such as the median plane of the nearest view.
        count: How many to choose, at most.

    Raises:
        ValueError: There is no view, or `count` < 1, or `scene_depth_m` is not > 0.
    """
    distance_m = _distances_m(cameras, target, count)
    # Only the closest are asked for their overlap: keeps long sessions quick.
    candidates = np.argsort(distance_m, kind="stable")[: max(CANDIDATES, 8 * count)]
    cost_m = overlap_costs_m([cameras[int(i)] for i in candidates], target, scene_depth_m)
    best, weights = fading_weights(cost_m, count)
    return _neighbours(candidates[best], weights, distance_m)


def overlap_costs_m(
    views: Sequence[Camera], target: Camera, scene_depth_m: float
) -> Float64[np.ndarray, "views"]:
    """Return the distance of each view from the target, divided by their overlap, in metres.

    Raises:
        ValueError: `scene_depth_m` is not > 0.
    """
    if not scene_depth_m > 0:
        raise ValueError(f"need scene_depth_m > 0, got {scene_depth_m}")
    positions_m = np.array([view.position_m for view in views])
    distance_m = np.linalg.norm(positions_m - target.position_m, axis=1)
    return costs_m(distance_m, overlap_shares(views, target, scene_depth_m))


def costs_m(
    distance_m: Float64[np.ndarray, "n"], overlap: Float64[np.ndarray, "n"]
) -> Float64[np.ndarray, "n"]:
    """Return distances divided by overlaps, both kept away from 0."""
    return (distance_m + CLOSE_M) / np.maximum(overlap, MIN_OVERLAP)


def fading_weights(
    cost_m: Float64[np.ndarray, "views"], count: int
) -> tuple[Int[np.ndarray, "k"], Float64[np.ndarray, "k"]]:
    """Return which views cost least, best first, and weights that fade out before they change."""
    order = np.argsort(cost_m, kind="stable")
    best = order[:count]
    limit_m = cost_m[order[count]] if len(order) > count else RANGE * cost_m[best].max()
    weights = np.maximum(1.0 - cost_m[best] / limit_m, 1e-6) / cost_m[best]
    return best, weights / weights.sum()


def overlap_shares(
    views: Sequence[Camera], target: Camera, scene_depth_m: float
) -> Float64[np.ndarray, "views"]:
    """Return the part of the target's picture that each view saw, if all is at `scene_depth_m`."""
    return seen_by(views, overlap_points_m(target, scene_depth_m)).mean(axis=1)


def overlap_points_m(target: Camera, scene_depth_m: float) -> Float64[np.ndarray, "n 3"]:
    """Return a grid of points of the world, all in the target's picture at `scene_depth_m`."""
    width, height = target.pinhole.size_px
    steps = (np.arange(GRID) + 0.5) / GRID
    x, y = np.meshgrid(steps * width, steps * height)
    p_target = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    in_target_m = scene_depth_m * p_target @ target.pinhole.cam_from_px.T
    return target.world_from_cam.apply(in_target_m)


def _distances_m(
    cameras: Sequence[Camera], target: Camera, count: int
) -> Float64[np.ndarray, "views"]:
    if not cameras:
        raise ValueError("need at least one captured view, got none")
    if count < 1:
        raise ValueError(f"need count >= 1, got {count}")
    positions_m = np.array([camera.position_m for camera in cameras])
    return np.linalg.norm(positions_m - target.position_m, axis=1)


def _neighbours(
    chosen: np.ndarray, weights: np.ndarray, distance_m: np.ndarray
) -> tuple[Neighbour, ...]:
    shares = weights / weights.sum()
    return tuple(
        Neighbour(int(index), float(share), float(distance_m[index]))
        for index, share in zip(chosen, shares, strict=True)
    )
