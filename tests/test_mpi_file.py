from __future__ import annotations

import io
import json
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import simplejpeg
from hypothesis import given
from hypothesis import strategies as st

from peaking.errors import MpiFileError, OutputError
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.mpi_file import Codec, decode, encode, read_mpi, write_mpi

FLAT_COLOR_STEPS = 1
"""Tiles of one colour; worst seen: 1 (the 6 x 6 x 6 colours of the test)."""

PLANES_STEPS = 0.55
"""Compiled float32, rounded to 8 bits, against float64; worst seen: 0.500 (900 tiles)."""

MIN_PSNR_DB = 42.0
"""Smooth colours, soft and hard alpha; worst seen: 42.8 dB (alpha)."""

SHARED_STEPS = 3
"""Noise, shared between tiles, at quality 100, chroma of 2 x 2 texels; worst seen: 3."""

NOISE_SHARE = 0.002
"""Texels of hard-edged tiles whose alpha is neither 0 nor 255 after a JPEG; worst seen: 0.0007."""

HEADER = {
    "width_px": 20,
    "height_px": 10,
    "fx_px": 30.5,
    "fy_px": 31,
    "cx_px": 10.25,
    "cy_px": 5.0,
    "world_from_cam": [[0, 0, 1, 4.5], [1, 0, 0, -2], [0, 1, 0, 0.1]],
    "plane_depths_m": [3.0, 1.5, 0.7],
    "generator": "by hand",
    "codec": "lossless",
    "num_tiles": 2,
    "occupancy_bytes": 1,
    "payload_bytes": 0,
}
"""Three planes of one row and two columns of tiles: six places."""


