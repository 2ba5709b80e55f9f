"""LLFF's folders: read as its README says, and refused in a sentence."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peaking.datasets import Reading, open_recording
from peaking.errors import PeakingError, RecordingError
from peaking.geometry import Pinhole
from written_formats import OPENGL, Shot, assert_only_these_axes_fit, jpg, png, shots

CENTRED = Pinhole(160, 120, 140.0, 140.0, 80.0, 60.0)
FERN = Path(__file__).parent.parent.parent.parent / "shared/data/llff_fern_grid"


def write_llff(root: Path, taken: list[Shot]) -> Path:
    rows: list[np.ndarray] = []
    for i, shot in enumerate(taken):
        jpg(root / f"images/IMG_{i:04d}.jpg", shot.rgb)
        opengl = shot.world_from_cam @ OPENGL
        k = shot.camera.pinhole
        axes = [-opengl[:3, 1], opengl[:3, 0], opengl[:3, 2], opengl[:3, 3]]
        table = np.stack([*axes, np.array([k.height_px, k.width_px, k.fx_px])], axis=1)
        rows.append(np.concatenate([table.ravel(), [0.9, 2.5]]))
    np.save(root / "poses_bounds.npy", np.stack(rows))
    return root


def test_poses_are_the_ones_written(tmp_path: Path) -> None:
    taken = shots(4, pinhole=CENTRED)
    recording = open_recording(write_llff(tmp_path / "fern", taken))
    assert recording.format == "llff"
    for camera, shot in zip(recording.cameras, taken, strict=True):
        assert camera.pinhole == CENTRED
        assert np.allclose(camera.world_from_cam.matrix(), shot.world_from_cam, atol=1e-12)
    assert any("arbitrary" in note for note in recording.notes)


def test_a_neighbour_fits_with_the_axes_read_and_no_others(tmp_path: Path) -> None:
    taken = shots(2, pinhole=CENTRED)
    recording = open_recording(write_llff(tmp_path / "fern", taken))
    out = recording.write_subset([0, 1], tmp_path / "out").path.parent
    text = (out / "transforms.json").read_text()
    for i, shot in enumerate(taken):  # LLFF has no depth: it is put beside what was read
        png(out / f"depths/{i}.png", np.round(shot.depth_m * 1000).astype(np.uint16))
        own = f'"file_path": "images/IMG_{i:04d}.jpg",'
        text = text.replace(own, f'{own} "depth_file_path": "depths/{i}.png",')
    (out / "transforms.json").write_text(text)
    assert_only_these_axes_fit(open_recording(out))


def test_smaller_pictures_and_masks(tmp_path: Path) -> None:
    root = write_llff(tmp_path / "fern", shots(2, pinhole=CENTRED))
    for i in range(2):
        png(root / f"images_2/image{i:03d}.png", np.full((60, 80, 3), 90, np.uint8))
    (root / "images/IMG_0001.jpg").unlink()
    mask = np.full((60, 80), 255, np.uint8)
    mask[:30] = 0
    png(root / "masks/image000.png", mask)
    frame = open_recording(root).read(0)
    assert frame.camera.pinhole == CENTRED.resized(80, 60)
    assert frame.mask is not None
    assert frame.mask.mean() == 0.5
    elsewhere = tmp_path / "photos"
    (root / "images_2").rename(elsewhere)
    with pytest.raises(RecordingError, match=r"images/ has 1.*--images"):
        open_recording(root)
    assert len(open_recording(root, Reading(images=elsewhere))) == 2


@pytest.mark.skipif(not FERN.is_dir(), reason="the recordings beside the checkout")
def test_fern_is_as_its_other_file_says() -> None:
    other, llff = open_recording(FERN), open_recording(FERN, Reading(format="llff"))
    for one, same in zip(other.cameras, llff.cameras, strict=True):
        assert one.pinhole.size_px == same.pinhole.size_px
        assert abs(one.pinhole.fx_px / same.pinhole.fx_px - 1) < 0.02
        assert float(one.forward @ same.forward) > 0.999


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (np.zeros((2, 15)), "need N x 17 numbers"),
        (np.zeros((0, 17)), "need N x 17 numbers"),
        (np.array([["a"] * 17]), "need numbers"),
        (np.zeros((2, 17)), "rotation"),
        (np.full((2, 17), np.inf), "no finite pose"),
    ],
)
def test_wrong_tables_get_a_sentence(rows: np.ndarray, says: str, tmp_path: Path) -> None:
    root = write_llff(tmp_path / "fern", shots(2, pinhole=CENTRED))
    np.save(root / "poses_bounds.npy", rows)
    for path in sorted((root / "images").iterdir())[len(rows) :]:
        path.unlink()
    with pytest.raises(RecordingError, match=says) as refused:
        open_recording(root)
    assert "poses_bounds.npy" in str(refused.value)


def test_arbitrary_and_damaged_bytes_never_crash(tmp_path: Path) -> None:
    root = write_llff(tmp_path / "fern", shots(2, pinhole=CENTRED))
    sound = (root / "poses_bounds.npy").read_bytes()

    @settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(
        st.one_of(
            st.binary(max_size=200),
            st.integers(0, len(sound)).map(lambda end: sound[:end]),
            st.tuples(st.integers(0, len(sound) - 1), st.binary(min_size=1, max_size=8)).map(
                lambda cut: sound[: cut[0]] + cut[1] + sound[cut[0] + len(cut[1]) :]
            ),
        )
    )
    def tried(data: bytes) -> None:
        (root / "poses_bounds.npy").write_bytes(data)
        with contextlib.suppress(PeakingError):
            open_recording(root)

    tried()
