# pyright: basic
"""Tiles to the pictures of colour and alpha and back, compiled.

The layout of the pictures and the formulas: docs/mpi-format.md. A texel travels as one 32-bit
word, red in the lowest byte, and the inner loops run over contiguous rows without branches, so
that the compiler can work on eight texels at once; numba computes in 64 bits, four at once,
unless every step is cast back to 32.
"""

import numpy as np
from numba import njit

_F = np.float32
_I = np.int32
_U = np.uint32
_E = np.uint64
"""Eight bytes of a picture, copied as one."""
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
def _halves(word):
    """Return the lower and the upper 16 bits."""
    return _I(word & _U(0xFFFF)), _I(word >> _U(16))


@njit(cache=True, fastmath=True, error_model="numpy")
def _quad_sums(texels, rows_rb, rows_ga, rb, ga):
    """Write the sums of the channels of 2 texels above each other, and of 2 × 2.

    Two of them fit in a word.
    """
    for y in range(8):
        upper, lower = texels[32 * y : 32 * y + 16], texels[32 * y + 16 : 32 * y + 32]
        row_rb, row_ga = rows_rb[16 * y : 16 * y + 16], rows_ga[16 * y : 16 * y + 16]
        for x in range(16):
            a, b = upper[x], lower[x]
            row_rb[x] = (a & _EVEN) + (b & _EVEN)
            row_ga[x] = ((a >> _U(8)) & _EVEN) + ((b >> _U(8)) & _EVEN)
    for n in range(64):
        rb[n] = rows_rb[2 * n] + rows_rb[2 * n + 1]
        ga[n] = rows_ga[2 * n] + rows_ga[2 * n + 1]


@njit(cache=True, fastmath=True, error_model="numpy")
def _block_means(rb, ga, means):
    """Write Y, Cb and Cr of the mean colour of the four 8 × 8 blocks, or of the tile.

    `rb` and `ga` are what `_quad_sums` wrote.
    """
    sums = np.zeros((5, 4), np.int32)
    for block in range(4):
        block_rb = block_ga = _U(0)
        for y in range(4):
            for x in range(4):
                n = 32 * (block >> 1) + 4 * (block & 1) + 8 * y + x
                block_rb += rb[n]
                block_ga += ga[n]
        sums[block, 0], sums[block, 2] = _halves(block_rb)
        sums[block, 1], sums[block, 3] = _halves(block_ga)
        for channel in range(4):
            sums[4, channel] += sums[block, channel]
    for block in range(4):
        used = block if sums[block, 3] > 0 else 4
        y, cb, cr = _ycc(sums[used, 0], sums[used, 1], sums[used, 2], sums[used, 3])
        means[block, 0], means[block, 1], means[block, 2] = y, cb, cr


@njit(cache=True, inline="always")
def _unlike(a, b, opacity_a, opacity_b, shift):
    """Return how far a channel of two texels is apart, both scaled to the product of their alphas.

    Premultiplied by an alpha a and rounded, a colour is within half a step of what it should be, so
    two texels of one colour differ by (a + b) / 2 at most; as much is allowed again.
    """
    one = _I(_I((a >> _U(shift)) & _BYTE) * opacity_b)
    other = _I(_I((b >> _U(shift)) & _BYTE) * opacity_a)
    return _I(_I(abs(_I(one - other))) - _I(opacity_a + opacity_b))


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


@njit(cache=True)
def mark_places(places, held, stacks):
    """Mark the places of tiles, and number rows and columns.

    Args:
        places: [tiles, 3] int32, plane, row and column.
        held: [planes, rows, cols] bool, False everywhere; to write to.
        stacks: [tiles] int32, row · columns + column; to write to.

    Returns:
        0, or 1 if a place is outside, or 2 if they are not sorted, each once.
    """
    planes, rows, cols = held.shape
    before = -1
    for i in range(len(places)):
        plane, row, col = places[i, 0], places[i, 1], places[i, 2]
        if not (0 <= plane < planes and 0 <= row < rows and 0 <= col < cols):
            return 1
        stack = row * cols + col
        place = plane * rows * cols + stack
        if place <= before:
            return 2
        before = place
        held[plane, row, col] = True
        stacks[i] = stack
    return 0


