"""Gaussians of a place: what each shows, what fits, and the world they are in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import OutputError, RecordingError
from peaking.export.splats import read_splats, upright, write_splats
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.options import DEFAULT
from peaking.share.file_place import place_of_splats
from peaking.share.recorded_files import RecordedFiles
from peaking.share.splat import (
    contributions,
    fitted,
    frames_of,
    loss_db,
    mean_psnr_db,
    read_in_world,
    sizes,
    trained,
)
from peaking.splat.gaussians import Gaussians
from peaking.splat.options import SplatOptions
from peaking.splat.rasterise import render
from recordings import write_recording

CAMERA = Camera(Pinhole(64, 48, 60.0, 60.0, 32.0, 24.0), Rigid.identity())
OF_FLOAT32 = 1e-4
"""Relative; 2e-6 measured."""


def row_of(*, depths_m: list[float], opacity: float = 0.9, size_m: float = 0.1) -> Gaussians:
    """Return round Gaussians on the camera's axis, bright and of degree 1."""
    count = len(depths_m)
    return Gaussians(
        means_m=np.array([[0.0, 0.0, z] for z in depths_m], np.float32),
        log_scales=np.full((count, 3), np.log(size_m), np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        opacity_logits=np.full(count, np.log(opacity / (1 - opacity)), np.float32),
        sh=np.full((count, 4, 3), 0.3, np.float32),
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> RecordedFiles:
    folder = tmp_path_factory.mktemp("rooms") / "room"
    write_recording(folder, num_frames=6, width_px=160, height_px=120)
    return RecordedFiles(open_recording(folder), replace(DEFAULT, pixels=19200))


@pytest.fixture(scope="module")
def frames(files: RecordedFiles) -> list[Frame]:
    return frames_of(files)


@pytest.fixture(scope="module")
def gaussians(files: RecordedFiles, frames: list[Frame]) -> Gaussians:
    options = SplatOptions(iterations=60, max_init_points=1500, max_gaussians=2500)
    return trained(frames, files.recording.path, options)


def test_one_gaussian_makes_up_what_its_opacity_covers() -> None:
    one = row_of(depths_m=[2.0])
    covered = float(render(one, CAMERA).alpha.sum())
    assert contributions(one, [CAMERA]) == pytest.approx([covered], rel=OF_FLOAT32)
    assert contributions(one, [CAMERA] * 3) == pytest.approx([3 * covered], rel=OF_FLOAT32)


def test_all_together_make_up_the_picture(gaussians: Gaussians, frames: list[Frame]) -> None:
    cameras = [frame.camera for frame in frames[:2]]
    covered = sum(float(render(gaussians, camera).alpha.sum()) for camera in cameras)
    assert contributions(gaussians, cameras).sum() == pytest.approx(covered, rel=OF_FLOAT32)


def test_what_is_hidden_or_outside_makes_up_little_or_nothing() -> None:
    hidden_last = row_of(depths_m=[1.0, 1.1, 1.2, 4.0, -2.0], opacity=0.99)
    shown = contributions(hidden_last, [CAMERA])
    assert shown[3] < 0.01 * shown[0]
    assert shown[4] == 0


def test_black_gaussians_count_as_bright_ones_do() -> None:
    bright = row_of(depths_m=[2.0])
    black = replace(bright, sh=np.full((1, 4, 3), -9.0, np.float32))
    assert contributions(black, [CAMERA]) == pytest.approx(contributions(bright, [CAMERA]))


def test_larger_and_more_opaque_ones_are_worth_more() -> None:
    small = sizes(row_of(depths_m=[2.0], size_m=0.1))[0]
    assert sizes(row_of(depths_m=[2.0], size_m=0.2))[0] == pytest.approx(4 * small, rel=1e-5)
    assert sizes(row_of(depths_m=[2.0], opacity=0.45))[0] == pytest.approx(small / 2, rel=1e-5)


def test_what_fits_is_what_shows_most(gaussians: Gaussians, frames: list[Frame]) -> None:
    worth = contributions(gaussians, [frame.camera for frame in frames])
    whole = fitted(gaussians, worth, None)
    room = len(whole.data) // 2
    half = fitted(gaussians, worth, room)
    assert 0.8 * room < len(half.data) <= room
    assert 0.3 * len(gaussians) < len(half.gaussians) < 0.7 * len(gaussians)
    lost = loss_db(gaussians, half.gaussians, frames)
    others = fitted(gaussians, -worth + worth.max() + 1, room)
    assert 0 <= lost < loss_db(gaussians, others.gaussians, frames)
    expected = mean_psnr_db(gaussians, frames) - mean_psnr_db(half.gaussians, frames)
    assert lost == pytest.approx(expected)


def test_nothing_that_fits_is_a_sentence() -> None:
    one = row_of(depths_m=[2.0])
    with pytest.raises(OutputError, match="allow more by --max-mb"):
        fitted(one, np.ones(1), 10)


@pytest.mark.parametrize("ending", [".ply", ".spz", ".glb"])
@pytest.mark.parametrize("is_upright", [True, False])
def test_a_file_stands_in_the_world_of_its_recording_again(
    gaussians: Gaussians, frames: list[Frame], ending: str, is_upright: bool, tmp_path: Path
) -> None:
    path = tmp_path / f"room{ending}"
    written = upright(gaussians, "-y", path) if is_upright else gaussians
    write_splats(path, written)
    again = read_in_world(path, frames, np.zeros(3))
    np.testing.assert_allclose(again.means_m, gaussians.means_m, atol=2e-3)


def test_where_a_file_is_counted_from_is_the_place(
    gaussians: Gaussians, frames: list[Frame], tmp_path: Path
) -> None:
    """As `peaking splat` writes recordings that have coordinates of maps."""
    origin_m = np.array([412_345.0, 5_678_901.0, 312.0])
    path = tmp_path / "room.ply"
    write_splats(path, upright(replace(gaussians, origin_m=origin_m), "-y", path))
    again = read_in_world(path, frames, origin_m)
    np.testing.assert_allclose(again.means_m, gaussians.means_m, atol=1e-5)
    assert not again.origin_m.any()


def test_too_few_pictures_are_a_sentence(frames: list[Frame], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="2 pictures to train on; take at least 3"):
        trained(frames[:2], tmp_path, SplatOptions())


@pytest.mark.parametrize("ending", [".ply", ".spz"])
def test_a_file_alone_is_looked_at_upright_from_the_front(
    gaussians: Gaussians, ending: str, tmp_path: Path
) -> None:
    path = tmp_path / f"room{ending}"
    write_splats(path, upright(gaussians, "-y", path))
    read = read_splats(path)
    shared, kept = place_of_splats(path, read)
    assert kept == len(gaussians)
    (view,) = shared.place.views
    up = shared.place.up
    assert up is not None
    assert -view.camera.world_from_cam.rotation[:, 1] @ up == pytest.approx(1.0)
    assert view.camera.sees(read.means_m).mean() > 0.6
    made = tmp_path / f"again{Path(shared.place.splat or '').suffix}"
    made.write_bytes(shared.files[shared.place.splat or ""]())
    np.testing.assert_allclose(read_splats(made).means_m, read.means_m, atol=1e-3)
