"""Places: cameras, images, points and photographs say the same of one world."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from peaking.datasets import open_recording
from peaking.errors import OutputError
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.light_field import LightField
from peaking.mpi_file import decode, write_mpi
from peaking.options import DEFAULT
from peaking.server.session_log import (
    FILE_NAME,
    NamedSession,
    SessionBegun,
    SessionLog,
    SessionNamed,
)
from peaking.server.training import NOTHING
from peaking.share import pictures, writing
from peaking.share.file_place import place_of_mpi
from peaking.share.place import Place, PlaceView, SharedPlace, start_of
from peaking.share.recorded_files import RecordedFiles
from peaking.share.recorded_place import Contents, place_of_recording, whole_contents
from peaking.share.session_folder import title_of, trained_in
from peaking.share.writing import write_place
from peaking.view_builder import generate
from recordings import lateral_cameras, write_recording

OPTIONS = replace(DEFAULT, pixels=19200)
UTM_M = np.array([412_345.25, 5_678_901.5, 312.0])
"""Where maps have their coordinates: float32 has half a metre there."""
STORED_M = 2e-3
"""Depth is stored in millimetres, along slanting rays; 1.1e-3 measured, near and far alike."""


@pytest.fixture(scope="module", params=["near", "far"])
def files(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> RecordedFiles:
    """A drawn room, here and where maps would have it."""
    away_m = UTM_M if request.param == "far" else np.zeros(3)
    folder = tmp_path_factory.mktemp("rooms") / "room"
    write_recording(folder, num_frames=5, width_px=160, height_px=120)
    document = json.loads((folder / "transforms.json").read_text())
    for frame in document["frames"]:
        for row in range(3):
            frame["transform_matrix"][row][3] += away_m[row]
    (folder / "transforms.json").write_text(json.dumps(document))
    return RecordedFiles(open_recording(folder), OPTIONS)


def read_points(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and colours, as the viewer reads them."""
    count = len(data) // 15
    xyz_m = np.frombuffer(data, "<f4", 3 * count).reshape(-1, 3)
    return xyz_m, np.frombuffer(data, np.uint8, offset=12 * count).reshape(-1, 3)


def camera_of(view: dict[str, Any]) -> Camera:
    """Return the camera of a view in `place.json`."""
    pinhole, rows = view["camera"]["pinhole"], view["camera"]["world_from_cam"]
    matrix = np.vstack([np.array(rows).reshape(3, 4), [0, 0, 0, 1]])
    return Camera(Pinhole(**pinhole), Rigid.from_matrix(matrix))


def test_images_have_the_cameras_of_the_place(files: RecordedFiles) -> None:
    shared = place_of_recording(files, whole_contents(files))
    document = json.loads(shared.place.to_json())
    assert document["shown"] == "light-field"
    assert document["options"]["neighbours"] == OPTIONS.neighbours
    for view in document["views"]:
        told, own = camera_of(view), decode(shared.files[view["mpi"]]()).camera
        assert told.pinhole == own.pinhole
        np.testing.assert_allclose(
            told.world_from_cam.matrix(), own.world_from_cam.matrix(), atol=1e-9
        )
        assert np.abs(told.position_m).max() < 1000


def test_the_light_field_shows_the_photographs(files: RecordedFiles) -> None:
    shared = place_of_recording(files, whole_contents(files))
    views = [view for view in shared.place.views if view.mpi is not None]
    others = [decode(shared.files[view.mpi or ""]()) for view in views if view is not views[2]]
    rendering = LightField(others, OPTIONS).render(views[2].camera)
    photo = files.recording.read(2).rgb / 255.0
    seen = rendering.alpha > 0.9
    assert seen.mean() > 0.8
    assert np.abs(rendering.rgb() - photo)[seen].mean() < 0.03  # 0.01 measured


def test_points_lie_where_pictures_show_their_colours(files: RecordedFiles) -> None:
    shared = place_of_recording(files, whole_contents(files))
    xyz_m, rgb = read_points(shared.files["points.bin"]())
    assert len(xyz_m) > 500
    view = shared.place.views[2]
    photo = files.recording.read(2).rgb
    xy_px, _ = view.camera.project(xyz_m)
    inside = (xy_px >= 1).all(axis=1) & (xy_px < np.array(photo.shape[1::-1]) - 1).all(axis=1)
    column, row = xy_px[inside].astype(int).T
    off = np.abs(photo[row, column].astype(float) - rgb[inside]).mean(axis=1)
    assert np.mean(off < 20) > 0.9  # 0.97 measured; the box hides some of the wall


def test_float32_is_enough_for_points(files: RecordedFiles) -> None:
    xyz_m, _ = read_points(files.points([0, 2, 4]))
    on_wall = xyz_m[np.abs(xyz_m[:, 2] + files.origin_m[2] - _away(files)[2] - 2.0) < 0.01]
    assert len(on_wall) > 100
    depth_m = on_wall[:, 2] + files.origin_m[2] - _away(files)[2]
    assert np.abs(depth_m - 2.0).max() < STORED_M


def _away(files: RecordedFiles) -> np.ndarray:
    return UTM_M if files.origin_m.any() else np.zeros(3)


def test_every_file_is_named_and_every_name_is_a_file(files: RecordedFiles) -> None:
    shared = place_of_recording(files, whole_contents(files))
    document = json.loads(shared.place.to_json())
    named = {view[kind] for view in document["views"] for kind in ("photo", "thumbnail", "mpi")}
    named |= {document["points"], document["poster"]}
    assert named == set(shared.files)
    assert all(name.isascii() and ".." not in name for name in named)