def file_of(header: dict[str, Any] | bytes, body: bytes, *, version: int = 2) -> bytes:
    """Put a file together as docs/mpi-format.md says, whatever is in it."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    rest = text + body
    return (
        b"PKMPI"
        + bytes([version])
        + b"\r\n"
        + len(text).to_bytes(4, "little")
        + zlib.crc32(rest).to_bytes(4, "little")
        + rest
    )


def file_by_hand(payload: bytes, *, occupancy: bytes = b"\x48", **changed: Any) -> bytes:
    """Return a file with tiles at places 1 and 4, and some header fields changed."""
    header = {**HEADER, "payload_bytes": len(payload), "occupancy_bytes": len(occupancy)}
    return file_of({**header, **changed}, occupancy + payload)


def deflated(texels: np.ndarray) -> bytes:
    channels = texels.transpose(0, 3, 1, 2).astype(np.int64)
    left = np.zeros_like(channels)
    left[..., 1:] = channels[..., :-1]
    return zlib.compress(((channels - left) % 256).astype(np.uint8).tobytes())


def random_texels(num_tiles: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    texels = rng.integers(0, 256, (num_tiles, 16, 16, 4))
    texels[..., :3] = texels[..., :3] * texels[..., 3:] // 255
    return texels.astype(np.uint8)


def camera_of(width_px: int, height_px: int) -> Camera:
    turn, _ = cv2.Rodrigues(np.array([0.1, -0.7, 0.3]))
    pinhole = Pinhole(width_px, height_px, 210.1, 1 / 3 + 210, width_px / 2 + 0.1, 7.7)
    return Camera(pinhole, Rigid(turn.astype(np.float64), np.array([0.1, 1e-17, -3e5])))


def mpi_of(texels: np.ndarray, *, num_planes: int = 3, width_px: int = 100) -> Mpi:
    """Return an MPI with these tiles at the first places of a grid with enough of them."""
    cols = -(-(width_px + 1) // 15)
    rows = max(1, -(-len(texels) // (num_planes * cols)))
    flat = np.arange(len(texels))
    places = np.stack(np.unravel_index(flat, (num_planes, rows, cols)), axis=-1)
    return Mpi(
        camera=camera_of(width_px, rows * 15 - 1),
        plane_depths_m=1 / np.linspace(1 / 7, 3, num_planes),
        tile_places=places.astype(np.int32),
        texels=np.ascontiguousarray(texels),
        generator="Größe 学",
    )


def tile_of(rgba: tuple[int, int, int, int]) -> np.ndarray:
    return np.tile(np.array(rgba, dtype=np.uint8), (16, 16, 1))


def payload_of(data: bytes) -> bytes:
    header_bytes = int.from_bytes(data[8:12], "little")
    header = json.loads(data[16 : 16 + header_bytes])
    return data[16 + header_bytes + header["occupancy_bytes"] :]


def pictures_of(data: bytes) -> tuple[bytes, bytes, bytes]:
    """Return which tiles have new colours, the picture of colours, and that of alpha."""
    payload = payload_of(data)
    start = -(-len(decode(data).texels) // 8)
    end = start + 4 + int.from_bytes(payload[start : start + 4], "little")
    return payload[:start], payload[start + 4 : end], payload[end:]


def premultiplied(rgb: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    color = np.floor(rgb * alpha[..., None] / 255 + 0.5)
    return np.concatenate([color, alpha[..., None]], axis=-1).astype(np.uint8)


def same_but_texels(a: Mpi, b: Mpi) -> None:
    assert a.camera.pinhole == b.camera.pinhole
    assert a.camera.world_from_cam.matrix().tobytes() == b.camera.world_from_cam.matrix().tobytes()
    assert a.plane_depths_m.tobytes() == b.plane_depths_m.tobytes()
    np.testing.assert_array_equal(a.tile_places, b.tile_places)
    assert a.generator == b.generator


# By hand.


def test_a_file_put_together_by_hand() -> None:
    texels = random_texels(2)
    mpi = decode(file_by_hand(deflated(texels)))
    # places 1 and 4 of (3 planes, 1 row, 2 columns)
    np.testing.assert_array_equal(mpi.tile_places, [[0, 0, 1], [2, 0, 0]])
    np.testing.assert_array_equal(mpi.texels, texels)
    assert mpi.camera.pinhole == Pinhole(20, 10, 30.5, 31.0, 10.25, 5.0)
    np.testing.assert_array_equal(mpi.camera.forward, [1, 0, 0])
    np.testing.assert_array_equal(mpi.camera.position_m, [4.5, -2, 0.1])
    np.testing.assert_array_equal(mpi.plane_depths_m, [3.0, 1.5, 0.7])
    assert mpi.generator == "by hand"
    assert mpi.texels.flags.writeable


def test_the_bytes_that_are_written() -> None:
    mpi = decode(file_by_hand(deflated(random_texels(2))))
    data = encode(mpi, codec="lossless")
    assert data[:8] == b"PKMPI\x02\r\n"
    header_bytes = int.from_bytes(data[8:12], "little")
    assert int.from_bytes(data[12:16], "little") == zlib.crc32(data[16:])
    header = json.loads(data[16 : 16 + header_bytes])
    assert header == {**HEADER, "payload_bytes": len(data) - 17 - header_bytes}
    assert data[16 + header_bytes] == 0b01001000


def test_fields_that_a_later_writer_adds_are_left_alone() -> None:
    assert decode(file_by_hand(deflated(random_texels(2)), note={"a": [1]})).num_planes == 3


def test_a_picture_of_straight_colours_and_one_of_alpha() -> None:
    # half-transparent orange (255, 128, 0); then opaque blue; then nothing
    texels = np.stack(
        [tile_of((128, 64, 0, 128)), tile_of((0, 0, 255, 255)), tile_of((0, 0, 0, 0))]
    )
    is_new, color_jpeg, alpha_jpeg = pictures_of(encode(mpi_of(texels), quality=95))
    assert is_new == bytes([0b11100000])
    colors = simplejpeg.decode_jpeg(color_jpeg, fastupsample=True).astype(int)
    alphas = simplejpeg.decode_jpeg(alpha_jpeg, colorspace="GRAY")[..., 0].astype(int)
    # 3 tiles: ceil(sqrt(3)) = 2 columns, two rows
    assert (colors.shape, alphas.shape) == ((32, 32, 3), (32, 32))
    assert np.abs(colors[:16, :16] - (255, 128, 0)).max() <= 2
    assert np.abs(colors[:16, 16:] - (0, 0, 255)).max() <= 2
    # 16 + 128 · 96 / 255 = 64.2
    assert np.abs(alphas[:16, :16] - 64).max() <= 1
    assert np.abs(alphas[:16, 16:] - 128).max() <= 1
    assert (alphas[16:, :16] <= 1).all()


def test_tiles_behind_each_other_share_colours() -> None:
    """Four planes of one place: a photo faded out, again, something else, again something else."""
    photo = np.random.default_rng(2).integers(0, 256, (16, 16, 3)).repeat(2, 0).repeat(2, 1)
    photo = photo[:16, :16]
    left, right = (np.indices((16, 16))[1] < 9).astype(int), np.indices((16, 16))[1] >= 7
    tiles = [
        premultiplied(photo, 255 * left),
        premultiplied(photo, 77 * right),
        premultiplied(255 - photo, np.full((16, 16), 200)),
        premultiplied(255 - photo, np.full((16, 16), 31)),
    ]
    mpi = mpi_of(np.stack(tiles), num_planes=4, width_px=9)
    assert len(np.unique(mpi.tile_places[:, 1:], axis=0)) == 1
    data = encode(mpi, quality=100)
    is_new, color_jpeg, _ = pictures_of(data)
    assert is_new == bytes([0b10100000])
    assert simplejpeg.decode_jpeg_header(color_jpeg)[:2] == (16, 32)
    error = decode(data).texels.astype(int) - mpi.texels
    assert np.abs(error).max() <= SHARED_STEPS


def test_no_tiles() -> None:
    for codec in ("jpeg", "lossless"):
        mpi = mpi_of(np.zeros((0, 16, 16, 4), dtype=np.uint8))
        back = decode(encode(mpi, codec=codec))
        same_but_texels(back, mpi)
        assert back.texels.shape == (0, 16, 16, 4)


# Laws.


@given(num_tiles=st.integers(0, 60), num_planes=st.integers(1, 9), seed=st.integers(0, 999))
def test_lossless_gives_everything_back(num_tiles: int, num_planes: int, seed: int) -> None:
    mpi = mpi_of(random_texels(num_tiles, seed), num_planes=num_planes)
    back = decode(encode(mpi, codec="lossless"))
    same_but_texels(back, mpi)
    np.testing.assert_array_equal(back.texels, mpi.texels)


@given(num_tiles=st.integers(0, 60), quality=st.integers(1, 100), seed=st.integers(0, 999))
def test_jpeg_keeps_all_but_texels_and_stays_premultiplied(
    num_tiles: int, quality: int, seed: int
) -> None:
    mpi = mpi_of(random_texels(num_tiles, seed))
    back = decode(encode(mpi, quality=quality))
    same_but_texels(back, mpi)
    assert back.texels.shape == mpi.texels.shape
    assert (back.texels[..., :3] <= back.texels[..., 3:]).all()


def test_random_places_come_back() -> None:
    rng = np.random.default_rng(3)
    planes = np.zeros((5, 70, 90, 4), dtype=np.uint8)
    planes[rng.random((5, 70, 90)) < 0.003] = 255
    mpi = Mpi.from_dense(planes, 1 / np.linspace(0.2, 1, 5), camera_of(90, 70))
    assert 0 < len(mpi.texels) < 5 * 5 * 7
    np.testing.assert_array_equal(decode(encode(mpi, codec="lossless")).dense(), planes)
    np.testing.assert_array_equal(decode(encode(mpi)).tile_places, mpi.tile_places)


def test_flat_colours_do_not_run_into_the_next_tile() -> None:
    levels = [0, 51, 102, 153, 204, 255]
    colors = np.array(np.meshgrid(levels, levels, levels)).reshape(3, -1).T
    np.random.default_rng(1).shuffle(colors)
    texels = np.full((len(colors), 16, 16, 4), 255, dtype=np.uint8)
    texels[..., :3] = colors[:, None, None]
    back = decode(encode(mpi_of(texels))).texels
    assert (back[..., 3] == 255).all()
    assert np.abs(back.astype(int) - texels).max() <= FLAT_COLOR_STEPS


@pytest.mark.parametrize("alpha", range(0, 256, 5))
def test_a_flat_alpha_comes_back(alpha: int) -> None:
    texels = tile_of((alpha, alpha, alpha, alpha))[None]
    back = decode(encode(mpi_of(texels))).texels[..., 3].astype(int)
    assert np.abs(back - alpha).max() <= (0 if alpha in (0, 255) else 1)


def test_noise_at_the_ends_of_alpha_is_cut_off() -> None:
    texels = np.zeros((30, 16, 16, 4), dtype=np.uint8)
    for i in range(30):
        texels[i, :, : i % 16] = texels[i, : i // 2] = (90, 120, 60, 255)
    alpha = texels[..., 3]
    wrong = decode(encode(mpi_of(texels))).texels[..., 3] != alpha
    assert wrong.mean() <= NOISE_SHARE


def soft_mpi() -> Mpi:
    """Return smooth colours with soft slopes, holes and hard edges in alpha."""
    y, x = np.mgrid[0:160, 0:120] / 40.0
    color = 0.5 + 0.4 * np.stack([np.sin(x), np.cos(y + x), np.sin(1.5 * y)], axis=-1)
    planes = np.zeros((4, 160, 120, 4))
    for i in range(4):
        slope = np.clip(np.sin(x * (i + 1)) + np.cos(y * 1.3 + i), 0, 1)
        alpha = np.where((x + i) % 2 < 1, slope, (y % 2 < 1).astype(float))
        planes[i] = np.dstack([color * alpha[..., None], alpha])
    return Mpi.from_dense(
        np.round(255 * planes).astype(np.uint8), 1 / np.linspace(0.3, 2, 4), camera_of(120, 160)
    )


def test_what_the_jpeg_loses() -> None:
    mpi = soft_mpi()
    back = decode(encode(mpi)).texels.astype(float)
    for channels in (slice(0, 3), slice(3, 4)):
        error = back[..., channels] - mpi.texels[..., channels]
        assert 20 * np.log10(255 / np.sqrt(np.mean(error**2))) > MIN_PSNR_DB
    assert len(encode(mpi)) < len(encode(mpi, codec="lossless")) / 2


# The compiled path against float64.


def planes_by_numpy(tile: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return Y, Cb, Cr and stored alpha of one tile, by the formulas of docs/mpi-format.md."""

    def ycc(rgb: np.ndarray) -> np.ndarray:
        y = rgb @ (0.299, 0.587, 0.114)
        return np.stack(
            [y, 128 + (rgb[..., 2] - y) / 1.772, 128 + (rgb[..., 0] - y) / 1.402], axis=-1
        )

    def straight(rgba: np.ndarray) -> np.ndarray:
        return 255 * rgba[..., :3] / np.maximum(rgba[..., 3:], 1)

    rgba = tile.astype(np.float64)
    blocks = rgba.reshape(2, 8, 2, 8, 4).sum(axis=(1, 3))
    quads = rgba.reshape(8, 2, 8, 2, 4).sum(axis=(1, 3))
    fill = np.where(blocks[..., 3:] > 0, straight(blocks), straight(blocks.sum(axis=(0, 1))))
    fill_of_texel = fill.repeat(8, axis=0).repeat(8, axis=1)
    fill_of_quad = fill.repeat(4, axis=0).repeat(4, axis=1)
    luma = ycc(np.where(rgba[..., 3:] > 0, straight(rgba), fill_of_texel))[..., 0]
    chroma = ycc(np.where(quads[..., 3:] > 0, straight(quads), fill_of_quad))
    alpha = rgba[..., 3]
    stored = np.where(alpha == 0, 0, np.where(alpha == 255, 128, 16 + alpha * 96 / 255))
    return tuple(np.clip(p, 0, 255) for p in (luma, chroma[..., 1], chroma[..., 2], stored))


