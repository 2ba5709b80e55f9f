"""The texels of a `.mpi` file: pictures of colour and of alpha, or a deflated stream."""

# Functions that numba compiles have no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import simplejpeg
from jaxtyping import Bool, Int32, UInt8, UInt32

from peaking.errors import MpiFileError
from peaking.mpi import TILE_PX
from peaking.mpi_file._header import Codec
from peaking.mpi_file._jpeg import baseline_size_px

_Texels = UInt8[np.ndarray, "tiles 16 16 4"]
_Stacks = Int32[np.ndarray, "tiles"]

MAX_COLS = 256
"""Tiles beside each other: pictures 4096 pixels wide, which every browser of today takes."""

ALPHA_QUALITY = 85
"""JPEG quality of the picture of alpha. Its noise shows far less than that of colour; below this,
much of what is empty or opaque becomes hazy (docs/mpi-format.md)."""

_HALF = TILE_PX // 2
_TILE_BYTES = TILE_PX * TILE_PX * 4
_LENGTH_BYTES = 4


def pack_texels(
    texels: _Texels,
    codec: Codec,
    stacks: _Stacks,
    *,
    quality: int,
    meanwhile: Callable[[], None] = lambda: None,
) -> bytes:
    """Return the payload of a file; nothing when there are no tiles.

    Args:
        texels: Premultiplied RGBA, in the order of the file.
        codec: How to store them.
        stacks: Row and column of each tile as one number, row · columns + column.
        quality: JPEG quality of the colours.
        meanwhile: What else is to be done, here, while another thread is at work.
    """
    if len(texels) == 0 or codec == "lossless":
        meanwhile()
        return zlib.compress(_differences(texels).tobytes(), level=1) if len(texels) else b""
    words = np.ascontiguousarray(texels).view(np.uint32).reshape(-1, TILE_PX**2)
    alpha_jpeg = _beside().submit(_alpha_jpeg, words)
    is_new, color_jpeg = _color_jpeg(words, stacks, quality)
    meanwhile()
    length = len(color_jpeg).to_bytes(_LENGTH_BYTES, "little")
    return b"".join([np.packbits(is_new).tobytes(), length, color_jpeg, alpha_jpeg.result()])


def unpack_texels(payload: bytes, codec: Codec, stacks: _Stacks) -> _Texels:
    """Return the tiles of a payload.

    Raises:
        MpiFileError: It does not hold that many tiles, or is not of the kind that the codec says.
    """
    if len(stacks) == 0:
        if payload:
            raise MpiFileError(f"need no payload for no tiles, got {len(payload)} bytes")
        return np.zeros((0, TILE_PX, TILE_PX, 4), dtype=np.uint8)
    if codec == "lossless":
        return _from_deflated(payload, len(stacks))
    return _from_pictures(payload, stacks)


def _color_jpeg(
    words: UInt32[np.ndarray, "tiles 256"], stacks: _Stacks, quality: int
) -> tuple[Bool[np.ndarray, "tiles"], bytes]:
    """Return which tiles have new colours, and the picture of those."""
    from peaking.mpi_file._kernels import share_colors, tiles_to_planes

    colors, is_new = np.empty_like(words), np.empty(len(words), dtype=np.bool_)
    count = share_colors(words, stacks, _none_yet(stacks), colors, is_new)
    rows, cols = _near_square(count)
    luma = np.zeros((rows, TILE_PX, cols, TILE_PX), dtype=np.uint8)
    blue, red = (np.full((rows, _HALF, cols, _HALF), 128, dtype=np.uint8) for _ in range(2))
    tiles_to_planes(colors[:count], luma, blue, red)
    jpeg = simplejpeg.encode_jpeg_yuv_planes(
        luma.reshape(-1, cols * TILE_PX),
        blue.reshape(-1, cols * _HALF),
        red.reshape(-1, cols * _HALF),
        quality,
    )
    return is_new, jpeg


