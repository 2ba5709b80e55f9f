import json
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float32, UInt8

from peaking.benchmarks.single_view import (
    METHODS,
    as_dict,
    as_markdown,
    choose_pairs,
    exposure_gain,
    render_mesh,
    render_splat,
    single_view_quality,
)
from peaking.datasets import open_recording
from peaking.errors import RecordingError
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.rendering import Rendering
from recordings import STEP_M, write_recording

GOOD_DB = 30.0
"""Least PSNR on the smooth drawn room, 5 cm away. Worst measured: 34.1 (layered)."""


def as_measured(
    sensor_m: Float32[np.ndarray, "h w"], rgb: UInt8[np.ndarray, "h w 3"]
) -> Float32[np.ndarray, "h w"]:
    assert sensor_m.shape == rgb.shape[:2]
    return sensor_m


def render_nothing(frame: Frame, depth_m: Float32[np.ndarray, "h w"], target: Camera) -> Rendering:
    rendering = render_splat(frame, depth_m, target)
    return Rendering(0 * rendering.rgba, rendering.depth_m)


def render_grey(frame: Frame, depth_m: Float32[np.ndarray, "h w"], target: Camera) -> Rendering:
    rendering = render_splat(frame, depth_m, target)
    rgba = np.full_like(rendering.rgba, 0.5)
    rgba[..., 3] = 1
    return Rendering(rgba, rendering.depth_m)


def test_pairs_are_spread_evenly_and_at_the_wanted_distance(tmp_path: Path) -> None:
    recording = open_recording(write_recording(tmp_path / "room", num_frames=12))
    pairs = choose_pairs(recording, 2 * STEP_M, count=3)
    # Twelve views have a partner, so runs of four; 1 (of 0…3) is nearest to the first one's middle.
    assert [pair.source for pair in pairs] == [1, 5, 9]
    for pair in pairs:
        assert abs(pair.target - pair.source) == 2
        assert pair.distance_m == pytest.approx(2 * STEP_M, rel=0.05)
        assert pair.angle_rad == pytest.approx(0.04, abs=1e-6)


def test_no_view_is_far_enough_away(tmp_path: Path) -> None:
    recording = open_recording(write_recording(tmp_path / "room", num_frames=3))
    assert choose_pairs(recording, 0.5, count=3) == []
    with pytest.raises(RecordingError, match="no pair of views"):
        single_view_quality(tmp_path / "room", baselines_m=(0.5,), complete=as_measured)


def test_a_recording_without_depth_has_no_pairs(tmp_path: Path) -> None:
    recording = open_recording(write_recording(tmp_path / "room", with_depth=False))
    assert choose_pairs(recording, STEP_M, count=3) == []


def opaque(rgb: np.ndarray) -> Rendering:
    alpha = np.ones(rgb.shape[:2], np.float32)
    return Rendering(np.dstack([rgb, alpha]).astype(np.float32), alpha)


def test_gain_is_the_ratio_of_exposures_within_limits() -> None:
    # The last channel of the first drawing is too dark to tell.
    photo = np.tile(np.linspace(0.2, 0.6, 40, dtype=np.float32)[:, None, None], (1, 20, 3))
    gains = np.array([1.0, 1.25, 8.0], dtype=np.float32)
    np.testing.assert_allclose(
        exposure_gain(opaque(photo / gains), photo), [1.0, 1.25, 1.0], rtol=1e-5
    )
    np.testing.assert_allclose(exposure_gain(opaque(photo / 1.6), photo), 1.4, rtol=1e-5)


def test_everybody_is_good_at_five_centimetres_and_grey_is_not(tmp_path: Path) -> None:
    write_recording(tmp_path / "room", num_frames=6, width_px=128, height_px=96)
    rows = single_view_quality(
        tmp_path / "room",
        baselines_m=(STEP_M,),
        pairs_per_distance=2,
        size_px=(128, 96),
        methods={**METHODS, "grey": render_grey},
        complete=as_measured,
    )
    by_name = {row.method: row for row in rows}
    for name in METHODS:
        assert by_name[name].psnr_common_db > GOOD_DB
        assert by_name[name].pairs == 2
        assert 0.9 < by_name[name].common <= by_name[name].coverage <= 1
    grey = by_name["grey"]
    assert grey.coverage == 1
    assert grey.sharpness == 0
    assert (grey.beaten_in_psnr, grey.beaten_in_ssim, grey.beaten_in_whole) == (2, 2, 2)
    assert by_name["layered"].beaten_in_psnr is None
    again = json.loads(json.dumps(as_dict(rows)))
    assert [row["method"] for row in again["rows"]] == [*METHODS, "grey"]
    lines = as_markdown(rows).splitlines()
    assert len(lines) == 2 + len(rows)
    assert "2, 2, 2 of 2" in lines[-1]


def test_common_pixels_are_the_same_for_all_methods(tmp_path: Path) -> None:
    write_recording(tmp_path / "room", num_frames=4)
    rows = single_view_quality(
        tmp_path / "room",
        baselines_m=(STEP_M,),
        pairs_per_distance=1,
        size_px=(64, 48),
        methods={"splat": render_splat, "mesh": render_mesh, "twin": render_splat},
        complete=as_measured,
    )
    splat, _, twin = rows
    assert (splat.psnr_common_db, splat.ssim_common) == (twin.psnr_common_db, twin.ssim_common)
    assert all(row.beaten_in_psnr is None for row in rows)


def test_a_method_that_draws_nothing_leaves_nothing_to_compare(tmp_path: Path) -> None:
    write_recording(tmp_path / "room")
    with pytest.raises(RecordingError, match="no pair"):
        single_view_quality(
            tmp_path / "room",
            baselines_m=(STEP_M,),
            size_px=(64, 48),
            methods={"splat": render_splat, "nothing": render_nothing},
            complete=as_measured,
        )


def test_bad_arguments_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="distances > 0"):
        single_view_quality(tmp_path, baselines_m=(0.0,))
    with pytest.raises(ValueError, match="pairs_per_distance"):
        single_view_quality(tmp_path, pairs_per_distance=0)
