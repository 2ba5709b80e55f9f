# pyright: basic
"""Tiles to the planes of a JPEG picture and back, compiled.

The layout of the picture and the formulas: docs/mpi-format.md. A texel travels as one 32-bit
word, red in the lowest byte, and the inner loops run over contiguous rows without branches, so
that the compiler can work on eight texels at once.
"""

import numpy as np
from numba import njit

_F = np.float32
_I = np.int32
_U = np.uint32
_BYTE = np.uint32(0xFF)
_EVEN = np.uint32(0x00FF00FF)  # red and blue of a word; after a shift by 8, green and alpha


@njit(cache=True, inline="always")
def _brightness(r, g, b):
    return _F(0.299) * r + _F(0.587) * g + _F(0.114) * b


@njit(cache=True, inline="always")
def _byte(value):
    return np.uint8(_I(min(max(value + _F(0.5), _F(0)), _F(255))))


@njit(cache=True, inline="always")
def _ycc(r, g, b, a):
    """Return the mean straight colour of texels from the sums of their channels."""
    scale = _F(255) / max(_F(a), _F(1))
    red, green, blue = _F(r) * scale, _F(g) * scale, _F(b) * scale
    luma = _brightness(red, green, blue)
    return luma, (blue - luma) * _F(1 / 1.772) + _F(128), (red - luma) * _F(1 / 1.402) + _F(128)


