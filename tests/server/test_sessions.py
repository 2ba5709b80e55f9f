from __future__ import annotations

import errno
import io
import json
import os
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture_uploads import (
    SESSION_ID,
    body_of,
    capture_id,
    depth_mm,
    header,
    new_session,
    photo,
    points_m,
    upload,
    upload_without_depth,
)
from peaking.datasets import open_recording
from peaking.errors import RecordingError
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.mpi_file import encode
from peaking.server import wire
from peaking.server.dataset import zip_stream
from peaking.server.disk_full import DiskFull
from peaking.server.open_session import OpenSession
from peaking.server.session_state import UnknownCapture
from peaking.server.sessions import SessionStore
from peaking.server.upload import parse_upload


class PowerCut(BaseException):
    """Ends everything at once, as a power cut does."""


def clock() -> float:
    return 1_700_000_000.0


def begun(root: Path) -> OpenSession:
    new = msgspec.convert(new_session(), wire.NewSession)
    return SessionStore(root, clock=clock).begin(SESSION_ID, new)[0]


def store(session: OpenSession, number: int) -> wire.Capture:
    return session.store_capture(capture_id(number), parse_upload(upload(number)))[0]


def empty_mpi() -> bytes:
    camera = Camera(Pinhole(9, 9, 5.0, 5.0, 4.5, 4.5), Rigid(np.eye(3), np.zeros(3)))
    nothing = np.zeros((0, 3), np.int32), np.zeros((0, 16, 16, 4), np.uint8)
    return encode(Mpi(camera, np.array([1.0]), *nothing))


def reopened(root: Path) -> OpenSession:
    (session,) = SessionStore(root, clock=clock).sessions()
    return session


def test_a_corrected_pose_is_kept_beside_the_devices_own(tmp_path: Path) -> None:
    corrected = [1.0, 0, 0, 0.156, 0, 1, 0, 0.5, 0, 0, 1, 0]
    fields = header(1, corrected_world_from_cam=corrected, depth=None)
    begun(tmp_path).store_capture(capture_id(1), parse_upload(body_of(fields, photo(1))))
    session = reopened(tmp_path)
    store(session, 2)
    session.refresh_dataset()
    with_it, without = session.captures
    assert with_it.corrected_world_from_cam == corrected
    assert with_it.camera.world_from_cam != corrected
    assert without.corrected_world_from_cam is None
    first, second = json.loads((session.folder / "transforms.json").read_text())["frames"]
    own, found = (
        np.array(first[key]) for key in ("transform_matrix", "corrected_transform_matrix")
    )
    np.testing.assert_allclose(found[:3, 3], [0.156, 0.5, 0.0])
    np.testing.assert_allclose(found[:3, :3], np.diag([1.0, -1.0, -1.0]))
    assert not np.allclose(own, found)
    assert "corrected_transform_matrix" not in second
    recorded = open_recording(session.folder).cameras[0]
    np.testing.assert_allclose(recorded.world_from_cam.matrix()[:3, 3], own[:3, 3])


def test_a_capture_is_read_back_as_it_was(tmp_path: Path) -> None:
    session = begun(tmp_path)
    store(session, 1)
    again = reopened(tmp_path)
    assert again.photo_path(again.capture(capture_id(1))).read_bytes() == photo(1)
    frame = again.frame_of(capture_id(1))
    assert frame.depth_m is not None
    np.testing.assert_allclose(frame.depth_m * 1000, depth_mm(1), atol=1e-3)
    assert frame.camera.position_m[0] == pytest.approx(0.05)
    assert again.unfinished("layered") == [capture_id(1)]


