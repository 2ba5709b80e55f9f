from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.mpi import CELL_PX, TILE_PX, Mpi, tile_grid

SIDES_PX = st.integers(1, 50)


def camera_of(width_px: int, height_px: int) -> Camera:
    pinhole = Pinhole(width_px, height_px, 40.0, 41.0, width_px / 2, height_px / 2)
    return Camera(pinhole, Rigid[World, Cam].identity())


def random_planes(num_planes: int, width_px: int, height_px: int, seed: int) -> np.ndarray:
    """Return premultiplied RGBA with large empty parts."""
    rng = np.random.default_rng(seed)
    alpha = rng.integers(0, 256, (num_planes, height_px, width_px, 1))
    alpha *= rng.random((num_planes, height_px, width_px, 1)) < 0.02
    color = rng.integers(0, 256, (num_planes, height_px, width_px, 3)) * alpha // 255
    return np.concatenate([color, alpha], axis=-1).astype(np.uint8)


def depths_of(num_planes: int) -> np.ndarray:
    return 1.0 / np.linspace(0.25, 2.0, num_planes)


def mpi_of(planes: np.ndarray) -> Mpi:
    num_planes, height, width = planes.shape[:3]
    return Mpi.from_dense(planes, depths_of(num_planes), camera_of(width, height), generator="t")


@pytest.mark.parametrize(
    ("size_px", "rows_cols"),
    [
        # a rim of one texel lies before the picture, so 14 texels fill the first cell
        ((1, 1), (1, 1)),
        ((14, 14), (1, 1)),
        ((15, 14), (1, 2)),
        ((14, 15), (2, 1)),
        ((29, 30), (3, 2)),
        ((294, 639), (43, 20)),
    ],
)
def test_tile_grid(size_px: tuple[int, int], rows_cols: tuple[int, int]) -> None:
    assert tile_grid(*size_px) == rows_cols


def test_one_texel_inside_one_cell() -> None:
    planes = np.zeros((2, 40, 40, 4), dtype=np.uint8)
    planes[1, 20, 5] = (10, 20, 30, 40)
    mpi = mpi_of(planes)
    # texel (20, 5) is (21, 6) behind the rim: row 1, column 0, and there texel (6, 6)
    np.testing.assert_array_equal(mpi.tile_places, [[1, 1, 0]])
    expected = np.zeros((TILE_PX, TILE_PX, 4), dtype=np.uint8)
    expected[6, 6] = (10, 20, 30, 40)
    np.testing.assert_array_equal(mpi.texels[0], expected)
    assert mpi.generator == "t"


def test_a_texel_on_the_corner_of_a_cell_is_in_four_tiles() -> None:
    planes = np.zeros((1, 40, 40, 4), dtype=np.uint8)
    planes[0, 14, 14] = 200
    mpi = mpi_of(planes)
    np.testing.assert_array_equal(mpi.tile_places[:, 1:], [[0, 0], [0, 1], [1, 0], [1, 1]])
    spots = [(15, 15), (15, 0), (0, 15), (0, 0)]
    for tile, spot in zip(mpi.texels, spots, strict=True):
        assert tile[spot].tolist() == [200] * 4
        assert np.count_nonzero(tile[..., 3]) == 1


def test_the_rim_before_the_picture_is_transparent() -> None:
    tiles = mpi_of(np.full((1, 20, 20, 4), 255, dtype=np.uint8)).texels
    assert not tiles[0][0].any()
    assert not tiles[0][:, 0].any()
    assert (tiles[0][1:, 1:] == 255).all()


@given(width_px=SIDES_PX, height_px=SIDES_PX, num_planes=st.integers(1, 4), seed=st.integers(0, 99))
def test_dense_undoes_from_dense(width_px: int, height_px: int, num_planes: int, seed: int) -> None:
    planes = random_planes(num_planes, width_px, height_px, seed)
    mpi = mpi_of(planes)
    np.testing.assert_array_equal(mpi.dense(), planes)
    assert (mpi.texels[..., 3].max(axis=(1, 2), initial=0) > 0).all()


@given(seed=st.integers(0, 99))
def test_aprons_repeat_the_next_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mpi = mpi_of(rng.integers(1, 256, (1, 44, 44, 4)).astype(np.uint8))
    rows, cols = tile_grid(44, 44)
    tiles = mpi.texels[mpi.tile_index[0]]
    assert tiles.shape[:2] == (rows, cols)
    np.testing.assert_array_equal(tiles[:, :-1, :, CELL_PX], tiles[:, 1:, :, 0])
    np.testing.assert_array_equal(tiles[:-1, :, CELL_PX], tiles[1:, :, 0])


@given(seed=st.integers(0, 99))
def test_tiles_are_sorted_and_the_index_finds_them(seed: int) -> None:
    mpi = mpi_of(random_planes(3, 70, 40, seed))
    assert mpi.tile_places.tolist() == sorted(mpi.tile_places.tolist())
    index = mpi.tile_index
    assert index.shape == (3, *tile_grid(70, 40))
    np.testing.assert_array_equal(np.argwhere(index >= 0), mpi.tile_places)
    np.testing.assert_array_equal(index[index >= 0], np.arange(len(mpi.texels)))


def test_nothing_in_any_plane_is_an_mpi_without_tiles() -> None:
    mpi = mpi_of(np.zeros((2, 9, 9, 4), dtype=np.uint8))
    assert mpi.texels.shape == (0, 16, 16, 4)
    assert not mpi.dense().any()
    assert (mpi.tile_index == -1).all()


def test_scaled_moves_planes_only() -> None:
    mpi = mpi_of(random_planes(3, 20, 20, 1))
    farther = mpi.scaled(2.5)
    np.testing.assert_array_equal(farther.plane_depths_m, 2.5 * mpi.plane_depths_m)
    assert farther.texels is mpi.texels
    assert farther.camera == mpi.camera


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scaled_refuses(scale: float) -> None:
    with pytest.raises(ValueError, match="scale > 0"):
        mpi_of(random_planes(2, 9, 9, 0)).scaled(scale)


@pytest.mark.parametrize(
    ("depths_m", "message"),
    [
        ([], "finite plane depths"),
        ([2.0, np.nan], "finite plane depths"),
        ([np.inf, 1.0], "finite plane depths"),
        ([2.0, 0.0], "finite plane depths"),
        ([2.0, -1.0], "finite plane depths"),
        ([1.0, 2.0], "farthest to the nearest"),
        ([2.0, 2.0], "farthest to the nearest"),
    ],
)
def test_depths_that_are_refused(depths_m: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Mpi(
            camera=camera_of(9, 9),
            plane_depths_m=np.array(depths_m, dtype=np.float64),
            tile_places=np.zeros((0, 3), dtype=np.int32),
            texels=np.zeros((0, 16, 16, 4), dtype=np.uint8),
        )


def test_a_place_for_every_tile() -> None:
    # The checker of shapes, which tests have switched on, says it first and as a TypeError.
    with pytest.raises((ValueError, TypeError)):
        Mpi(
            camera=camera_of(9, 9),
            plane_depths_m=np.array([1.0]),
            tile_places=np.zeros((1, 3), dtype=np.int32),
            texels=np.zeros((2, 16, 16, 4), dtype=np.uint8),
        )