@given(seed=st.integers(0, 9999), empty=st.floats(0, 1))
def test_the_written_planes_agree_with_float64(seed: int, empty: float) -> None:
    from peaking.mpi_file import _kernels

    texels = random_texels(3, seed)
    rng = np.random.default_rng(seed)
    texels[rng.random((3, 16, 16)) < empty] = 0
    texels[1, :8, :8] = 0
    words = texels.view(np.uint32)[..., 0]
    luma = np.zeros((2, 16, 2, 16), dtype=np.uint8)
    blue, red = (np.zeros((2, 8, 2, 8), dtype=np.uint8) for _ in range(2))
    _kernels.tiles_to_planes(words.reshape(3, 256), luma, blue, red)
    alphas = np.empty((2, 16, 2, 16), dtype=np.uint8)
    own, is_new, none_yet = (
        np.empty((3, 256), np.uint32),
        np.empty(3, bool),
        np.full(3, -1, np.int32),
    )
    stacks = np.arange(3, dtype=np.int32)
    assert _kernels.share_colors(words.reshape(3, 256), stacks, none_yet, own, is_new) == 3
    _kernels.tiles_to_alpha(words.reshape(3, 256), alphas)
    assert alphas[1, :, 1].max() == 0
    np.testing.assert_array_equal(own.reshape(3, 16, 16), words)
    for i in range(3):
        row, col = divmod(i, 2)
        got = (plane[row, :, col] for plane in (luma, blue, red, alphas))
        for mine, expected in zip(got, planes_by_numpy(texels[i]), strict=True):
            assert np.abs(mine - expected).max() <= PLANES_STEPS


