# pyright: basic
"""Tiles to the pictures of colour and alpha and back, compiled.

The layout of the pictures and the formulas: docs/mpi-format.md. A texel travels as one 32-bit
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


@njit(cache=True, inline="always")
def _unlike(a, b, opacity_a, opacity_b, shift):
    """Return how far a channel of two texels is apart, both scaled to the product of their alphas.

    Premultiplied by an alpha a and rounded, a colour is within half a step of what it should be, so
    two texels of one colour differ by (a + b) / 2 at most; as much is allowed again.
    """
    one = _I((a >> _U(shift)) & _BYTE) * opacity_b
    other = _I((b >> _U(shift)) & _BYTE) * opacity_a
    return abs(one - other) - (opacity_a + opacity_b)


@njit(cache=True, inline="always")
def _same_colors(texels, color):
    """Return whether two tiles have the same straight colour wherever both have alpha."""
    for quarter in range(0, 256, 64):
        worst = _I(0)
        for x in range(quarter, quarter + 64):
            a, b = texels[x], color[x]
            opacity_a, opacity_b = _I(a >> _U(24)), _I(b >> _U(24))
            # Without alpha a texel is 0, so that it is unlike nothing.
            red = _unlike(a, b, opacity_a, opacity_b, 0)
            green = _unlike(a, b, opacity_a, opacity_b, 8)
            blue = _unlike(a, b, opacity_a, opacity_b, 16)
            worst = max(worst, max(red, max(green, blue)))
        if worst > 0:
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def store_alphas(words, alphas):
    """Take alpha out of all tiles, as it is stored.

    Args:
        words: [tiles, 256] uint32, premultiplied RGBA.
        alphas: [tiles, 256] uint8, to write to.
    """
    for i in range(len(words)):
        texels, stored = words[i], alphas[i]
        for x in range(256):
            opacity = _I(texels[x] >> _U(24))
            # 24672 / 65536 = 96 / 255: from 16 to 112, and the ends are 0 and 128
            inner = _I(16) + ((opacity * _I(24672) + _I(32768)) >> _I(16))
            inner = _I(0) if opacity == _I(0) else inner
            stored[x] = np.uint8(_I(128) if opacity == _I(255) else inner)


@njit(cache=True, nogil=True, error_model="numpy")
def share_colors(words, stacks, latest, colors, is_new):
    """Find the tiles whose colours differ from those of the tile behind.

    Args:
        words: [tiles, 256] uint32, premultiplied RGBA, farthest first.
        stacks: [tiles] int32, which row and column a tile is in.
        latest: [stacks] int32, -1 everywhere; to work with.
        colors: [tiles, 256] uint32, to write to: what tiles of the same colours look like
            together, each texel from the one that is most opaque there.
        is_new: [tiles] bool, to write to: whether a tile begins a new one of `colors`.

    Returns:
        How many of `colors` are used.
    """
    count = 0
    for i in range(len(words)):
        texels = words[i]
        behind = latest[stacks[i]]
        is_new[i] = behind < 0 or not _same_colors(texels, colors[behind])
        if is_new[i]:
            colors[count] = texels
            latest[stacks[i]] = count
            count += 1
            continue
        color = colors[behind]
        for x in range(256):
            color[x] = texels[x] if (texels[x] >> _U(24)) > (color[x] >> _U(24)) else color[x]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def find_colors(is_new, stacks, latest, color_of):
    """Find which colours every tile has; the inverse of `share_colors`.

    Args:
        is_new: [tiles] bool, whether a tile has colours of its own.
        stacks: [tiles] int32, which row and column a tile is in.
        latest: [stacks] int32, -1 everywhere; to work with.
        color_of: [tiles] int32, to write to: -1 where there is no tile behind to have them from.
    """
    count = 0
    for i in range(len(is_new)):
        if is_new[i]:
            latest[stacks[i]] = count
            count += 1
        color_of[i] = latest[stacks[i]]


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
    """Write the luma of all tiles' straight colours into a picture.

    Args:
        words: [tiles, 16, 16] uint32, premultiplied RGBA.
        means: What `mean_colors` found.
        luma: [rows, 16, cols, 16], to write to; what no tile covers is left as it is.
    """
    num_cols = luma.shape[2]
    for i in range(len(words)):
        row, col = np.uint64(i) // np.uint64(num_cols), np.uint64(i) % np.uint64(num_cols)
        for y in range(16):
            texels = words[i, y]
            colors = luma[row, y, col]
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


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def tiles_to_chroma(words, means, blue, red):
    """Write the chroma of all tiles into a picture, one sample for 2 × 2 texels.

    Args:
        words: [tiles, 16, 16] uint32, premultiplied RGBA.
        means: What `mean_colors` found.
        blue: [rows, 8, cols, 8], Cb, to write to; what no tile covers is left as it is.
        red: The same for Cr.
    """
    num_cols = blue.shape[2]
    for i in range(len(words)):
        row, col = np.uint64(i) // np.uint64(num_cols), np.uint64(i) % np.uint64(num_cols)
        for y in range(8):
            upper, lower = words[i, 2 * y], words[i, 2 * y + 1]
            blues, reds = blue[row, y, col], red[row, y, col]
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
def pictures_to_tiles(colors, alphas, color_of, words):
    """Read all tiles out of the decoded pictures and premultiply them.

    Args:
        colors: [rows, 16, cols, 16] uint32, the decoded picture of colour, red in the lowest byte.
        alphas: [rows, 16, cols, 16] uint8, the decoded picture of alpha.
        color_of: [tiles] int32, which tile of `colors` goes with each of `alphas`.
        words: [tiles, 16, 16] uint32, premultiplied RGBA, to write to.
    """
    color_cols, alpha_cols = np.uint64(colors.shape[2]), np.uint64(alphas.shape[2])
    for i in range(len(words)):
        row, col = np.uint64(i) // alpha_cols, np.uint64(i) % alpha_cols
        from_row = np.uint64(color_of[i]) // color_cols
        from_col = np.uint64(color_of[i]) % color_cols
        for y in range(16):
            straight = colors[from_row, y, from_col]
            stored = alphas[row, y, col]
            tile = words[i, y]
            for x in range(16):
                color = straight[x]
                # 174080 / 65536 = 255 / 96
                inner = ((_I(stored[x]) - _I(16)) * _I(174080) + _I(32768)) >> _I(16)
                alpha = _U(min(max(inner, _I(0)), _I(255)))
                # colour · alpha / 255, rounded: (p + p / 256) / 256 with p + 128 (Blinn, 1995,
                # "Three wrongs make a right"), red and blue at once
                rb = (color & _EVEN) * alpha + _U(0x00800080)
                rb = ((rb + ((rb >> _U(8)) & _EVEN)) >> _U(8)) & _EVEN
                g = ((color >> _U(8)) & _BYTE) * alpha + _U(0x80)
                g = (g + (g >> _U(8))) >> _U(8)
                tile[x] = rb | (g << _U(8)) | (alpha << _U(24))
