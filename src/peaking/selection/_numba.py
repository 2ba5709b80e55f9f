# pyright: basic
"""Errors of many blends at once, without keeping the blends."""

from __future__ import annotations

import numba as nb
import numpy as np

HALF_SEEN = 0.5
"""Opacity below which a pixel counts as not shown."""


@nb.njit(cache=True, fastmath=True, parallel=True, error_model="numpy")
def blended_errors(rgba, photos, pixels, targets, sources, weights, seen, errors):
    """Write the mean squared errors of blends of renderings, against photos.

    Args:
        rgba: Renderings, premultiplied, (renderings, most pixels, 4) float32.
        photos: Small photos, (photos, most pixels, 4) uint8; the fourth is 0 where a pixel does not
            count.
        pixels: How many pixels each photo has, (photos,).
        targets: Which photo each blend is of, (blends,).
        sources: Which renderings are blended, then -1, (blends, views).
        weights: Their weights, (blends, views) float32.
        seen: Whether the opacity is the largest of the views' (`peaking.rendering.blending`).
        errors: To write: over all that counts, and the part of it where nothing is shown,
            (blends, 2) float64.
    """
    views = sources.shape[1]
    one = np.float32(1.0)
    nothing = np.float32(0.0)
    scale = np.float32(1.0 / 255.0)
    for blend in nb.prange(len(targets)):
        photo = targets[blend]
        wrong = 0.0
        unseen = 0.0
        counted = 0
        for p in range(pixels[photo]):
            if photos[photo, p, 3] == 0:
                continue
            r = nothing
            g = nothing
            b = nothing
            total = nothing
            most = nothing
            for k in range(views):
                source = sources[blend, k]
                if source < 0:
                    break
                w = weights[blend, k]
                alpha = rgba[source, p, 3]
                r += w * rgba[source, p, 0]
                g += w * rgba[source, p, 1]
                b += w * rgba[source, p, 2]
                total += w * alpha
                most = max(most, alpha)
            alpha = most if seen else min(total, one)
            gain = alpha / total if total > nothing else nothing
            dr = min(r * gain, one) - photos[photo, p, 0] * scale
            dg = min(g * gain, one) - photos[photo, p, 1] * scale
            db = min(b * gain, one) - photos[photo, p, 2] * scale
            squared = dr * dr + dg * dg + db * db
            counted += 1
            wrong += squared
            if alpha < np.float32(HALF_SEEN):
                unseen += squared
        errors[blend, 0] = wrong / (3.0 * max(counted, 1))
        errors[blend, 1] = unseen / (3.0 * max(counted, 1))
