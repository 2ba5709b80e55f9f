# pyright: basic
"""Rendering on the CPU: sparse, blockwise, near to far, stopping where nothing shines through.

A block of the target is 16×16 pixels. For each plane the block's footprint in the plane is bounded
by its corners (a homography keeps it convex), and planes without a tile there cost nothing more.
Taps are blended four channels at a time in the 16-bit lanes of one 64-bit word, with weights of
1/256, so nothing is lost before the conversion to float.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from peaking.mpi import Mpi

BLOCK_PX = 16
OPAQUE = 1.0 / 512.0
"""Transmittance below which what lies behind cannot change an 8-bit colour."""


def render(mpi: Mpi, homographies, depth_times_w, disparity, size_px, *, out=None, under=False):
    """Render; see `peaking.rendering.render`.

    `out`: two arrays to write into; with `under`, what they hold is kept, and drawn under.
    """
    width, height = size_px
    if out is None:
        out = np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32)
    rgba, average = out
    texels = mpi.texels.view(np.uint32).reshape(-1, 256)
    drawn = np.flatnonzero(~np.isnan(homographies[:, 0, 0]))[::-1]  # near to far
    _render(
        texels,
        mpi.tile_index,
        drawn,
        homographies.astype(np.float32),
        depth_times_w.astype(np.float32),
        disparity.astype(np.float32),
        rgba,
        average,
        under,
    )
    return rgba, average


@nb.njit(cache=True, fastmath=True, inline="always")
def _footprint_is_empty(index, h, x0, y0, x1, y1):
    """Tell whether no tile of the plane lies under the block; corners are pixel centres."""
    rows, cols = index.shape
    u_min = np.float32(1e30)
    v_min = np.float32(1e30)
    u_max = np.float32(-1e30)
    v_max = np.float32(-1e30)
    for corner in range(4):
        x = x0 if corner % 2 == 0 else x1
        y = y0 if corner < 2 else y1
        w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
        if w < np.float32(1e-6):
            return False  # the horizon crosses the block: look at every pixel
        u = (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w
        v = (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w
        u_min = min(u_min, u)
        u_max = max(u_max, u)
        v_min = min(v_min, v)
        v_max = max(v_max, v)
    scale = np.float32(1.0 / 15.0)
    half = np.float32(0.5)
    if u_max < -half or v_max < -half:
        return True
    limit_u = np.float32(cols * 15)
    limit_v = np.float32(rows * 15)
    if u_min > limit_u or v_min > limit_v:
        return True
    c0 = int(max(u_min + half - np.float32(0.01), np.float32(0)) * scale)
    r0 = int(max(v_min + half - np.float32(0.01), np.float32(0)) * scale)
    c1 = min(int(min(u_max + half + np.float32(0.01), limit_u) * scale), cols - 1)
    r1 = min(int(min(v_max + half + np.float32(0.01), limit_v) * scale), rows - 1)
    for r in range(r0, r1 + 1):
        for c in range(c0, c1 + 1):
            if index[r, c] >= 0:
                return False
    return True


@nb.njit(cache=True, fastmath=True, inline="always")
def _lanes(texel):
    """Spread the four bytes of a texel over the 16-bit lanes of a 64-bit word (r, b, g, a)."""
    t = np.uint64(texel)
    return (t & np.uint64(0x00FF00FF)) | ((t & np.uint64(0xFF00FF00)) << np.uint64(24))


@nb.njit(cache=True, fastmath=True, parallel=True)
def _render(
    texels, tile_index, drawn, homographies, depth_times_w, disparity, rgba, average, under
):
    height, width = average.shape
    rows, cols = tile_index.shape[1:]
    max_i = cols * 15  # exclusive bound of texel + 1
    max_j = rows * 15
    half = np.float32(0.5)
    to_unit = np.float32(1.0 / (255.0 * 256.0))
    block_rows = (height + BLOCK_PX - 1) // BLOCK_PX
    opaque = np.float32(OPAQUE)
    for block_row in nb.prange(block_rows):
        y0 = block_row * BLOCK_PX
        y1 = min(y0 + BLOCK_PX, height)
        for x0 in range(0, width, BLOCK_PX):
            x1 = min(x0 + BLOCK_PX, width)
            for y in range(y0, y1):
                for x in range(x0, x1):
                    if under:
                        average[y, x] *= rgba[y, x, 3]
                        continue
                    for c in range(4):
                        rgba[y, x, c] = np.float32(0.0)
                    average[y, x] = np.float32(0.0)
            for plane in drawn:
                h = homographies[plane]
                index = tile_index[plane]
                if _footprint_is_empty(
                    index,
                    h,
                    np.float32(x0) + half,
                    np.float32(y0) + half,
                    np.float32(x1) - half,
                    np.float32(y1) - half,
                ):
                    continue
                h00, h01, h02 = h[0, 0], h[0, 1], h[0, 2]
                h10, h11, h12 = h[1, 0], h[1, 1], h[1, 2]
                h20, h21, h22 = h[2, 0], h[2, 1], h[2, 2]
                per_w = depth_times_w[plane]
                constant = disparity[plane]
                open_pixels = 0
                for y in range(y0, y1):
                    yc = np.float32(y) + half
                    u_row = h01 * yc + h02
                    v_row = h11 * yc + h12
                    w_row = h21 * yc + h22
                    for x in range(x0, x1):
                        left = np.float32(1.0) - rgba[y, x, 3]
                        if left < opaque:
                            continue
                        open_pixels += 1
                        xc = np.float32(x) + half
                        w = h20 * xc + w_row
                        if w < np.float32(1e-9):
                            continue
                        inv_w = np.float32(1.0) / w
                        # Counted from the rim of transparent texels, hence + 0.5 and not - 0.5.
                        u = (h00 * xc + u_row) * inv_w + half
                        v = (h10 * xc + v_row) * inv_w + half
                        if not (u >= np.float32(0.0) and v >= np.float32(0.0)):
                            continue
                        if u >= np.float32(max_i) or v >= np.float32(max_j):
                            continue
                        i = np.uint32(u)
                        j = np.uint32(v)
                        cell_i = i // np.uint32(15)
                        cell_j = j // np.uint32(15)
                        tile = index[cell_j, cell_i]
                        if tile < 0:
                            continue
                        at = (j - cell_j * np.uint32(15)) * np.uint32(16) + (
                            i - cell_i * np.uint32(15)
                        )
                        t00 = texels[tile, at]
                        t01 = texels[tile, at + 1]
                        t10 = texels[tile, at + 16]
                        t11 = texels[tile, at + 17]
                        if (t00 | t01 | t10 | t11) == 0:
                            continue
                        fx = np.uint32((u - np.float32(i)) * np.float32(256.0) + half)
                        fy = np.uint32((v - np.float32(j)) * np.float32(256.0) + half)
                        w11 = (fx * fy + np.uint32(128)) >> np.uint32(8)
                        w01 = fx - w11
                        w10 = fy - w11
                        w00 = np.uint32(256) - fx - fy + w11
                        lanes = (
                            _lanes(t00) * np.uint64(w00)
                            + _lanes(t01) * np.uint64(w01)
                            + _lanes(t10) * np.uint64(w10)
                            + _lanes(t11) * np.uint64(w11)
                        )
                        share = left * to_unit
                        alpha = np.float32(lanes >> np.uint64(48)) * share
                        rgba[y, x, 0] += np.float32(lanes & np.uint64(0xFFFF)) * share
                        rgba[y, x, 1] += (
                            np.float32((lanes >> np.uint64(32)) & np.uint64(0xFFFF)) * share
                        )
                        rgba[y, x, 2] += (
                            np.float32((lanes >> np.uint64(16)) & np.uint64(0xFFFF)) * share
                        )
                        rgba[y, x, 3] += alpha
                        average[y, x] += alpha * (per_w * inv_w + constant)
                if open_pixels == 0:
                    break
            for y in range(y0, y1):
                for x in range(x0, x1):
                    alpha = rgba[y, x, 3]
                    if alpha > np.float32(0.0):
                        average[y, x] /= alpha
