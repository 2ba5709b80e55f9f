"""Blend the renderings of several MPIs into one view."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Float32

from peaking.options import Opacity
from peaking.rendering import Backend, Rendering


def blend(
    rgba: Float32[np.ndarray, "views h w 4"],
    depth_m: Float32[np.ndarray, "views h w"],
    weights: Sequence[float],
    *,
    opacity: Opacity = "seen",
    backend: Backend = "numba",
) -> Rendering:
    """Blend renderings of the same camera (paper, section 3.1).

    `c = Σ w_k α_k c_k / Σ w_k α_k`, with premultiplied colours as input and output. The opacity
    is `min(Σ w_k α_k, 1)` (`paper`): what only one of three views saw is dim. Or it is the
    largest `α_k` of all views (`seen`): what one view saw is there.

    Args:
        rgba: Premultiplied renderings, 0…1.
        depth_m: Their depths; 0 where nothing was seen.
        weights: The share of each view, as from `peaking.view_weights`; they sum to 1.
        opacity: How opaque the blend is.
        backend: Which implementation.

    Raises:
        ValueError: The numbers of renderings and weights differ.
    """
    if not len(rgba) == len(depth_m) == len(weights):
        raise ValueError(
            f"need one weight per rendering, got {len(rgba)} renderings, {len(weights)} weights"
        )
    if backend == "numpy":
        return _blend(rgba, depth_m, np.asarray(weights, dtype=np.float64), opacity)
    from peaking.rendering import _blend_numba

    return Rendering(
        *_blend_numba.blend(rgba, depth_m, np.asarray(weights, np.float32), opacity == "seen")
    )


def _blend(
    rgba: Float[np.ndarray, "views h w 4"],
    depth_m: Float[np.ndarray, "views h w"],
    weights: Float[np.ndarray, "views"],
    opacity: Opacity,
) -> Rendering:
    w = weights[:, None, None]
    alphas = rgba[..., 3].astype(np.float64)
    total = (w * alphas).sum(axis=0)
    norm = np.where(total > 0, total, 1.0)
    straight = (w[..., None] * rgba[..., :3]).sum(axis=0) / norm[..., None]
    average_m = (w * alphas * depth_m).sum(axis=0) / norm
    alpha = np.minimum(total, 1.0) if opacity == "paper" else np.where(total > 0, alphas.max(0), 0)
    blended = np.concatenate([straight * alpha[..., None], alpha[..., None]], axis=-1)
    return Rendering(blended.astype(np.float32), average_m.astype(np.float32))
