"""What views foretell of a picture that was never taken, as it is defined.

The error of what a view shows is taken to grow with the square of the angle between its ray and the
picture's, `apart² = (distance / depth)²`: so it does where the depth of things is wrong, to first
order. Then two views differ by `s² (apart_k² + apart_l²)` on average, and that tells `s²`, pixel by
pixel; where few views see a thing, the prior does.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

HALF_SEEN = 0.5
"""Opacity from which a view shows a pixel."""

PRIOR, PRIOR_WEIGHT = 0.5, 0.01
"""Mean squared error per squared angle where nothing else tells, and how many squared radians of
evidence it counts as."""

NOISE = 0.0008
"""Mean squared difference of two views of a thing that are both right."""

FAR_RAD = 1.0
"""Larger angles count as this."""

MOST = 0.06
"""Mean squared error of a pixel that is quite wrong."""

WRONG = 0.01
"""Mean squared error from which a pixel is wrong: about that of the error threshold."""

NEAR_RAD, ALIKE = 0.15, 1.5
"""Views within this angle that still differ by so many times `WRONG` will not agree with more of
them: a mirror, glass, or what moves."""


def foretell(
    rgba: Float32[np.ndarray, "views h w 4"],
    depth_m: Float32[np.ndarray, "views h w"],
    weights: Float64[np.ndarray, "views"],
    distance_m: Float64[np.ndarray, "views"],
) -> tuple[Float32[np.ndarray, "h w"], Int32[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Foretell how wrong a blend of views will be.

    Args:
        rgba: What each view shows of the picture, premultiplied.
        depth_m: Its depth.
        weights: The share of each view.
        distance_m: From each view to where the picture would be taken.

    Returns:
        Mean squared error over the channels, 0…`MOST`, 0 where no view shows anything; how many
        views show each pixel; where views nearby differ, so that more will not help.
    """
    shows = rgba[..., 3] >= HALF_SEEN
    alpha = np.where(shows, rgba[..., 3], 1.0).astype(np.float64)
    colour = rgba[..., :3] / alpha[..., None]
    away = distance_m[:, None, None] / np.where(shows, depth_m, 1.0)
    apart = np.minimum(away, FAR_RAD) ** 2
    share = np.where(shows, weights[:, None, None], 0.0)
    total = share.sum(axis=0)
    spread = (share * apart).sum(axis=0) / np.where(total > 0, total, 1.0)
    differ = np.full(total.shape, PRIOR * PRIOR_WEIGHT)
    squared = np.full(total.shape, PRIOR_WEIGHT)
    close = np.zeros(total.shape, np.int64)
    close_differ = np.zeros(total.shape)
    for k in range(len(rgba)):
        for other in range(k):
            both = shows[k] & shows[other]
            d = np.maximum(((colour[k] - colour[other]) ** 2).mean(axis=-1) - NOISE, 0.0)
            differ += np.where(both, d, 0.0)
            squared += np.where(both, apart[k] + apart[other], 0.0)
            near = both & (apart[k] < NEAR_RAD**2) & (apart[other] < NEAR_RAD**2)
            close += near
            close_differ += np.where(near, d, 0.0)
    seen_by = shows.sum(axis=0).astype(np.int32)
    error = np.where(seen_by > 0, np.minimum(differ / squared * spread, MOST), 0.0)
    alike = (close > 0) & (close_differ > ALIKE * WRONG * close)
    return error.astype(np.float32), seen_by, alike