def test_tracked_points_are_kept_and_are_in_the_data_set(tmp_path: Path) -> None:
    session = begun(tmp_path)
    session.store_capture(capture_id(1), parse_upload(upload_without_depth(1)))
    session.refresh_dataset()
    again = reopened(tmp_path)
    frame = again.frame_of(capture_id(1))
    assert frame.depth_m is None
    np.testing.assert_array_equal(np.asarray(frame.points_m), points_m(1))
    assert [name for name, _ in again.dataset_files()] == [
        "transforms.json",
        "images/000001.jpg",
        "points/000001.ply",
    ]
    recorded = open_recording(again.folder).read(0)
    np.testing.assert_array_equal(np.asarray(recorded.points_m), points_m(1))
    again.remove_capture(capture_id(1))
    assert (again.folder / "removed/points/000001.ply").is_file()
    np.testing.assert_array_equal(np.asarray(again.frame_of(capture_id(1)).points_m), points_m(1))


def test_the_same_id_is_kept_once(tmp_path: Path) -> None:
    session = begun(tmp_path)
    assert session.store_capture(capture_id(1), parse_upload(upload(1)))[1]
    assert not session.store_capture(capture_id(1), parse_upload(upload(2)))[1]
    assert len(reopened(tmp_path).captures) == 1


def test_the_same_id_from_eight_threads_is_kept_once(tmp_path: Path) -> None:
    session = begun(tmp_path)
    made: list[bool] = []

    def send() -> None:
        made.append(session.store_capture(capture_id(1), parse_upload(upload(1)))[1])

    threads = [threading.Thread(target=send) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(made) == [False] * 7 + [True]
    assert len(reopened(tmp_path).captures) == 1


def test_an_undone_capture_is_in_no_data_set_and_not_lost(tmp_path: Path) -> None:
    session = begun(tmp_path)
    store(session, 1)
    store(session, 2)
    assert session.remove_capture(capture_id(1)).removed
    assert session.remove_capture(capture_id(1)).removed
    again = reopened(tmp_path)
    assert [name for name, _ in again.dataset_files()] == [
        "transforms.json",
        "images/000002.jpg",
        "depth/000002.png",
    ]
    assert again.photo_path(again.capture(capture_id(1))).read_bytes() == photo(1)
    assert store(again, 3).number == 3
    with pytest.raises(UnknownCapture):
        again.remove_capture(capture_id(9))


def test_an_mpi_that_is_gone_or_of_an_old_format_is_made_again(tmp_path: Path) -> None:
    session = begun(tmp_path)
    for number in (1, 2, 3):
        store(session, number)
        session.mark_ready(capture_id(number), empty_mpi(), generator="layered", guessed=False)
    session.mpi_path(capture_id(2)).unlink()
    old = session.mpi_path(capture_id(3))
    old.write_bytes(old.read_bytes().replace(b"PKMPI\x02", b"PKMPI\x01", 1))
    again = reopened(tmp_path)
    assert [capture.state for capture in again.captures] == ["ready", "queued", "queued"]
    assert again.unfinished("layered") == [capture_id(2), capture_id(3)]
    assert again.capture(capture_id(1)).mpi_bytes == len(empty_mpi())


def test_the_folder_is_a_data_set(tmp_path: Path) -> None:
    session = begun(tmp_path)
    store(session, 1)
    store(session, 2)
    session.refresh_dataset()
    recording = open_recording(session.folder)
    assert len(recording) == 2
    frame, sent = recording.read(1), session.frame_of(capture_id(2))
    np.testing.assert_array_equal(frame.rgb, sent.rgb)
    np.testing.assert_allclose(
        frame.camera.world_from_cam.matrix(), sent.camera.world_from_cam.matrix(), atol=1e-12
    )


def test_the_zip_has_the_data_set(tmp_path: Path) -> None:
    session = begun(tmp_path / "sessions")
    store(session, 1)
    data = b"".join(zip_stream(session.dataset_files(), session.folder))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path / "out")
    assert open_recording(tmp_path / "out").read(0).depth_m is not None


def test_a_torn_last_line_is_cut_off_before_the_next(tmp_path: Path) -> None:
    session = begun(tmp_path)
    store(session, 1)
    log = session.folder / "log.jsonl"
    whole = log.read_bytes()
    log.write_bytes(whole + b'{"type":"CaptureStored","at_s":17')
    session = reopened(tmp_path)
    assert [c.id for c in session.captures] == [capture_id(1)]
    session.rename("lamp")
    assert log.read_bytes().startswith(whole + b'{"type":"SessionNamed"')


