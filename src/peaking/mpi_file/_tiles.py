"""The texels of a `.mpi` file: one JPEG of all tiles, or a deflated stream."""

from __future__ import annotations

import re
import zlib

import numpy as np
import simplejpeg
from jaxtyping import UInt8

from peaking.errors import MpiFileError
from peaking.mpi import TILE_PX
from peaking.mpi_file._header import Codec

_Texels = UInt8[np.ndarray, "tiles 16 16 4"]
_TILE_BYTES = TILE_PX * TILE_PX * 4

_SOF0, _DHT, _JPG, _DAC, _SOS, _EOI = 0xC0, 0xC4, 0xC8, 0xCC, 0xDA, 0xD9
_FRAMES = frozenset(range(0xC0, 0xD0)) - {_DHT, _JPG, _DAC}
"""Markers that begin a frame; all but SOF0 are progressive, arithmetic or the like."""
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7]")
"""What ends the data of a scan: any marker but a restart."""


def pack_texels(texels: _Texels, codec: Codec, atlas_cols: int, *, quality: int) -> bytes:
    """Return the payload of a file; nothing when there are no tiles."""
    if len(texels) == 0:
        return b""
    if codec == "lossless":
        return zlib.compress(_differences(texels).tobytes(), level=1)
    return _to_jpeg(texels, atlas_cols, quality)


def unpack_texels(payload: bytes, codec: Codec, num_tiles: int, atlas_cols: int) -> _Texels:
    """Return the tiles of a payload.

    Raises:
        MpiFileError: It does not hold that many tiles, or is not of the kind that the codec says.
    """
    if num_tiles == 0:
        if payload:
            raise MpiFileError(f"need no payload for no tiles, got {len(payload)} bytes")
        return np.zeros((0, TILE_PX, TILE_PX, 4), dtype=np.uint8)
    if codec == "lossless":
        return _from_deflated(payload, num_tiles)
    return _from_jpeg(payload, num_tiles, atlas_cols)


def _to_jpeg(texels: _Texels, atlas_cols: int, quality: int) -> bytes:
    from peaking.mpi_file._kernels import mean_colors, tiles_to_chroma, tiles_to_luma

    atlas_rows = -(-len(texels) // atlas_cols)
    half = TILE_PX // 2
    luma = np.zeros((2, atlas_rows, TILE_PX, atlas_cols, TILE_PX), dtype=np.uint8)
    blue, red = (
        np.full((2, atlas_rows, half, atlas_cols, half), 128, dtype=np.uint8) for _ in range(2)
    )
    words = np.ascontiguousarray(texels).view(np.uint32)[..., 0]
    means = np.empty((len(texels), 3, 2, 2), dtype=np.float32)
    mean_colors(words, means)
    tiles_to_luma(words, means, luma)
    tiles_to_chroma(words, means, blue, red)
    width_px = atlas_cols * TILE_PX
    # Two threads, each with half of the rows joined by a restart marker, gained nothing.
    return simplejpeg.encode_jpeg_yuv_planes(
        luma.reshape(-1, width_px),
        blue.reshape(-1, width_px // 2),
        red.reshape(-1, width_px // 2),
        quality,
    )


def _from_jpeg(payload: bytes, num_tiles: int, atlas_cols: int) -> _Texels:
    from peaking.mpi_file._kernels import picture_to_tiles

    atlas_rows = -(-num_tiles // atlas_cols)
    size_px = (atlas_cols * TILE_PX, 2 * atlas_rows * TILE_PX)
    got_px = _baseline_size_px(payload)
    if got_px != size_px:
        raise MpiFileError(f"need a JPEG of {size_px} pixels for {num_tiles} tiles, got {got_px}")
    try:
        # Fast upsampling repeats the chroma sample, so nothing comes in from the next tile.
        picture = simplejpeg.decode_jpeg(payload, colorspace="RGBA", fastupsample=True)
    except ValueError as error:
        raise MpiFileError(f"unsound JPEG: {error}") from error
    texels = np.empty((num_tiles, TILE_PX, TILE_PX, 4), dtype=np.uint8)
    halves = picture.view(np.uint32).reshape(2, atlas_rows, TILE_PX, atlas_cols, TILE_PX)
    picture_to_tiles(halves, texels.view(np.uint32)[..., 0])
    return texels


def _baseline_size_px(jpeg: bytes) -> tuple[int, int]:
    """Return width and height of a JPEG, when it is baseline 4:2:0 in one scan.

    Progressive pictures and pictures of many scans are refused: every scan, of a few bytes, can
    cost a decoder a walk over the whole picture.
    """
    size_px: tuple[int, int] | None = None
    if jpeg[:2] != b"\xff\xd8":
        raise MpiFileError("need a JPEG as payload")
    at = 2
    while True:
        marker, length = jpeg[at : at + 2], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        body = jpeg[at + 4 : at + 2 + length]
        if len(marker) < 2 or marker[0] != 0xFF or length < 2 or len(body) != length - 2:
            raise MpiFileError("unsound JPEG: a segment is broken off")
        at += 2 + length
        if marker[1] in _FRAMES:
            if marker[1] != _SOF0 or size_px is not None:
                raise MpiFileError("need a baseline JPEG")
            # precision, height, width, then id, sampling and table of each component
            if len(body) != 15 or body[0] != 8 or (body[7], body[10], body[13]) != (34, 17, 17):
                raise MpiFileError("need a JPEG of 8-bit YCbCr 4:2:0")
            size_px = int.from_bytes(body[3:5], "big"), int.from_bytes(body[1:3], "big")
        if marker[1] == _SOS:
            break
    after = _AFTER_SCAN.search(jpeg, at)
    if size_px is None or body[:1] != b"\x03" or after is None:
        raise MpiFileError("need a JPEG in one scan")
    if jpeg[after.start() :] != bytes([0xFF, _EOI]):
        raise MpiFileError("need a JPEG in one scan, with nothing behind it")
    return size_px


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