@given(seed=st.integers(0, 9999), num_stacks=st.integers(1, 4))
def test_shared_colours_are_those_of_every_tile(seed: int, num_stacks: int) -> None:
    """Few colours and many alphas, in float64: no tile gets a colour that is not its own."""
    from peaking.mpi_file import _kernels

    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (3, 16, 16, 3))
    alphas = rng.integers(0, 256, (12, 16, 16)) * (rng.random((12, 16, 16)) < 0.8)
    texels = np.stack([premultiplied(palette[rng.integers(3)], alpha) for alpha in alphas])
    stacks = rng.integers(0, num_stacks, 12).astype(np.int32)
    words = texels.view(np.uint32).reshape(12, 256)
    colors, is_new = np.empty_like(words), np.empty(12, dtype=bool)
    none_yet = np.full(num_stacks, -1, dtype=np.int32)
    count = _kernels.share_colors(words, stacks, none_yet.copy(), colors, is_new)
    assert is_new.sum() == count
    color_of = np.empty(12, dtype=np.int32)
    _kernels.find_colors(is_new, stacks, none_yet, color_of)
    shared = colors.view(np.uint8).reshape(12, 16, 16, 4)[color_of].astype(np.float64)
    assert (shared[..., 3] >= texels[..., 3]).all()
    mine = texels.astype(np.float64)
    # Times the other's alpha both are the same, but for a step of rounding each.
    apart = np.abs(mine[..., :3] * shared[..., 3:] - shared[..., :3] * mine[..., 3:])
    assert (apart <= mine[..., 3:] + shared[..., 3:]).all()