@njit(cache=True, nogil=True, error_model="numpy")
def tiles_to_alpha(words, picture):
    """Write alpha of all tiles into a picture, as it is stored.

    Args:
        words: [tiles, 256] uint32, premultiplied RGBA.
        picture: [rows, 16, cols, 16] uint8, to write to; 0 where no tile is.
    """
    rows, num_cols = picture.shape[0], np.uint64(picture.shape[2])
    eights = picture.view(_E)
    stored = np.empty(256, np.uint8)
    stored_eights = stored.view(_E)
    for i in range(rows * picture.shape[2]):
        row, col = np.uint64(i) // num_cols, np.uint64(i) % num_cols
        if i >= len(words):
            picture[row, :, col] = np.uint8(0)
            continue
        texels = words[i]
        for x in range(256):
            opacity = _I(texels[x] >> _U(24))
            # 24672 / 65536 = 96 / 255: from 16 to 112, and the ends are 0 and 128
            inner = _I(16) + _I(_I(_I(opacity * _I(24672)) + _I(32768)) >> _I(16))
            inner = _I(0) if opacity == _I(0) else inner
            stored[x] = np.uint8(_I(128) if opacity == _I(255) else inner)
        for y in range(16):
            eights[row, y, col, 0] = stored_eights[2 * y]
            eights[row, y, col, 1] = stored_eights[2 * y + 1]


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
            for x in range(256):
                colors[count, x] = texels[x]
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
def tiles_to_planes(words, luma, blue, red):
    """Write the straight colours of all tiles into the planes of a picture.

    A texel without alpha gets the mean colour of its 8 × 8 block, or else of its tile.

    Args:
        words: [tiles, 256] uint32, premultiplied RGBA.
        luma: [rows, 16, cols, 16], to write to; what no tile covers is left as it is.
        blue: [rows, 8, cols, 8], Cb, one sample for 2 × 2 texels; each counts as it is opaque.
        red: The same for Cr.
    """
    num_cols = np.uint64(luma.shape[2])
    rows_rb, rows_ga = np.empty(128, np.uint32), np.empty(128, np.uint32)
    rb, ga, means = np.empty(64, np.uint32), np.empty(64, np.uint32), np.empty((4, 3), np.float32)
    fill = np.empty(256, np.uint8)
    shades, blues, reds = np.empty(256, np.uint8), np.empty(64, np.uint8), np.empty(64, np.uint8)
    luma_eights, blue_eights, red_eights = luma.view(_E), blue.view(_E), red.view(_E)
    shade_eights, blues_eights, reds_eights = shades.view(_E), blues.view(_E), reds.view(_E)
    for i in range(len(words)):
        row, col = np.uint64(i) // num_cols, np.uint64(i) % num_cols
        texels = words[i]
        _quad_sums(texels, rows_rb, rows_ga, rb, ga)
        for n in range(64):
            r, b = _halves(rb[n])
            g, a = _halves(ga[n])
            _, cb, cr = _ycc(r, g, b, a)
            blues[n], reds[n] = _byte(cb), _byte(cr)
        for n in range(256):
            word = texels[n]
            alpha = word >> _U(24)
            shade = _brightness(
                _F(_I(word & _BYTE)),
                _F(_I((word >> _U(8)) & _BYTE)),
                _F(_I((word >> _U(16)) & _BYTE)),
            )
            shades[n] = _byte(shade * (_F(255) / max(_F(_I(alpha)), _F(1))))
        least = _I(255)
        for n in range(256):
            least = min(least, _I(texels[n] >> _U(24)))
        if least == 0:
            _block_means(rb, ga, means)
            for run in range(32):
                mean = _byte(means[2 * (run >> 4) + (run & 1), 0])
                for x in range(8):
                    fill[8 * run + x] = mean
            for n in range(256):
                shades[n] = fill[n] if texels[n] >> _U(24) == _U(0) else shades[n]
            for n in range(64):
                if ga[n] >> _U(16) == _U(0):
                    block = 2 * (n >> 5) + ((n >> 2) & 1)
                    blues[n], reds[n] = _byte(means[block, 1]), _byte(means[block, 2])
        for y in range(16):
            luma_eights[row, y, col, 0] = shade_eights[2 * y]
            luma_eights[row, y, col, 1] = shade_eights[2 * y + 1]
        for y in range(8):
            blue_eights[row, y, col, 0] = blues_eights[y]
            red_eights[row, y, col, 0] = reds_eights[y]


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
