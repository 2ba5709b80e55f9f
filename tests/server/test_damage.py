"""Any byte of any file of a session may be garbled: the rest is served."""

from __future__ import annotations

import random
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session, photo, upload
from peaking.server import wire
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore
from peaking.server.upload import parse_upload

SOUND_ID = "50d0d011-0000-4000-8000-000000000001"
SAMPLE = {"peaked_share": 0.25, "missing_share": 0.0, "views": 1, "world_from_cam": [1.0] * 12}
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
    config = ServerOptions(token=None, client_dir=root)
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
        case "line":
            lines = data.splitlines(keepends=True)
            del lines[generator.randrange(len(lines)) if lines else slice(0)]
            return b"".join(lines)
        case _:
            return generator.randbytes(len(data))


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["zeros", "cut", "byte", "line", "noise"]), st.integers(0, 2**32))
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
