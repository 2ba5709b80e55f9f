"""Any byte of any file of a session may be garbled: the rest is served."""

from __future__ import annotations

import random
import time
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.open_session import SessionGone
from peaking.server.sessions import RESTORABLE_S, SessionStore
from peaking.server.upload import BadUpload, parse_upload
from server.test_sessions import empty_mpi

SOUND_ID = "50d0d011-0000-4000-8000-000000000001"
SAMPLE = {"peaked_share": 0.25, "unseen_share": 0.0, "views": 1, "world_from_cam": [1.0] * 12}
NEW = msgspec.convert(new_session(), wire.NewSession)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of two sessions with photos, MPIs, thumbnails, samples, an undo."""
    root = tmp_path_factory.mktemp("made")
    with client_of(root) as client:
        for session in (SESSION_ID, SOUND_ID):
            client.put(f"/api/v1/sessions/{session}", json=new_session())
            samples = [SAMPLE | {"time_s": float(n)} for n in range(3)]
            client.put(f"/api/v1/sessions/{session}/peaked/batch001", json={"samples": samples})
            for number in (1, 2, 3):
                path = f"/api/v1/sessions/{session}/captures/{capture_id(number)}"
                assert client.put(path, content=upload(number)).status_code == 201
                assert client.get(path + "/thumbnail").status_code == 200
                while client.get(path + "/mpi").status_code != 200:
                    pass
            client.delete(f"/api/v1/sessions/{session}/captures/{capture_id(3)}")
    return root


def client_of(root: Path) -> TestClient:
    config = ServerOptions(devices=None, client_dir=root)
    app = create_app(store=SessionStore(root), config=config)
    return TestClient(app, base_url="http://localhost", raise_server_exceptions=True)


def copied(made: Path, root: Path) -> Path:
    for path in made.rglob("*"):
        target = root / path.relative_to(made)
        if path.is_dir():
            target.mkdir(exist_ok=True)
        else:
            target.write_bytes(path.read_bytes())
    return root


def garbled(data: bytes, how: str, generator: random.Random) -> bytes:
    at = generator.randrange(len(data)) if data else 0
    match how:
        case "zeros":
            return data[:at] + bytes(min(200, len(data) - at)) + data[at + 200 :]
        case "cut":
            return data[:at]
        case "byte":
            return data[:at] + bytes([generator.randrange(256)]) + data[at + 1 :]
        case "digit":
            digits = [n for n, byte in enumerate(data) if byte in b"0123456789"]
            at = generator.choice(digits or [0])
            return (
                data[:at] + str(generator.choice([0, 7, 10**9, 10**400])).encode() + data[at + 1 :]
            )
        case "line":
            lines = data.splitlines(keepends=True)
            del lines[generator.randrange(len(lines)) if lines else slice(0)]
            return b"".join(lines)
        case _:
            return generator.randbytes(len(data))


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["zeros", "cut", "byte", "digit", "line", "noise"]), st.integers(0, 2**32))
def test_whatever_is_garbled_the_rest_is_served(
    tmp_path_factory: pytest.TempPathFactory, made: Path, how: str, seed: int
) -> None:
    generator = random.Random(seed)
    root = copied(made, tmp_path_factory.mktemp("garbled"))
    (folder,) = root.glob(f"*_{SESSION_ID[:8]}")
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    victim = generator.choice(files)
    victim.write_bytes(garbled(victim.read_bytes(), how, generator))
    with client_of(root) as client:
        sessions = {s["id"] for s in client.get("/api/v1/sessions").json()}
        assert SOUND_ID in sessions
        sound = client.get(f"/api/v1/sessions/{SOUND_ID}").json()
        assert [c["removed"] for c in sound["captures"]] == [False, False, True]
        for session in sessions:
            path = f"/api/v1/sessions/{session}"
            captures = client.get(path).json()["captures"]
            for address in ("peaked", "dataset.zip"):
                assert client.get(f"{path}/{address}").status_code == 200
            for capture in captures:
                for address in ("photo", "thumbnail", "mpi"):
                    answer = client.get(f"{path}/captures/{capture['id']}/{address}")
                    assert answer.status_code in (200, 404) or (
                        victim.parent.name == "images"
                        and answer.status_code == 500
                        and "Something went wrong" not in answer.json()["detail"]
                    )
                    assert answer.content != photo(3)
            again = client.put(f"{path}/captures/{capture_id(7)}", content=upload(7))
            assert again.status_code == 201
    kept = {path.read_bytes() for path in root.rglob("images/*.jpg")}
    for number in (1, 2, 7):
        assert victim.parent.name == "images" or photo(number) in kept


def lose_line(log: Path, number: int) -> None:
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:number] + lines[number + 1 :]))


def begun_with(root: Path, *numbers: int) -> SessionStore:
    store = SessionStore(root)
    session = store.begin(SESSION_ID, NEW)[0]
    for number in numbers:
        session.store_capture(capture_id(number), parse_upload(upload(number)))
    session.refresh_dataset()
    return store


def reopened(store: SessionStore) -> SessionStore:
    store.close()
    return SessionStore(store.root)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("log.jsonl", b'"world_from_cam":[', b'"world_from_cam":[7'),
        ("log.jsonl", b'"number":1', b'"number":1' + b"0" * 400),
        ("log.jsonl", b'{"type":"SessionBegun"', b"[" * 100_000),
        ("transforms.json", b'"transform_matrix": [[', b'"transform_matrix": [[1' + b"0" * 400),
    ],
)
def test_no_damage_stops_the_server(tmp_path: Path, name: str, old: bytes, new: bytes) -> None:
    store = begun_with(tmp_path, 1, 2)
    folder = store.get(SESSION_ID).folder
    store.begin(SOUND_ID, NEW)
    store.erase(capture_id(9))  # from now on it is looked who is who
    data = (folder / name).read_bytes()
    assert old in data
    (folder / name).write_bytes(data.replace(old, new))
    if name == "transforms.json":
        lose_line(folder / "log.jsonl", 1)
    store = reopened(store)
    store.get(SOUND_ID)
    assert any(folder.name in problem for problem in store.problems)
    assert {path.read_bytes() for path in folder.glob("images/*")} == {photo(1), photo(2)}


def test_copies_beside_the_photos_are_left_alone(tmp_path: Path) -> None:
    store = begun_with(tmp_path, 1, 2)
    folder = store.get(SESSION_ID).folder
    copy = folder / "images" / "000001 copy.jpg"
    copy.write_bytes(photo(1))
    lose_line(folder / "log.jsonl", 2)
    assert len(reopened(store).get(SESSION_ID).captures) == 2
    assert copy.exists()


def test_a_photo_that_is_missing_takes_nothing_along_and_may_come_back(tmp_path: Path) -> None:
    store = begun_with(tmp_path, 1, 2)
    images = store.get(SESSION_ID).folder / "images"
    images.rename(tmp_path / "elsewhere")
    store = reopened(store)
    session = store.get(SESSION_ID)
    assert sum("is missing" in problem for problem in store.problems) == 2
    assert [c.removed for c in session.captures] == [True, True]
    assert all("missing" in (c.problem or "") for c in session.captures)
    session.finish(True)
    images.rmdir()
    (tmp_path / "elsewhere").rename(images)
    session = reopened(store).get(SESSION_ID)
    assert len(session.dataset_files()) == 5
    assert session.frame_of(capture_id(1)).depth_m is not None


def test_a_photo_that_was_brought_back_stays_when_the_line_is_lost(tmp_path: Path) -> None:
    store = begun_with(tmp_path, 1)
    session = store.get(SESSION_ID)
    session.remove_capture(capture_id(1))
    session.restore_capture(capture_id(1))
    log = session.folder / "log.jsonl"
    log.write_bytes(log.read_bytes().replace(b"CaptureRestored", b"Capture\0estored"))
    session = reopened(store).get(SESSION_ID)
    assert not session.capture(capture_id(1)).removed
    session.finish(True)
    assert len(session.dataset_files()) == 3


@pytest.mark.parametrize("ending", ["erased", "undone"])
def test_what_was_taken_back_is_not_taken_in_when_its_line_is_lost(
    tmp_path: Path, ending: str
) -> None:
    store = begun_with(tmp_path, 1, 2)
    session = store.get(SESSION_ID)
    (session.erase_capture if ending == "erased" else session.remove_capture)(capture_id(1))
    session.refresh_dataset()
    lose_line(session.folder / "log.jsonl", 1)
    session = reopened(store).get(SESSION_ID)
    with pytest.raises(BadUpload, match="taken back"):
        session.store_capture(capture_id(1), parse_upload(upload(1)))
    session.finish(True)
    assert photo(1) not in {path.read_bytes() for path in tmp_path.rglob("*.jpg")}


@pytest.mark.parametrize("damage", ["lost", "first line"])
def test_a_deleted_session_stays_deleted_and_is_erased_in_time(tmp_path: Path, damage: str) -> None:
    store = begun_with(tmp_path, 1)
    folder = store.delete(SESSION_ID).folder
    log = folder / "log.jsonl"
    if damage == "lost":
        log.write_bytes(log.read_bytes().replace(b"SessionDeleted", b"Session\0eleted"))
    else:
        log.write_bytes(b"\0" + log.read_bytes()[1:])
    store = reopened(store)
    with pytest.raises(SessionGone):
        store.get(SESSION_ID)
    with pytest.raises(SessionGone):
        store.begin(SESSION_ID, NEW)
    store.close()
    later = time.time() + RESTORABLE_S + 1
    SessionStore(tmp_path, clock=lambda: later)
    assert not list(tmp_path.rglob("*.jpg"))


def test_an_mpi_that_the_log_does_not_know_is_no_metric_one(tmp_path: Path) -> None:
    store = begun_with(tmp_path, 1)
    session = store.get(SESSION_ID)
    session.mark_ready(capture_id(1), empty_mpi(), generator="layered", guessed=True)
    lose_line(session.folder / "log.jsonl", 2)
    session = reopened(store).get(SESSION_ID)
    assert session.capture(capture_id(1)).state == "queued"
    again = session.mark_ready(capture_id(1), empty_mpi(), generator="layered")
    assert again.mpi_version == 2  # its address never meant something else


@pytest.mark.parametrize("how", ["garbled", "lost"])
def test_a_capture_whose_line_is_gone_is_found_again(tmp_path: Path, how: str) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    for number in (1, 2):
        session.store_capture(capture_id(number), parse_upload(upload(number)))
    session.refresh_dataset()
    before = session.capture(capture_id(1))
    log = session.folder / "log.jsonl"
    if how == "lost":
        lose_line(log, 1)
    else:
        data = log.read_bytes()
        at = data.index(b"CaptureStored")
        log.write_bytes(data[:at] + bytes(100) + data[at + 100 :])
    store.close()
    store = SessionStore(tmp_path)
    found = store.get(SESSION_ID).capture(capture_id(1))
    assert (found.id, found.number, found.time_s) == (before.id, before.number, before.time_s)
    assert found.camera.pinhole == before.camera.pinhole
    assert found.camera.world_from_cam == pytest.approx(before.camera.world_from_cam)
    store.close()
    assert SessionStore(tmp_path).get(SESSION_ID).capture(capture_id(1)) == found


def test_bad_samples_are_dropped_and_said_once(tmp_path: Path) -> None:
    store = SessionStore(tmp_path)
    session = store.begin(SESSION_ID, NEW)[0]
    samples = [msgspec.convert(SAMPLE | {"time_s": float(n)}, wire.PeakedSample) for n in range(5)]
    session.add_peaked(samples)
    path = session.folder / "peaked.jsonl"
    data = path.read_bytes()
    path.write_bytes(data[:150] + bytes(150) + data[300:])
    store.close()
    store = SessionStore(tmp_path)
    again = store.get(SESSION_ID)
    assert {s.time_s for s in again.peaked()} < {0.0, 1.0, 2.0, 3.0, 4.0}
    assert again.peaked()[-1].time_s == 4.0
    assert len(store.problems) == 1
    assert "samples cannot be read" in store.problems[0]
    assert again.summary().damaged == 1


def test_a_damaged_mpi_is_made_again_at_another_address(made: Path, tmp_path: Path) -> None:
    root = copied(made, tmp_path)
    for mpi in root.glob("*/mpi/000001.mpi"):
        data = bytearray(mpi.read_bytes())
        data[-1] ^= 1
        mpi.write_bytes(bytes(data))
    path = f"/api/v1/sessions/{SESSION_ID}/captures/{capture_id(1)}/mpi"
    with client_of(root) as client:
        answer = client.get(path)
        assert answer.status_code == 404
        assert "immutable" not in answer.headers.get("cache-control", "")
        while client.get(path + "/2").status_code != 200:
            pass
        captures = client.get(f"/api/v1/sessions/{SESSION_ID}").json()["captures"]
        assert (captures[0]["state"], captures[0]["mpi_version"]) == ("ready", 2)


def test_a_damaged_thumbnail_is_made_again(made: Path, tmp_path: Path) -> None:
    root = copied(made, tmp_path)
    sound = {}
    for thumbnail in root.glob("*/mpi/000001.thumbnail.*.jpg"):
        data = bytearray(thumbnail.read_bytes())
        sound[thumbnail] = bytes(data)
        data[len(data) // 2] ^= 1
        thumbnail.write_bytes(bytes(data))
    path = f"/api/v1/sessions/{SESSION_ID}/captures/{capture_id(1)}/thumbnail"
    with client_of(root) as client:
        assert client.get(path).content in sound.values()
        (folder,) = root.glob(f"*_{SESSION_ID[:8]}")
        (kept,) = folder.glob("mpi/000001.thumbnail.*.jpg")
        assert kept.read_bytes() == sound[kept]
