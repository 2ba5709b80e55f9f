"""Which views fill what the blended ones leave empty.

The four views that are blended are the best for the picture as a whole, and leave empty what none
of them saw: along its border, and behind things. Another view may have seen it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from peaking.geometry import Camera, seen_by
from peaking.view_weights import CANDIDATES, overlap_costs_m

BLOCKS = 42
"""Along its longer side the picture is cut into so many blocks, which are about square."""

OPAQUE = 0.9
"""Mean opacity below which a block is asked for."""

DEPTHS = (0.5, 0.75, 0.95)
"""How deep an empty block may be: these parts of the planes of the nearest view are nearer. What
was not seen lies behind what was, as a rule."""

MIN_GAIN = 0.002
"""A view that fills less than this part of the picture is left out."""


def choose_filling_views(
    cameras: Sequence[Camera],
    target: Camera,
    alpha: Float32[np.ndarray, "h w"],
    plane_depths_m: Float64[np.ndarray, "planes"],
    *,
    blended: Sequence[int],
    count: int,
) -> tuple[int, ...]:
    """Choose views that have probably seen what is empty, one after the other.

    Each is the view with the most of what is empty in its picture, at several depths, divided by
    how far away it is (1 + cost / depth of the scene, with the cost of `overlap_costs_m`).

    Args:
        cameras: Where the views were taken.
        target: The camera that is rendered for.
        alpha: Opacity of what the blended views show of it.
        plane_depths_m: Depths of the planes of the nearest view.
        blended: The views that are blended; they have shown what they can.
        count: How many to choose, at most.

    Returns:
        Numbers of views, in the order in which they go under what is there.
    """
    opacity = mean_opacity(alpha)
    rows, cols = np.nonzero(opacity < OPAQUE)
    empty = 1.0 - opacity[rows, cols]
    needed = MIN_GAIN * opacity.size
    if count < 1 or empty.sum() < needed:
        return ()
    left = set(range(len(cameras))) - set(blended)
    distance_m = np.linalg.norm(
        np.array([camera.position_m for camera in cameras]) - target.position_m, axis=1
    )
    near = [int(k) for k in np.argsort(distance_m, kind="stable") if int(k) in left][:CANDIDATES]
    if not near:
        return ()
    candidates = [cameras[k] for k in near]
    depth_m = float(np.median(plane_depths_m))
    closeness = 1.0 / (1.0 + overlap_costs_m(candidates, target, depth_m) / depth_m)
    xy_px = (np.stack([cols, rows], axis=-1) + 0.5) * target.pinhole.size_px / opacity.shape[::-1]
    sees = _seen_shares(candidates, target, xy_px, plane_depths_m)
    chosen: list[int] = []
    while len(chosen) < count:
        gains = sees @ empty
        best = int(np.argmax(gains * closeness))
        if gains[best] < needed:
            break
        chosen.append(near[best])
        empty = empty * (1.0 - sees[best])
    return tuple(chosen)


def mean_opacity(alpha: Float32[np.ndarray, "h w"]) -> Float64[np.ndarray, "rows cols"]:
    """Return the mean opacity of every block: from pixel `k size // blocks` to the next one's."""
    height, width = alpha.shape
    longest = max(height, width)
    rows, cols = (
        min(side, max(1, (BLOCKS * side + longest // 2) // longest)) for side in (height, width)
    )
    top, left = _cuts(height, rows), _cuts(width, cols)
    sums = np.add.reduceat(np.add.reduceat(alpha, top[:-1], axis=0), left[:-1], axis=1)
    return sums / (np.diff(top)[:, None] * np.diff(left))


def _cuts(size_px: int, blocks: int) -> Int64[np.ndarray, "cuts"]:
    return np.array([k * size_px // blocks for k in range(blocks + 1)])


def _seen_shares(
    candidates: Sequence[Camera],
    target: Camera,
    xy_px: Float64[np.ndarray, "blocks 2"],
    plane_depths_m: Float64[np.ndarray, "planes"],
) -> Float64[np.ndarray, "views blocks"]:
    """Return at how many of the depths each view has the blocks' centres in its picture."""
    rays = np.concatenate([xy_px, np.ones((len(xy_px), 1))], axis=1) @ target.pinhole.cam_from_px.T
    seen: list[Bool[np.ndarray, "views blocks"]] = [
        seen_by(candidates, target.world_from_cam.apply(rays * depth_m))
        for depth_m in np.quantile(plane_depths_m, DEPTHS)
    ]
    return np.mean(seen, axis=0)