def test_damage_at_the_beginning_is_said_and_touches_nothing(tmp_path: Path) -> None:
    session = begun(tmp_path)
    store(session, 1)
    log = session.folder / "log.jsonl"
    first, second = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"x" + first + second)
    with pytest.raises(RecordingError, match="line 1"):
        OpenSession(session.folder, clock=clock)
    opened = SessionStore(tmp_path)
    assert opened.sessions() == []
    assert "line 1" in opened.problems[0]
    assert (session.folder / "images/000001.jpg").read_bytes() == photo(1)
    assert log.read_bytes() == b"x" + first + second


def test_names_and_ends_are_remembered(tmp_path: Path) -> None:
    session = begun(tmp_path)
    session.rename("../../etc")
    session.finish(True)
    sample = wire.PeakedSample(1.0, 0.25, 2, [1.0, 0, 0, 0] * 3, unseen_share=0.1)
    later = wire.PeakedSample(2.0, 0.25, 2, [1.0, 0, 0, 0] * 3, unseen_share=0.1)
    session.add_peaked([sample, later])
    again = reopened(tmp_path)
    again.add_peaked([sample, later])  # told again by a phone that got no answer
    summary = again.summary()
    assert (summary.name, summary.finished, summary.peaked_share) == ("../../etc", True, 0.25)
    assert again.folder == session.folder
    assert again.peaked() == [sample, later]


def cut_power_at(call: int, monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let the so-manieth call that reaches the disk fail."""
    left = [call]

    def failing(function: Callable[..., Any]) -> Callable[..., Any]:
        def guarded(*args: Any, **kwargs: Any) -> Any:
            left[0] -= 1
            if left[0] == 0:
                raise error
            return function(*args, **kwargs)

        return guarded

    for name in ("fsync", "write", "rename", "replace", "open", "truncate"):
        monkeypatch.setattr(os, name, failing(getattr(os, name)))
    monkeypatch.setattr(Path, "open", failing(Path.open))


@given(
    st.lists(st.sampled_from(["store", "remove", "reopen", "cut"]), max_size=12),
    st.randoms(use_true_random=False),
)
def test_whatever_happens_what_was_acknowledged_is_there_once(
    tmp_path_factory: pytest.TempPathFactory, steps: list[str], random: Any
) -> None:
    root = tmp_path_factory.mktemp("sessions")
    session = begun(root)
    kept: set[str] = set()
    removed: set[str] = set()
    for number, step in enumerate(steps, start=1):
        if step == "store":
            store(session, number)
            kept.add(capture_id(number))
        elif step == "remove" and kept:
            removed.add(session.remove_capture(min(kept)).id)
        elif step == "reopen":
            session = reopened(root)
        elif step == "cut":
            with pytest.MonkeyPatch.context() as patch:
                cut_power_at(random.randint(1, 14), patch, PowerCut())
                try:
                    store(session, number)
                    kept.add(capture_id(number))
                except PowerCut:
                    pass
            session = reopened(root)
            there = {c.id for c in session.captures}
            if capture_id(number) in there:  # stored, but nobody was told: allowed
                kept.add(capture_id(number))
    session = reopened(root)
    ids = [c.id for c in session.captures]
    assert set(ids) == kept
    assert len(ids) == len(kept)
    assert {c.id for c in session.captures if c.removed} == removed
    for capture in session.captures:
        assert session.photo_path(capture).read_bytes() == photo(int(capture.id[-12:]))
    assert len({c.number for c in session.captures}) == len(ids)


@pytest.mark.parametrize("call", range(1, 13))
def test_a_full_disk_keeps_nothing_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int
) -> None:
    session = begun(tmp_path)
    store(session, 1)
    with monkeypatch.context() as patch:
        cut_power_at(call, patch, OSError(errno.ENOSPC, "No space left on device"))
        with pytest.raises(DiskFull, match="disk is full"):
            store(session, 2)
    assert [c.id for c in session.captures] == [capture_id(1)]
    assert store(session, 2).number == 2
    assert len(reopened(tmp_path).captures) == 2