def test_photographs_are_shrunk_and_hide_what_masks_leave_out() -> None:
    (camera,) = lateral_cameras(1, 2000, 1000)
    rgb = np.full((1000, 2000, 3), 250, np.uint8)
    mask = np.ones((1000, 2000), bool)
    mask[:, :1000] = False
    picture = cv2.imdecode(
        np.frombuffer(pictures.photo(Frame("a", rgb, camera, mask=mask)), np.uint8), -1
    )
    assert picture is not None
    assert picture.shape == (640, 1280, 3)
    np.testing.assert_allclose(picture[:, :600], pictures.LEFT_OUT, atol=3)
    np.testing.assert_allclose(picture[:, 680:], 250, atol=3)


def test_one_looks_first_from_amidst_the_others() -> None:
    assert start_of(lateral_cameras(7, 64, 48)) == 3


def test_an_mpi_file_is_a_place_of_one_view(files: RecordedFiles, tmp_path: Path) -> None:
    frame = files.recording.read(1)
    mpi = generate(frame, OPTIONS)
    write_mpi(tmp_path / "view.mpi", mpi)
    shared = place_of_mpi(tmp_path / "view.mpi")
    (view,) = shared.place.views
    shown = decode(shared.files[view.mpi or ""]())
    np.testing.assert_allclose(
        shown.camera.world_from_cam.matrix(), view.camera.world_from_cam.matrix(), atol=1e-9
    )
    assert np.abs(view.camera.position_m).max() < 1000
    if not files.origin_m.any():
        assert shared.files["mpis/view.mpi"]() == (tmp_path / "view.mpi").read_bytes()


def test_what_people_are_told_and_a_code_to_scan() -> None:
    (camera,) = lateral_cameras(1, 64, 48)
    bare = SharedPlace(Place("room", "place", [PlaceView("a", camera)]))
    named = bare.named("Küche", "CC BY 4.0", "https://example.org/a")
    document = json.loads(named.place.to_json())
    assert (document["title"], document["licence"]) == ("Küche", "CC BY 4.0")
    assert document["address"] == "https://example.org/a"
    assert b"<svg" in named.files[document["qr"]]()
    assert json.loads(bare.place.to_json())["qr"] is None


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A recording that is the folder of a session called Kitchen."""
    folder = write_recording(tmp_path / "2026-01-01_120000_5e551011", num_frames=2)
    named = NamedSession("5e551011-0000-4000-8000-0000000000f1", 1, "Kitchen", "virtual")
    SessionLog(folder / FILE_NAME).append(SessionBegun(0.0, 1, named))
    return folder


def test_a_session_is_called_what_people_called_it(session: Path) -> None:
    assert title_of(open_recording(session)) == "Kitchen"
    SessionLog(session / FILE_NAME).append(SessionNamed(1.0, "Küche"))
    assert title_of(open_recording(session)) == "Küche"
    (session / FILE_NAME).unlink()
    assert title_of(open_recording(session)) == session.name


def test_what_takes_more_than_is_allowed_is_not_written(
    files: RecordedFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def viewer(_shared: SharedPlace, _client_dir: Path) -> dict[str, bytes]:
        return {"index.html": b"", "assets/a.js": b""}

    monkeypatch.setattr(writing, "_viewer", viewer)
    shared = place_of_recording(files, Contents([0, 1]))
    size = write_place(shared, tmp_path / "any", tmp_path)
    with pytest.raises(OutputError, match="allow more by --max-mb"):
        write_place(shared, tmp_path / "out", tmp_path, max_bytes=size - 1)
    assert not (tmp_path / "out").exists()
    assert write_place(shared, tmp_path / "out", tmp_path, max_bytes=size) == size


def test_what_was_gained_by_chance_is_no_loss() -> None:
    (camera,) = lateral_cameras(1, 16, 16)
    place = Place("a", "splat", [PlaceView("a", camera)], loss_db=-0.01, splat_loss_db=-0.2)
    told = json.loads(place.to_json())
    assert (told["loss_db"], told["splat_loss_db"]) == (0.0, 0.0)


def test_gaussians_that_were_trained_on_a_session_are_shown(session: Path) -> None:
    recording = open_recording(session)
    assert trained_in(recording) is None
    done = msgspec.structs.replace(NOTHING, state="done", splat_version=7, splat_format="ply")
    (session / "training").mkdir()
    (session / "training/splat-7.ply").write_bytes(b"Gaussians")
    status = session / "training/status.json"
    for state, expected in (("running", None), ("done", session / "training/splat-7.ply")):
        training = msgspec.structs.replace(done, state=state)
        status.write_bytes(msgspec.json.encode({"training": training, "captures": []}))
        assert trained_in(recording) == expected
    files = RecordedFiles(recording, OPTIONS)
    shared = place_of_recording(files, whole_contents(files))
    assert (shared.place.shown, shared.place.splat) == ("light-field", "splat.ply")
    assert shared.files["splat.ply"]() == b"Gaussians"
    for name in ("splat-7.ply", "status.json"):
        inside, outside = session / "training" / name, session.with_name(name)
        inside.rename(outside)
        inside.symlink_to(outside)
        assert trained_in(recording) is None
        inside.unlink()
        outside.rename(inside)
    status.write_bytes(b"{")
    assert trained_in(recording) is None