def _from_pictures(payload: bytes, stacks: _Stacks) -> _Texels:
    from peaking.mpi_file._kernels import find_colors, pictures_to_tiles

    num_tiles = len(stacks)
    start = -(-num_tiles // 8) + _LENGTH_BYTES
    end = start + int.from_bytes(payload[start - _LENGTH_BYTES : start], "little")
    if end >= len(payload):
        raise MpiFileError("broken off before the picture of alpha")
    bits = np.unpackbits(np.frombuffer(payload, np.uint8, start - _LENGTH_BYTES))
    is_new = bits[:num_tiles].astype(np.bool_)
    color_of = np.empty(num_tiles, dtype=np.int32)
    find_colors(is_new, stacks, _none_yet(stacks), color_of)
    if bits[num_tiles:].any() or (color_of < 0).any():
        raise MpiFileError("a tile has the colours of a tile that is not there")

    colors = _decoded(payload[start:end], int(is_new.sum()), grey=False)
    alphas = _decoded(payload[end:], num_tiles, grey=True)
    texels = np.empty((num_tiles, TILE_PX, TILE_PX, 4), dtype=np.uint8)
    pictures_to_tiles(
        colors.view(np.uint32)[..., 0], alphas[..., 0], color_of, texels.view(np.uint32)[..., 0]
    )
    return texels


def _decoded(
    jpeg: bytes, num_tiles: int, *, grey: bool
) -> UInt8[np.ndarray, "rows 16 cols 16 channels"]:
    """Return a picture of tiles, RGBA or grey; its width says how many are beside each other."""
    width_px, height_px = baseline_size_px(jpeg, grey=grey)
    cols = max(1, width_px // TILE_PX)
    rows = -(-num_tiles // cols)
    if (width_px, height_px) != (cols * TILE_PX, rows * TILE_PX) or cols > MAX_COLS:
        raise MpiFileError(
            f"need a JPEG that {num_tiles} tiles just fill, got {width_px}x{height_px} pixels"
        )
    try:
        # Fast upsampling repeats the chroma sample, so nothing comes in from the next tile.
        picture = simplejpeg.decode_jpeg(
            jpeg, colorspace="GRAY" if grey else "RGBA", fastupsample=True
        )
    except ValueError as error:
        raise MpiFileError(f"unsound JPEG: {error}") from error
    return picture.reshape(rows, TILE_PX, cols, TILE_PX, -1)


def _near_square(num_tiles: int) -> tuple[int, int]:
    """Return rows and columns of tiles in a picture."""
    cols = min(MAX_COLS, math.ceil(math.sqrt(num_tiles)))
    return -(-num_tiles // cols), cols


@cache
def _beside() -> ThreadPoolExecutor:
    """Return threads for one of the two pictures; neither holds the interpreter's lock for long."""
    return ThreadPoolExecutor(thread_name_prefix="mpi-file")


def _alpha_jpeg(words: UInt32[np.ndarray, "tiles 256"]) -> bytes:
    """Return the picture of all tiles' alpha."""
    from peaking.mpi_file._kernels import tiles_to_alpha

    rows, cols = _near_square(len(words))
    picture = np.empty((rows, TILE_PX, cols, TILE_PX), dtype=np.uint8)
    tiles_to_alpha(words, picture)
    return simplejpeg.encode_jpeg(
        picture.reshape(rows * TILE_PX, cols * TILE_PX, 1),
        quality=ALPHA_QUALITY,
        colorspace="GRAY",
        colorsubsampling="Gray",
    )


def _none_yet(stacks: _Stacks) -> Int32[np.ndarray, "stacks"]:
    return np.full(int(stacks.max()) + 1, -1, dtype=np.int32)


def _differences(texels: _Texels) -> UInt8[np.ndarray, "tiles 4 16 16"]:
    """Return the channels one after the other, each texel minus the one to its left, mod 256."""
    channels = np.ascontiguousarray(texels.transpose(0, 3, 1, 2))
    channels[..., 1:] -= channels[..., :-1].copy()
    return channels


def _from_deflated(payload: bytes, num_tiles: int) -> _Texels:
    expected = num_tiles * _TILE_BYTES
    inflate = zlib.decompressobj()
    try:
        data = inflate.decompress(payload, expected + 1)
    except zlib.error as error:
        raise MpiFileError(f"unsound deflated texels: {error}") from error
    if len(data) != expected or not inflate.eof or inflate.unused_data:
        raise MpiFileError(f"need exactly {expected} bytes of texels for {num_tiles} tiles")
    channels = np.frombuffer(data, dtype=np.uint8).reshape(num_tiles, 4, TILE_PX, TILE_PX).copy()
    for x in range(1, TILE_PX):
        channels[..., x] += channels[..., x - 1]
    return np.ascontiguousarray(channels.transpose(0, 2, 3, 1))