def test_find_colors_tells_of_a_tile_without_any() -> None:
    from peaking.mpi_file import _kernels

    is_new = np.array([True, False, True, False, False])
    stacks = np.array([1, 1, 0, 1, 2], dtype=np.int32)
    color_of = np.empty(5, dtype=np.int32)
    _kernels.find_colors(is_new, stacks, np.full(3, -1, np.int32), color_of)
    assert color_of.tolist() == [0, 0, 1, 0, -1]


@given(seed=st.integers(0, 9999))
def test_the_read_texels_agree_with_float64(seed: int) -> None:
    from peaking.mpi_file import _kernels

    rng = np.random.default_rng(seed)
    colors = rng.integers(0, 2**32, (2, 16, 2, 16), dtype=np.uint32)
    alphas = rng.integers(0, 256, (2, 16, 3, 16), dtype=np.uint8)
    color_of = rng.integers(0, 4, 5).astype(np.int32)
    words = np.empty((5, 16, 16), dtype=np.uint32)
    _kernels.pictures_to_tiles(colors, alphas, color_of, words)
    rgba = colors.view(np.uint8).reshape(2, 16, 2, 16, 4).transpose(0, 2, 1, 3, 4)
    rgb = rgba.reshape(4, 16, 16, 4)[color_of, ..., :3].astype(np.float64)
    stored = alphas.transpose(0, 2, 1, 3).reshape(6, 16, 16)[:5].astype(np.float64)
    alpha = np.clip(np.floor((stored - 16) * 255 / 96 + 0.5), 0, 255)[..., None]
    expected = np.concatenate([np.floor(rgb * alpha / 255 + 0.5), alpha], axis=-1)
    np.testing.assert_array_equal(words.view(np.uint8).reshape(5, 16, 16, 4), expected)


# Bad input.


