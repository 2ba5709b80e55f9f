"""What is left out of a light field fits, and its loss is what it is said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import OutputError
from peaking.light_field import LightField
from peaking.metrics.psnr_ssim import psnr
from peaking.mpi import Mpi
from peaking.mpi_file import decode, encode
from peaking.options import DEFAULT
from peaking.share import thinning
from peaking.share.compact_mpi import COMPACT, WHOLE, without_hidden
from peaking.share.recorded_files import RecordedFiles
from peaking.share.thinning import loss_db, thin
from peaking.view_builder import ViewBuilder
from recordings import lateral_cameras, write_recording

OPTIONS = replace(DEFAULT, pixels=19200)
ROUNDING_DB = 0.01
"""Of the same computation in another order; 0 measured."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> RecordedFiles:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    write_recording(folder, num_frames=9, width_px=160, height_px=120)
    return RecordedFiles(open_recording(folder), OPTIONS)


def test_all_are_kept_as_they_are_where_they_fit(files: RecordedFiles) -> None:
    thinned = thin(files, 100_000_000)
    assert list(thinned.mpis) == list(range(9))
    assert thinned.mpis[4] == files.mpi(4)
    assert thinned.loss_db is None


@pytest.mark.parametrize("room_bytes", [60_000, 100_000])
def test_what_is_kept_fits(files: RecordedFiles, room_bytes: int) -> None:
    thinned = thin(files, room_bytes, other_bytes=lambda _: 1000)
    size = sum(map(len, thinned.mpis.values())) + 1000 * len(thinned.mpis)
    assert 0.6 * room_bytes < size <= room_bytes
    assert 1 < len(thinned.mpis) < 9
    assert thinned.loss_db is not None


def test_before_views_go_images_become_compact(files: RecordedFiles) -> None:
    whole = sum(len(files.mpi(i)) for i in range(9))
    compact = sum(len(files.mpi(i, COMPACT)) for i in range(9))
    sizes: list[int] = []
    for room_bytes in (int(1.1 * whole), int(0.95 * whole), int(1.1 * compact)):
        thinned = thin(files, room_bytes)
        assert len(thinned.mpis) == 9
        sizes.append(sum(map(len, thinned.mpis.values())))
        assert sizes[-1] <= room_bytes
    assert sizes[0] == whole
    assert whole > sizes[1] > sizes[2] >= compact
    assert thinned.loss_db is not None


def test_no_more_views_than_asked_for(files: RecordedFiles) -> None:
    thinned = thin(files, 100_000_000, 3)
    assert len(thinned.mpis) == 3
    assert thinned.mpis == {i: files.mpi(i) for i in thinned.mpis}


def test_a_room_for_no_view_is_a_sentence(files: RecordedFiles) -> None:
    with pytest.raises(OutputError, match="allow more by --max-mb"):
        thin(files, 1000)


def test_where_all_seemed_to_fit_those_worth_least_go(
    files: RecordedFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    def guessed_bytes(*_: object) -> float:
        return 1.0

    monkeypatch.setattr(thinning, "_guessed_bytes", guessed_bytes)
    room_bytes = sum(len(files.mpi(i)) for i in range(9)) // 2
    kept = list(thin(files, room_bytes).mpis)
    assert 2 < len(kept) < 9
    assert sum(len(files.mpi(i)) for i in kept) <= room_bytes
    assert max(kept) > len(kept)  # not the beginning of the walk
    with pytest.raises(OutputError, match="allow more by --max-mb"):
        thin(files, min(len(files.mpi(i)) for i in range(9)) - 1)


def test_the_loss_is_that_of_pictures_that_were_not_kept(files: RecordedFiles) -> None:
    kept = {i: files.mpi(i) for i in (0, 8)}
    views = [decode(files.mpi(i)) for i in range(9)]
    expected = [
        _psnr_db(views[:i] + views[i + 1 :], files, i) - _psnr_db([views[0], views[8]], files, i)
        for i in range(1, 8)
    ]
    lost_db = loss_db(files, kept)
    assert lost_db is not None
    assert lost_db == pytest.approx(np.mean(expected), abs=ROUNDING_DB)
    assert lost_db > 1


def test_keeping_all_loses_nothing(files: RecordedFiles) -> None:
    everything = {i: files.mpi(i) for i in range(9)}
    assert loss_db(files, everything) == pytest.approx(0.0, abs=ROUNDING_DB)


def _psnr_db(views: list[Mpi], files: RecordedFiles, index: int) -> float:
    frame = ViewBuilder(OPTIONS).prepare(files.recording.read(index))
    rgb = LightField(views, OPTIONS).render(frame.camera).rgba[..., :3]
    return psnr(np.clip(rgb, 0, 1).astype(np.float64), frame.rgb / 255.0)


def _mpi_of_two_planes(near_alpha: int) -> Mpi:
    (camera,) = lateral_cameras(1, 14, 14)
    texels = np.full((2, 16, 16, 4), 255, np.uint8)
    texels[1] = near_alpha
    places = np.array([[0, 0, 0], [1, 0, 0]], np.int32)
    return Mpi(camera, np.array([2.0, 1.0]), places, texels)


def test_what_an_opaque_tile_hides_goes() -> None:
    kept = without_hidden(_mpi_of_two_planes(255), 0.1)
    assert kept.tile_places.tolist() == [[1, 0, 0]]


def test_what_shines_through_stays() -> None:
    assert len(without_hidden(_mpi_of_two_planes(128), 0.1).texels) == 2
    assert len(without_hidden(_mpi_of_two_planes(250), 0.1).texels) == 1


def test_compact_images_are_smaller(files: RecordedFiles) -> None:
    small, whole = files.mpi(3, COMPACT), files.mpi(3)
    assert len(small) < 0.8 * len(whole)
    assert decode(small).num_planes <= 16
    generated = ViewBuilder(OPTIONS).generate(files.recording.read(3))
    assert whole == encode(generated, quality=WHOLE.quality)
