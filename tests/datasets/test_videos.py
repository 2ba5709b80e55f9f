"""Videos as recordings: which pictures are taken, and where COLMAP finds that they were."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from peaking.datasets import Recording, open_recording
from peaking.datasets.cache import cache_folder
from peaking.datasets.posed_frames import PosedRecording
from peaking.datasets.video_choice import LEAST_SHIFT, WINDOW, Chooser, Shown
from peaking.datasets.video_frames import VideoFile
from peaking.errors import BackendUnavailable, PeakingError, RecordingError
from peaking.poses import at_once, structure
from peaking.poses.colmap import similarity_to

DESK = Path(__file__).parents[2] / "scenes" / "desk"
POSITIONS_AGREE = 0.01
"""Root mean square over the length of the path. Measured: 0.0011."""
DIRECTIONS_AGREE_DEG = 0.2
"""The worst. Measured: 0.03."""
LEAST_KNOWN, DEPTHS_AGREE = 0.4, 0.05
"""Share of pixels; median error over depth. Measured: 0.59, 0.015."""
STEPS = range(0, 40, 4)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PEAKING_CACHE", str(tmp_path / "cache"))


def written(path: Path, pictures: Iterator[np.ndarray] | list[np.ndarray]) -> Path:
    writer = None
    for rgb in pictures:
        if writer is None:
            size = rgb.shape[1], rgb.shape[0]
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10, size)
        writer.write(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    assert writer is not None
    writer.release()
    return path


def boxes(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, bytes]]:
    while start + 8 <= end:
        size, kind = struct.unpack_from(">I4s", data, start)
        yield start, start + size, kind
        start += size


def replaced(data: bytes, path: list[bytes], change: Callable[[bytes], bytes]) -> bytes:
    """Return boxes of an MP4 with the body of one changed, and all around it as long as it is."""
    for start, end, kind in boxes(data, 0, len(data)):
        if kind == path[0]:
            body = data[start + 8 : end]
            body = change(body) if len(path) == 1 else replaced(body, path[1:], change)
            return data[:start] + struct.pack(">I4s", len(body) + 8, kind) + body + data[end:]
    raise AssertionError(f"no {path[0]!r}")


def patched(path: Path, inside: list[bytes], change: Callable[[bytes], bytes]) -> Path:
    """Change a box in the track of a video whose `moov` comes last, as OpenCV writes it."""
    data = path.read_bytes()
    path.write_bytes(replaced(data, [b"moov", b"trak", *inside], change))
    return path


def assert_cameras_agree(found: Recording, recorded: Recording, indices: list[int]) -> None:
    poses = [camera.world_from_cam for camera in found.cameras]
    true = [recorded.cameras[i].world_from_cam for i in indices]
    similarity = similarity_to(poses, true)
    at = similarity.apply(np.array([pose.translation_m for pose in poses]))
    meant = np.array([pose.translation_m for pose in true])
    long = np.linalg.norm(np.diff(meant, axis=0), axis=1).sum()
    assert np.sqrt(((at - meant) ** 2).sum(axis=1).mean()) < POSITIONS_AGREE * long
    for pose, other in zip(poses, true, strict=True):
        turn = (similarity.rotation @ pose.rotation).T @ other.rotation
        angle = np.degrees(np.arccos(min(1.0, (np.trace(turn) - 1) / 2)))
        assert angle < DIRECTIONS_AGREE_DEG


def assert_depth_agrees(found: PosedRecording, recorded: Recording, indices: list[int]) -> None:
    """Compare depth with the drawn one, at the scale of the poses."""
    true = [recorded.cameras[i].world_from_cam for i in indices]
    scale = similarity_to([camera.world_from_cam for camera in found.cameras], true).scale
    off: list[np.ndarray] = []
    for place, index in enumerate(indices):
        depth_m, meant_m = found.read(place).depth_m, recorded.read(index).depth_m
        assert depth_m is not None
        assert meant_m is not None
        size = depth_m.shape[1], depth_m.shape[0]
        meant_m = np.asarray(cv2.resize(meant_m, size, interpolation=cv2.INTER_NEAREST))
        known = (depth_m > 0) & (meant_m > 0)
        assert known.mean() > LEAST_KNOWN
        off.append(np.abs(scale * depth_m[known] / meant_m[known] - 1))
    assert np.median(np.concatenate(off)) < DEPTHS_AGREE


def clip_of_the_desk(path: Path) -> Path:
    desk = open_recording(DESK)
    return written(path, [desk.read(i).rgb[:638] for i in STEPS])


def test_a_video_is_placed_as_it_was_filmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = clip_of_the_desk(tmp_path / "desk.mp4")
    recording, desk = open_recording(clip), open_recording(DESK)
    assert isinstance(recording, PosedRecording)
    assert recording.format == "video"
    assert len(recording) >= 4
    assert "scale is unknown" in recording.notes[0]
    assert all(recording.has_depth)
    times_s = [time for time in recording.timestamps_s if time is not None]
    indices = [STEPS[int(name)] for name in recording.names]
    np.testing.assert_allclose(times_s, [int(name) / 10 for name in recording.names], atol=0.001)
    assert_cameras_agree(recording, desk, indices)
    assert_depth_agrees(recording, desk, indices)
    points_m = recording.frames[0].points_m
    assert points_m is not None
    xy_px, away = recording.cameras[0].project(points_m())
    assert len(xy_px) > 50
    assert (xy_px > -1).all()
    assert (xy_px < np.array(recording.cameras[0].pinhole.size_px) + 1).all()
    assert 1.0 < np.median(away) < 2.5

    monkeypatch.setitem(sys.modules, "pycolmap", None)  # it is not asked for a second time
    again = open_recording(clip)
    assert again.fingerprint() == recording.fingerprint()
    subset = recording.write_subset([1, 0], tmp_path / "subset")
    assert subset.read(0).depth_m is not None


@pytest.mark.parametrize("works", [True, False])
def test_many_pictures_are_placed_at_once_or_else_one_by_one(
    works: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def run(database: Path, pictures: Path, out: Path, *, seed: int) -> list[Path]:
        asked.append(out)
        return at_once.run(database, pictures, out, seed=seed) if works else []

    monkeypatch.setattr(structure, "MANY", 4)
    monkeypatch.setattr(structure, "at_once", SimpleNamespace(run=run))
    recording = open_recording(clip_of_the_desk(tmp_path / "desk.mp4"))
    assert len(asked) == 1
    indices = [STEPS[int(name)] for name in recording.names]
    assert_cameras_agree(recording, open_recording(DESK), indices)


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    clip = written(tmp_path / "clip.mp4", [np.zeros((48, 64, 3), np.uint8)] * 2)
    with pytest.raises(BackendUnavailable, match=r"pip install 'peaking\[colmap\]'"):
        open_recording(clip)


def texture(width: int = 640, height: int = 320) -> np.ndarray:
    noise = np.random.default_rng(0).integers(0, 256, (height // 4, width // 4, 3), np.uint8)
    return np.asarray(cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC), np.uint8)


def panned(shifts: list[int], width: int = 320) -> list[np.ndarray]:
    wide = texture()
    return [np.ascontiguousarray(wide[:, shift : shift + width]) for shift in shifts]


def chosen(pictures: list[np.ndarray]) -> list[int]:
    return [s.index for s in Chooser().chosen(Shown(i, 0.1 * i, p) for i, p in enumerate(pictures))]


def test_pictures_are_chosen_by_how_far_the_camera_moved() -> None:
    gate = LEAST_SHIFT * 320
    shifts = [2 * i for i in range(60)]
    kept = [shifts[i] for i in chosen(panned(shifts))]
    steps = np.diff(kept)
    assert kept[0] == 0
    assert (steps >= gate - 0.5).all()
    assert (steps <= WINDOW * gate + 2).all()
    assert chosen(panned([0] * 20)) == [0]


def test_the_sharpest_of_a_window_is_taken() -> None:
    pictures = panned(list(range(20)))
    for i in (7, 9):
        pictures[i] = np.asarray(cv2.GaussianBlur(pictures[i], (0, 0), 2.0))
    assert chosen(pictures)[1] == 8


def test_a_cut_is_a_new_place() -> None:
    pictures = panned([0, 0, 0])
    other = np.ascontiguousarray(np.rot90(pictures[0], 2))
    assert 3 in chosen([*pictures, other])


def test_a_wall_and_a_still_camera_say_what_to_do(tmp_path: Path) -> None:
    still = written(tmp_path / "still.mp4", panned([0] * 8))
    with pytest.raises(RecordingError, match=r"shows the same place.*move sideways"):
        open_recording(still)
    rng = np.random.default_rng(0)
    different = [texture(64, 48)[:, :, ::-1], *rng.integers(0, 256, (7, 48, 64, 3), np.uint8)]
    with pytest.raises(RecordingError, match=r"no poses.*could be joined.*texture"):
        open_recording(written(tmp_path / "noise.mp4", different))
    assert not list(cache_folder().glob("video/[!.]*"))


def test_a_turn_that_the_file_notes_is_applied(tmp_path: Path) -> None:
    turned = struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, 64 << 16, 0, 1 << 30)
    clip = patched(
        written(tmp_path / "clip.mp4", panned([0, 4])),
        [b"tkhd"],
        lambda body: body[:40] + turned + body[76:],
    )
    shown = list(VideoFile(clip, upright=True).in_order())
    assert shown[0].rgb.shape == (320, 320, 3)
    stored = VideoFile(clip).read(0)
    np.testing.assert_array_equal(shown[0].rgb, np.rot90(stored, -1))


def test_times_are_the_videos_own(tmp_path: Path) -> None:
    """Its rate varies: the first two pictures are shown half as long as the others."""

    def varied(body: bytes) -> bytes:
        _, one, count, delta = struct.unpack(">IIII", body)
        assert one == 1
        return struct.pack(">IIIIII", 0, 2, 2, delta // 2, count - 2, delta)

    clip = patched(
        written(tmp_path / "clip.mp4", panned([4 * i for i in range(5)])),
        [b"mdia", b"minf", b"stbl", b"stts"],
        varied,
    )
    times_s = [shown.time_s for shown in VideoFile(clip).in_order()]
    np.testing.assert_allclose(times_s, [0.0, 0.05, 0.1, 0.2, 0.3], atol=0.001)


@pytest.mark.parametrize(("transfer", "refused"), [(16, True), (18, False), (1, False)])
def test_hdr_of_a_kind_that_is_not_converted_is_refused(
    transfer: int, refused: bool, tmp_path: Path
) -> None:
    colour = struct.pack(">I4s4sHHHB", 19, b"colr", b"nclx", 9, transfer, 9, 0)

    def said(body: bytes) -> bytes:
        entry = body[8:] + colour
        return body[:8] + struct.pack(">I", len(entry)) + entry[4:]

    clip = patched(
        written(tmp_path / "clip.mp4", panned([0] * 4)),
        [b"mdia", b"minf", b"stbl", b"stsd"],
        said,
    )
    with pytest.raises(RecordingError, match=r"HDR.*tonemap" if refused else "same place"):
        open_recording(clip)


@settings(
    deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.binary(max_size=200), st.integers(0, 3000))
def test_any_bytes_are_refused_in_a_sentence(tmp_path: Path, junk: bytes, at: int) -> None:
    clip = tmp_path / "clip.mp4"
    whole = written(clip, panned([0] * 3)).read_bytes()
    for data in (junk, whole[:at] + junk, whole[:at] + junk + whole[at + len(junk) :]):
        clip.write_bytes(data)
        with pytest.raises(PeakingError):
            open_recording(clip)