def test_encode_refuses() -> None:
    mpi = mpi_of(random_texels(4))
    for quality in (0, 101):
        with pytest.raises(ValueError, match=r"quality of 1\.\.100"):
            encode(mpi, quality=quality)
    with pytest.raises(ValueError, match="sorted"):
        encode(replace(mpi, tile_places=mpi.tile_places[::-1].copy()))
    with pytest.raises(ValueError, match="sorted"):
        encode(replace(mpi, tile_places=np.zeros_like(mpi.tile_places)))
    for place in ([-1, 0, 0], [3, 0, 0], [0, 9, 0], [0, 0, 99]):
        places = mpi.tile_places.copy()
        places[0] = place
        with pytest.raises(ValueError, match="inside planes"):
            encode(replace(mpi, tile_places=places))
    with pytest.raises(ValueError, match="at most 1024 planes"):
        encode(replace(mpi, plane_depths_m=np.linspace(9, 1, 1025)))
    sheared = replace(mpi.camera, world_from_cam=Rigid(np.ones((3, 3)), np.zeros(3)))
    with pytest.raises(ValueError, match="rotation"):
        encode(replace(mpi, camera=sheared))
    with pytest.raises(ValueError, match="16384 pixels"):
        encode(replace(mpi, camera=camera_of(16385, 9)))
    with pytest.raises(ValueError, match="header of at most"):
        encode(replace(mpi, generator="x" * 2**20))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("width_px", 0, "width_px|size"),
        ("width_px", 16385, "width_px"),
        ("width_px", 20.5, "width_px"),
        ("width_px", True, "width_px"),
        ("height_px", "10", "height_px"),
        ("fx_px", 0, "focal"),
        ("fy_px", -1.0, "focal"),
        ("fy_px", None, "fy_px"),
        ("cx_px", 10**400, "cx_px"),
        ("cy_px", float("nan"), "NaN"),
        ("cy_px", float("inf"), "Infinity"),
        ("world_from_cam", [[1, 0, 0, 0], [0, 1, 0, 0]], "world_from_cam"),
        ("world_from_cam", [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "world_from_cam"),
        ("world_from_cam", [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]], "mirror"),
        ("world_from_cam", [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "rotation"),
        ("world_from_cam", [[1e300, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "rotation"),
        ("world_from_cam", [[1, 0, 0, 0], [0, 1, 0, 0], {"a": 1}], "world_from_cam"),
        ("plane_depths_m", [], "plane_depths_m"),
        ("plane_depths_m", [1.0] * 1025, "plane_depths_m"),
        ("plane_depths_m", [1.0, 2.0, 3.0], "farthest"),
        ("plane_depths_m", [3.0, 2.0, 0.0], "depths > 0"),
        ("plane_depths_m", [3.0, 2.0], "occupancy|bits"),
        ("generator", 7, "generator"),
        ("generator", "\ud800", "unsound header"),
        ("codec", "webp", "codec"),
        ("num_tiles", 3, "bits are set"),
        ("num_tiles", 7, "at most 6 tiles"),
        ("num_tiles", -1, "num_tiles"),
        ("num_tiles", 10**5, "num_tiles"),
        ("occupancy_bytes", 2, "promises"),
        ("payload_bytes", 10**30, "payload_bytes"),
        ("payload_bytes", 3, "promises"),
    ],
)
def test_headers_that_are_refused(field: str, value: object, message: str) -> None:
    payload = deflated(random_texels(2))
    changed: dict[str, Any] = {field: value}
    with pytest.raises(MpiFileError, match=message):
        decode(file_by_hand(payload, **changed))
    if field not in ("codec", "occupancy_bytes", "payload_bytes", "num_tiles"):
        header = {**HEADER, "payload_bytes": len(payload)}
        del header[field]
        with pytest.raises(MpiFileError, match=f"{field} is missing"):
            decode(file_of(header, b"\x48" + payload))


@pytest.mark.parametrize(
    "text", [b"", b"[]", b"7", b"{", b"\xff", b"[" * 10**5, b"{}", b"1" * 5000]
)
def test_headers_that_are_no_object(text: bytes) -> None:
    with pytest.raises(MpiFileError, match="unsound header"):
        decode(file_of(text, b""))


def test_bits_behind_the_last_place() -> None:
    payload = deflated(random_texels(2))
    with pytest.raises(MpiFileError, match="after the last place"):
        decode(file_by_hand(payload, occupancy=b"\x41"))
    with pytest.raises(MpiFileError, match="need 1 bytes of occupancy"):
        decode(file_by_hand(payload, occupancy=b"\x48\x00"))


def test_places_beyond_any_memory() -> None:
    depths_m = np.linspace(9, 1, 1000).tolist()
    data = file_by_hand(b"", width_px=4096, height_px=4096, plane_depths_m=depths_m)
    with pytest.raises(MpiFileError, match="places of tiles"):
        decode(data)


@pytest.mark.parametrize("size_px", [(16384, 16384), (16384, 1025), (4097, 4096)])
def test_pictures_beyond_any_memory(size_px: tuple[int, int]) -> None:
    """What renders at the camera's size would take 17 bytes a pixel, of a file of 37 kB."""
    width, height = size_px
    places = -(-(width + 1) // 15) * -(-(height + 1) // 15)
    depths = {"plane_depths_m": [1.0], "num_tiles": 0, "width_px": width, "height_px": height}
    data = file_by_hand(b"", occupancy=bytes(-(-places // 8)), **depths)
    with pytest.raises(MpiFileError, match="at most 16777216 pixels"):
        decode(data)


def test_large_pictures_are_read() -> None:
    """8 megapixels, ten times the size of a phone's screen."""
    places = -(-(4096 + 1) // 15) * -(-(2048 + 1) // 15)
    depths = {"plane_depths_m": [1.0], "num_tiles": 0, "width_px": 4096, "height_px": 2048}
    data = file_by_hand(b"", occupancy=bytes(-(-places // 8)), **depths)
    assert decode(data).camera.pinhole.size_px == (4096, 2048)


def test_frames_that_are_refused() -> None:
    good = encode(mpi_of(random_texels(3)))
    with pytest.raises(MpiFileError, match="begin with PKMPI"):
        decode(b"")
    with pytest.raises(MpiFileError, match="begin with PKMPI"):
        decode(good.replace(b"\r\n", b"\n", 1))
    with pytest.raises(MpiFileError, match="version 1, and this program reads version 2"):
        decode(good[:5] + b"\x01" + good[6:])
    with pytest.raises(MpiFileError, match="broken off after 9"):
        decode(good[:9])
    with pytest.raises(MpiFileError, match="inside the header"):
        decode(good[:60])
    with pytest.raises(MpiFileError, match="checksum"):
        decode(good[:-1])
    with pytest.raises(MpiFileError, match="checksum"):
        decode(good + b"\0")
    with pytest.raises(MpiFileError, match="header of at most"):
        decode(good[:8] + b"\xff" * 4 + good[12:])


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"no stream",
        deflated(random_texels(1)),
        deflated(random_texels(3)),
        deflated(random_texels(2)) + b"\0",
        deflated(random_texels(2))[:-5],
        zlib.compress(bytes(10**8)),
    ],
    ids=["empty", "none", "one tile", "three tiles", "more behind", "broken off", "bomb"],
)
def test_deflated_payloads_that_are_refused(payload: bytes) -> None:
    with pytest.raises(MpiFileError, match="texels"):
        decode(file_by_hand(payload))


def jpeg(*, width_px: int = 32, height_px: int = 16, flags: tuple[int, ...] = ()) -> bytes:
    """Return a 4:2:0 JPEG; two tiles fill 32 x 16."""
    image = np.random.default_rng(0).integers(0, 256, (height_px, width_px, 3), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", image, flags)
    assert done
    return data.tobytes()


def twice_scanned(data: bytes) -> bytes:
    return data[:-2] + data[data.index(b"\xff\xda") :]


def grey_jpeg(*, width_px: int = 32, height_px: int = 16) -> bytes:
    image = np.random.default_rng(1).integers(0, 256, (height_px, width_px), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", image)
    assert done
    return data.tobytes()


def payload_by_hand(color_jpeg: bytes, alpha_jpeg: bytes, *, is_new: bytes = b"\xc0") -> bytes:
    return is_new + len(color_jpeg).to_bytes(4, "little") + color_jpeg + alpha_jpeg


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (b"", "need a JPEG"),
        (b"\xff\xd8", "broken off"),
        (jpeg()[:200], "broken off"),
        (jpeg()[:-2], "one scan"),
        (jpeg() + b"\0", "one scan"),
        (jpeg() + jpeg(), "one scan"),
        (twice_scanned(jpeg()), "one scan"),
        (jpeg(width_px=48, height_px=32), "just fill"),
        (jpeg(width_px=40), "just fill"),
        (jpeg(height_px=32), "just fill"),
        (jpeg(width_px=8), "just fill"),
        (grey_jpeg(), "4:2:0"),
        (jpeg(flags=(cv2.IMWRITE_JPEG_PROGRESSIVE, 1)), "baseline"),
        (jpeg(flags=(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111)), "4:2:0"),
        (jpeg()[:700] + b"\xff\xd9", "unsound JPEG"),
        (b"\xff\xd8" + jpeg()[jpeg().index(b"\xff\xc0") :], "unsound JPEG"),
        (b"\xff\xd8" + jpeg()[jpeg().index(b"\xff\xda") :], "one scan"),
    ],
)
def test_jpegs_that_are_refused(picture: bytes, message: str) -> None:
    with pytest.raises(MpiFileError, match=message):
        decode(file_by_hand(payload_by_hand(picture, grey_jpeg()), codec="jpeg"))


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (b"", "picture of alpha"),
        (b"\xc0\0\0", "picture of alpha"),
        (payload_by_hand(jpeg(), b""), "picture of alpha"),
        (b"\xc0\xff\xff\xff\xff" + jpeg() + grey_jpeg(), "picture of alpha"),
        (payload_by_hand(jpeg(), jpeg()), "grey"),
        (payload_by_hand(jpeg(), grey_jpeg(height_px=32)), "just fill"),
        (payload_by_hand(jpeg(), grey_jpeg()[:-2]), "one scan"),
        (payload_by_hand(jpeg(), grey_jpeg(), is_new=b"\x80"), "not there"),
        (payload_by_hand(jpeg(), grey_jpeg(), is_new=b"\xc1"), "not there"),
    ],
)
def test_pictures_that_do_not_go_together(payload: bytes, message: str) -> None:
    with pytest.raises(MpiFileError, match=message):
        decode(file_by_hand(payload, codec="jpeg"))


def test_jpegs_of_another_writer_are_read() -> None:
    plain = jpeg(width_px=16, height_px=32, flags=(cv2.IMWRITE_JPEG_RST_INTERVAL, 1))
    assert len(decode(file_by_hand(payload_by_hand(plain, grey_jpeg()), codec="jpeg")).texels) == 2


# Whatever comes, an Mpi or an MpiFileError.


def survives(data: bytes) -> None:
    try:
        mpi = decode(data)
    except MpiFileError:
        return
    assert len(mpi.texels) == len(mpi.tile_places)
    assert mpi.tile_index.max() < len(mpi.texels)


def resealed(data: bytes) -> bytes:
    """Return the file with a checksum that fits, so that what lies behind it is looked at."""
    return data[:12] + zlib.crc32(data[16:]).to_bytes(4, "little") + data[16:]


GOOD = [encode(mpi_of(random_texels(7)), codec=c, quality=50) for c in ("jpeg", "lossless")]
EDITS = st.lists(st.tuples(st.integers(0, 10**6), st.binary(max_size=4)), min_size=1, max_size=6)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=12,
)


@given(data=st.binary(max_size=200))
def test_random_bytes(data: bytes) -> None:
    survives(data)
    survives(b"PKMPI\x02\r\n" + data)
    survives(file_of(data, data))


@given(good=st.sampled_from(GOOD), edits=EDITS, cut=st.integers(0, 10**6), sealed=st.booleans())
def test_damaged_files(good: bytes, edits: list[tuple[int, bytes]], cut: int, sealed: bool) -> None:
    data = bytearray(good)
    for at, piece in edits:
        at = 12 + at % (len(good) - 12)
        data[at : at + len(piece)] = piece
    cut_off = bytes(data[: 16 + cut % (2 * len(good))])
    survives(resealed(cut_off) if sealed else cut_off)


@given(good=st.sampled_from(GOOD), name=st.sampled_from(sorted(HEADER)), value=JSON)
def test_other_headers(good: bytes, name: str, value: object) -> None:
    header_bytes = int.from_bytes(good[8:12], "little")
    header = json.loads(good[16 : 16 + header_bytes])
    header[name] = value
    survives(file_of(header, good[16 + header_bytes :]))


# On disk.


def test_the_example_of_the_document_reads_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = Path(__file__).parents[1] / "docs" / "mpi-format.md"
    example = document.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    mpi = soft_mpi()
    write_mpi(tmp_path / "a.mpi", mpi)
    monkeypatch.chdir(tmp_path)
    read: dict[str, Any] = {}
    exec(example, read)
    places = np.stack([read["plane"], read["row"], read["col"]], axis=-1)
    np.testing.assert_array_equal(places, mpi.tile_places)
    texels = decode(encode(mpi)).texels.astype(float)
    np.testing.assert_array_equal(read["alpha"], texels[..., 3])
    colors = read["straight"] * read["alpha"][..., None] / 255
    assert np.abs(colors - texels[..., :3]).mean() < 1.5  # 1.2: that reader interpolates chroma


@pytest.mark.parametrize("codec", ["jpeg", "lossless"])
def test_write_and_read(tmp_path: Path, codec: Codec) -> None:
    mpi = mpi_of(random_texels(5))
    path = tmp_path / "deeper" / "a.mpi"
    write_mpi(path, replace(mpi, generator="first"), codec=codec)
    write_mpi(path, mpi, codec=codec)
    same_but_texels(read_mpi(path), mpi)
    assert path.read_bytes() == encode(mpi, codec=codec)
    assert [p.name for p in path.parent.iterdir()] == ["a.mpi"]


def test_messages_name_the_file(tmp_path: Path) -> None:
    missing, folder, broken = (tmp_path / name for name in ("missing", "folder", "broken"))
    folder.mkdir()
    broken.write_bytes(b"PKMPI\x02\r\n")
    for path in (missing, folder, broken):
        with pytest.raises(MpiFileError, match=f"/{path.name}: "):
            read_mpi(path)


def test_a_folder_is_not_written_over(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is a folder"):
        write_mpi(tmp_path, mpi_of(random_texels(1)))


def test_a_file_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    class Endless(io.RawIOBase):
        def read(self, size: int = -1, /) -> bytes:
            assert 0 < size < 2**29
            return b"PKMPI\x02\r\n" + bytes(size - 8)

    def endless(_path: Path, _mode: str) -> Endless:
        return Endless()

    monkeypatch.setattr(Path, "open", endless)
    with pytest.raises(MpiFileError, match="at most"):
        read_mpi(Path("endless.mpi"))