@njit(cache=True, inline="always")
def _sums(words, top, left):
    """Return the sums of the channels over 8 × 8 texels; two of them fit in a word."""
    red_blue = _U(0)
    green_alpha = _U(0)
    for y in range(top, top + 8):
        for x in range(left, left + 8):
            red_blue += words[y, x] & _EVEN
            green_alpha += (words[y, x] >> _U(8)) & _EVEN
    low = _U(0xFFFF)
    return (
        _I(red_blue & low),
        _I(green_alpha & low),
        _I(red_blue >> _U(16)),
        _I(green_alpha >> _U(16)),
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def mean_colors(words, means):
    """Find what a texel without alpha gets: the mean colour of its 8 × 8 block, or of its tile.

    Args:
        words: [tiles, 16, 16] uint32, premultiplied RGBA.
        means: [tiles, 3, 2, 2], Y, Cb and Cr of every block, to write to.
    """
    sums = np.empty((5, 4), dtype=np.int32)  # of the four blocks, then of the tile
    for i in range(len(words)):
        sums[4] = 0
        for block in range(4):
            r, g, b, a = _sums(words[i], 8 * (block // 2), 8 * (block % 2))
            sums[block, 0] = r
            sums[block, 1] = g
            sums[block, 2] = b
            sums[block, 3] = a
            for channel in range(4):
                sums[4, channel] += sums[block, channel]
        for block in range(4):
            used = sums[block] if sums[block, 3] > 0 else sums[4]
            y, cb, cr = _ycc(used[0], used[1], used[2], used[3])
            means[i, 0, block // 2, block % 2] = y
            means[i, 1, block // 2, block % 2] = cb
            means[i, 2, block // 2, block % 2] = cr


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def tiles_to_luma(words, means, luma):
    """Write all tiles into the luma of a picture: of the straight colour, then alpha.

    Args:
        words: [tiles, 16, 16] uint32, premultiplied RGBA.
        means: What `mean_colors` found.
        luma: [2, rows, 16, cols, 16], to write to; what no tile covers is left as it is.
    """
    num_cols = luma.shape[3]
    for i in range(len(words)):
        # Unsigned, so that no index is looked at for being negative.
        row, col = np.uint64(i) // np.uint64(num_cols), np.uint64(i) % np.uint64(num_cols)
        for y in range(16):
            texels = words[i, y]
            colors = luma[0, row, y, col]
            alphas = luma[1, row, y, col]
            left, right = means[i, 0, y // 8, 0], means[i, 0, y // 8, 1]
            for x in range(16):
                word = texels[x]
                opacity = _I(word >> _U(24))
                shade = _brightness(
                    _F(_I(word & _BYTE)),
                    _F(_I((word >> _U(8)) & _BYTE)),
                    _F(_I((word >> _U(16)) & _BYTE)),
                )
                straight = shade * (_F(255) / max(_F(opacity), _F(1)))
                mean = left if x < 8 else right
                colors[x] = _byte(straight if opacity > 0 else mean)
                # 24672 / 65536 = 96 / 255: from 16 to 112, and the ends are 0 and 128
                inner = _I(16) + ((opacity * _I(24672) + _I(32768)) >> _I(16))
                inner = _I(0) if opacity == 0 else inner
                alphas[x] = np.uint8(_I(128) if opacity == 255 else inner)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def tiles_to_chroma(words, means, blue, red):
    """Write all tiles into the chroma of a picture, one sample for 2 × 2 texels.

    Args:
        words: [tiles, 16, 16] uint32, premultiplied RGBA.
        means: What `mean_colors` found.
        blue: [2, rows, 8, cols, 8], Cb, to write to; the second half is left as it is.
        red: The same for Cr.
    """
    num_cols = blue.shape[3]
    for i in range(len(words)):
        row, col = np.uint64(i) // np.uint64(num_cols), np.uint64(i) % np.uint64(num_cols)
        for y in range(8):
            upper, lower = words[i, 2 * y], words[i, 2 * y + 1]
            blues, reds = blue[0, row, y, col], red[0, row, y, col]
            left_cb, right_cb = means[i, 1, y // 4, 0], means[i, 1, y // 4, 1]
            left_cr, right_cr = means[i, 2, y // 4, 0], means[i, 2, y // 4, 1]
            for x in range(8):
                a, b, c, d = upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]
                # The sum of premultiplied colours: a texel counts as much as it is opaque.
                rb = (a & _EVEN) + (b & _EVEN) + (c & _EVEN) + (d & _EVEN)
                ga = (a >> _U(8)) & _EVEN
                ga += (b >> _U(8)) & _EVEN
                ga += (c >> _U(8)) & _EVEN
                ga += (d >> _U(8)) & _EVEN
                opacity = _I(ga >> _U(16))
                _, cb, cr = _ycc(
                    _I(rb & _U(0xFFFF)), _I(ga & _U(0xFFFF)), _I(rb >> _U(16)), opacity
                )
                mean_cb = left_cb if x < 4 else right_cb
                mean_cr = left_cr if x < 4 else right_cr
                blues[x] = _byte(cb if opacity > 0 else mean_cb)
                reds[x] = _byte(cr if opacity > 0 else mean_cr)


@njit(cache=True, nogil=True, error_model="numpy")
def picture_to_tiles(picture, words):
    """Read all tiles out of the decoded picture and premultiply them.

    Args:
        picture: [2, rows, 16, cols, 16] uint32, the decoded picture, red in the lowest byte.
        words: [tiles, 16, 16] uint32, premultiplied RGBA, to write to.
    """
    num_cols = picture.shape[3]
    for i in range(len(words)):
        row, col = np.uint64(i) // np.uint64(num_cols), np.uint64(i) % np.uint64(num_cols)
        for y in range(16):
            colors = picture[0, row, y, col]
            alphas = picture[1, row, y, col]
            tile = words[i, y]
            for x in range(16):
                color = colors[x]
                stored = _I((alphas[x] >> _U(8)) & _BYTE)
                # 174080 / 65536 = 255 / 96
                inner = ((stored - _I(16)) * _I(174080) + _I(32768)) >> _I(16)
                alpha = _U(min(max(inner, _I(0)), _I(255)))
                # colour · alpha / 255, rounded: (p + p / 256) / 256 with p + 128 (Blinn, 1995,
                # "Three wrongs make a right"), red and blue at once
                rb = (color & _EVEN) * alpha + _U(0x00800080)
                rb = ((rb + ((rb >> _U(8)) & _EVEN)) >> _U(8)) & _EVEN
                g = ((color >> _U(8)) & _BYTE) * alpha + _U(0x80)
                g = (g + (g >> _U(8))) >> _U(8)
                tile[x] = rb | (g << _U(8)) | (alpha << _U(24))
