"""Uploads and stored files that cost or tell too much, and what phones are told of problems."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

from capture_uploads import (
    SESSION_ID,
    body_of,
    capture_id,
    depth_mm,
    header,
    new_session,
    photo,
    upload,
    upload_without_depth,
)
from foreign_pictures import GPS, jpeg, telling_jpeg, with_frame, with_scans, with_size
from patience import PATIENCE_S
from peaking.datasets import open_recording
from peaking.errors import OutputError, PeakingError, RecordingError
from peaking.server import attempts, generation, thumbnails
from peaking.server.app import ServerOptions, create_app
from peaking.server.attempts import Attempts, GaveUp
from peaking.server.recordings import PlayedRecording
from peaking.server.sessions import SessionStore
from peaking.server.told import without_paths
from peaking.server.upload import BadUpload, parse_upload
from recordings import write_recording

SESSION = f"/api/v1/sessions/{SESSION_ID}"
CAPTURE = f"{SESSION}/captures/{capture_id(1)}"


def upload_of(data: bytes, **fields: Any) -> bytes:
    """Return an upload of any photo."""
    return body_of(header(photo_bytes=len(data), **fields), data + depth_mm().tobytes())


def of_size(width: int, height: int) -> dict[str, Any]:
    camera = header()["camera"]
    size = {"width_px": width, "height_px": height, "cx_px": width / 2, "cy_px": height / 2}
    return {"camera": camera | {"pinhole": camera["pinhole"] | size}}


Open = Callable[..., TestClient]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Open]:
    clients: list[TestClient] = []

    def open_client(**config: Any) -> TestClient:
        options = ServerOptions(devices=None, client_dir=tmp_path / "none", **config)
        store = SessionStore(tmp_path / "the store" / "sessions")
        client = TestClient(
            create_app(store=store, config=options),
            base_url="http://localhost",
            raise_server_exceptions=False,
        )
        client.__enter__()
        clients.append(client)
        client.put(SESSION, json=new_session())
        return client

    yield open_client
    for client in clients:
        client.__exit__(None, None, None)


@pytest.fixture
def no_generation(monkeypatch: pytest.MonkeyPatch) -> None:
    def work(self: Any) -> None:
        while self._waiting.get() is not None:
            pass

    monkeypatch.setattr(generation.GenerationQueue, "_work", work)


# --- uploads -------------------------------------------------------------------------------------

PLAIN = jpeg(60, 128)
PROGRESSIVE = jpeg(60, 128, progressive=True)


@pytest.mark.parametrize(
    ("data", "fields", "says"),
    [
        (with_scans(PROGRESSIVE, 2000), {}, "scans"),
        (with_size(with_scans(PROGRESSIVE, 60), 8192, 8192), of_size(8192, 8192), "scans"),
        (with_size(PLAIN, 65000, 65000), of_size(8192, 8192), "65000x65000"),
        (with_frame(PLAIN, 0xC9), {}, "arithmetic"),
        (with_frame(PLAIN, 0xC3), {}, "lossless"),
        (PLAIN[:2] + PLAIN[2:] * 2, {}, ""),
    ],
)
@pytest.mark.usefixtures("no_generation")
def test_a_costly_photo_is_refused_before_it_is_acknowledged(
    opened: Open, data: bytes, fields: dict[str, Any], says: str
) -> None:
    client = opened()
    answer = client.put(CAPTURE, content=upload_of(data, **fields))
    if says:
        assert answer.status_code == 422
        assert says in answer.json()["detail"]
        assert client.get(SESSION).json()["captures"] == []


@pytest.mark.parametrize("data", [PLAIN, PROGRESSIVE, jpeg(60, 128, grey=True)])
def test_ordinary_photos_are_taken(data: bytes) -> None:
    assert parse_upload(upload_of(data)).photo == data


def test_a_photo_of_50_megapixels_is_taken() -> None:
    data = with_size(jpeg(60, 128, progressive=True), 6144, 8160)
    body = body_of(header(photo_bytes=len(data), depth=None, **of_size(6144, 8160)), data)
    assert parse_upload(body).photo == data


# --- metadata ------------------------------------------------------------------------------------


def jpegs_of(client: TestClient) -> list[bytes]:
    archive = zipfile.ZipFile(io.BytesIO(client.get(f"{SESSION}/dataset.zip").content))
    return [
        client.get(f"{CAPTURE}/photo").content,
        client.get(f"{CAPTURE}/thumbnail").content,
        archive.read("images/000001.jpg"),
    ]


@pytest.mark.usefixtures("no_generation")
def test_a_photo_is_stored_without_metadata(opened: Open, tmp_path: Path) -> None:
    client = opened()
    assert client.put(CAPTURE, content=upload_of(telling_jpeg(PLAIN))).status_code == 201
    assert all(GPS not in data for data in jpegs_of(client))
    stored = [path for path in (tmp_path / "the store").rglob("*") if path.is_file()]
    assert not [path for path in stored if GPS in path.read_bytes()]
    served, sent = (simplejpeg.decode_jpeg(data) for data in (jpegs_of(client)[0], PLAIN))
    np.testing.assert_array_equal(served, sent)
    archive = zipfile.ZipFile(io.BytesIO(client.get(f"{SESSION}/dataset.zip").content))
    top = json.loads(archive.read("transforms.json"))
    assert top["frames"][0]["timestamp"] == header()["time_s"]
    assert top["frames"][0]["fl_x"] == 90.0


@pytest.mark.usefixtures("no_generation")
def test_metadata_stays_when_it_is_wanted(opened: Open) -> None:
    client = opened(keep_exif=True)
    told = telling_jpeg(PLAIN)
    assert client.put(CAPTURE, content=upload_of(told)).status_code == 201
    assert jpegs_of(client)[0] == jpegs_of(client)[2] == told


@pytest.mark.usefixtures("no_generation")
def test_what_was_stored_before_is_handed_on_without_metadata(opened: Open, tmp_path: Path) -> None:
    client = opened()
    client.put(CAPTURE, content=upload_of(PLAIN))
    (path,) = (tmp_path / "the store").rglob("images/000001.jpg")
    path.write_bytes(telling_jpeg(PLAIN))
    assert all(GPS not in data for data in jpegs_of(client))


@pytest.mark.usefixtures("no_generation")
@pytest.mark.parametrize("name", ["images/000001.jpg", "depth/000001.png"])
def test_a_link_in_a_stored_session_is_not_followed(
    opened: Open, tmp_path: Path, name: str
) -> None:
    client = opened()
    client.put(CAPTURE, content=upload_of(PLAIN))
    (path,) = (tmp_path / "the store").rglob(name)
    secret = jpeg(60, 128, grey=True)
    (tmp_path / "secret").write_bytes(secret)
    path.unlink()
    path.symlink_to(tmp_path / "secret")
    archive = client.get(f"{SESSION}/dataset.zip").content
    assert name not in zipfile.ZipFile(io.BytesIO(archive)).namelist()
    if name.endswith("jpg"):
        for address in ("photo", "thumbnail"):
            answer = client.get(f"{CAPTURE}/{address}")
            assert answer.status_code == 500
            assert "link that leaves" in answer.json()["detail"]


# --- what is decoded at once ---------------------------------------------------------------------


@pytest.mark.usefixtures("no_generation")
def test_few_pictures_are_decoded_at_once(opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    now, most, lock = [0], [0], threading.Lock()
    two = threading.Event()
    real = thumbnails.read_picture

    def counted(path: Path, *, within: Path) -> np.ndarray:
        with lock:
            now[0] += 1
            most[0] = max(most[0], now[0])
            if most[0] == 2:
                two.set()
        assert two.wait(PATIENCE_S)
        time.sleep(0.05)  # whoever may come now, comes
        with lock:
            now[0] -= 1
        return real(path, within=within)

    monkeypatch.setattr(thumbnails, "read_picture", counted)
    client = opened()
    for number in range(1, 9):
        client.put(f"{SESSION}/captures/{capture_id(number)}", content=upload(number))

    def ask(number: int) -> None:
        assert client.get(f"{SESSION}/captures/{capture_id(number)}/thumbnail").status_code == 200

    askers = [threading.Thread(target=ask, args=(number,)) for number in range(1, 9)]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join()
    assert most[0] == 2


# --- what killed the server ----------------------------------------------------------------------


def die_in_attempt(marker: Path, photo_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; "
        "from peaking.server.attempts import Attempts; "
        "marker, photo = map(Path, sys.argv[1:])\n"
        "with Attempts().counted(lambda: marker, photo): os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(marker), str(photo_path)], check=False)
    assert done.returncode == -9


def test_what_killed_the_server_twice_is_given_up(tmp_path: Path) -> None:
    marker, path = tmp_path / ".000001.begun", tmp_path / "a.jpg"
    path.write_bytes(PLAIN)
    die_in_attempt(marker, path)
    die_in_attempt(marker, path)
    for _ in range(2):
        with (
            pytest.raises(GaveUp, match="not tried again"),
            Attempts().counted(lambda: marker, path),
        ):
            raise AssertionError("it was tried")


def test_after_one_death_the_photo_is_looked_at_from_afar(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marker, path = tmp_path / ".000001.begun", tmp_path / "a.jpg"
    path.write_bytes(PLAIN)
    marker.write_bytes(b"x")
    with Attempts().counted(lambda: marker, path):  # a power cut, say: the photo is innocent
        pass
    assert not marker.exists()
    path.write_bytes(b"no picture")
    marker.write_bytes(b"x")
    with pytest.raises(GaveUp), Attempts().counted(lambda: marker, path):
        raise AssertionError("it was tried")


def test_an_error_is_no_death(tmp_path: Path) -> None:
    marker = tmp_path / ".000001.begun"
    with pytest.raises(KeyError), Attempts().counted(lambda: marker, tmp_path / "a.jpg"):
        raise KeyError
    assert not marker.exists()


def test_the_queue_gives_up_with_a_sentence(opened: Open, tmp_path: Path) -> None:
    client = opened()
    (mpis,) = (tmp_path / "the store").rglob("mpi")
    (mpis / ".000001.first.begun").write_bytes(b"x" * attempts.MAX_DEATHS)
    client.put(CAPTURE, content=upload())
    capture = wait_for(client, "failed")
    assert "not tried again" in capture["problem"]


def wait_for(client: TestClient, state: str) -> dict[str, Any]:
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        captures = client.get(SESSION).json()["captures"]
        if captures[0]["state"] == state:
            return captures[0]
        time.sleep(0.1)
    raise AssertionError(f"never {state}")


# --- problems without paths ----------------------------------------------------------------------


def test_problems_name_files_and_not_where_they_lie() -> None:
    root = Path("/srv/my photos/sessions")
    for text, told in {
        "/srv/my photos/sessions/s1/images/1.jpg: is bad; go": "s1/images/1.jpg: is bad; go",
        "/home/me/a b/x.pth: w: is cut off; fetch it": "x.pth: w: is cut off; fetch it",
        "does not open (/tmp/q/a.mpi: broken); check": "does not open (a.mpi: broken); check",
        "1/2 and/or b of image/jpeg at https://host/b": "1/2 and/or b of image/jpeg at https://host/b",
        "~/.local/share/peaking/x.pth: is missing": "x.pth: is missing",
        "The photo is saved.": "The photo is saved.",
        "no (reading /home/My Name/study/x.jpg: bad)": "no (reading x.jpg: bad)",
        "C:\\Users\\me\\x.jpg: is bad": "x.jpg: is bad",
    }.items():
        assert without_paths(text, root) == told


@pytest.mark.parametrize("root", [".", "/", "a", "data"])
def test_short_folders_take_no_letters_away(root: str) -> None:
    text = "frames[3].file_path: data/a.b is 1.5 m away; see a/b, ../x."
    assert without_paths(text, Path(root)).startswith("frames[3].file_path: ")
    assert "1.5 m away; see" in without_paths(text, Path(root))


@given(st.lists(st.text("ab c:é.-", min_size=1, max_size=5), min_size=1, max_size=4), st.booleans())
def test_no_folder_of_the_server_is_told(parts: list[str], relative: bool) -> None:
    root = Path("/".join(["" if not relative else "data", "secret", *parts]))
    for kind in (RecordingError, OutputError):
        path = root / "s1" / "000001.jpg"
        error: PeakingError
        if kind is RecordingError:
            error = RecordingError(path, "is damaged", remedy="send it again")
        else:
            error = OutputError(f"{path}: no room; free some space")
        told = without_paths(str(error), root)
        assert "secret" not in told
        assert told.split(": ", 1)[1] == str(error)[len(str(path)) + 2 :]


def failures(store: Path) -> dict[str, Callable[[], None]]:
    """Return ways to damage the one capture on the disk."""

    def every(pattern: str, data: bytes | None) -> Callable[[], None]:
        def act() -> None:
            found = list(store.rglob(pattern))
            assert found
            for path in found:
                path.unlink() if data is None else path.write_bytes(data)

        return act

    return {
        "photo cut off": every("images/000001.jpg", photo()[:-40]),
        "photo no picture": every("images/000001.jpg", b"no picture"),
        "photo costly": every("images/000001.jpg", with_scans(PROGRESSIVE, 3000)),
        "photo gone": every("images/000001.jpg", None),
        "depth damaged": every("depth/000001.png", b"\x89PNG\r\n\x1a\n"),
        "depth gone": every("depth/000001.png", None),
    }


@pytest.mark.parametrize("case", failures(Path()))
def test_what_phones_are_told_has_no_path_and_a_cause(
    opened: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    store = tmp_path / "the store"
    real = generation.GenerationQueue.put
    held: list[Any] = []

    def hold(_: object, *item: object) -> None:
        held.append(item)

    monkeypatch.setattr(generation.GenerationQueue, "put", hold)
    client = opened()
    client.put(CAPTURE, content=upload())
    failures(store)[case]()
    queue = client.app.routes[0].endpoint.__self__.queue  # type: ignore[attr-defined]
    for item in held:
        real(queue, *item)
    problem = wait_for(client, "failed")["problem"]
    answers = [problem, client.get(SESSION).text, client.get("/api/v1/sessions").text]
    answers += [
        client.get(address).text
        for address in (f"{SESSION}/selection?views=1", f"{CAPTURE}/photo", f"{CAPTURE}/thumbnail")
        if "image" not in client.get(address).headers["content-type"]
    ]
    for text in answers:
        assert str(tmp_path) not in text
        assert "the store" not in text
        assert "log" not in text or "logo" in text
    assert len(problem) > 20


def test_a_damaged_recording_is_told_without_its_path(opened: Open, tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "secret place" / "desk")
    played = PlayedRecording("desk", open_recording(folder))
    client = opened(recordings={"desk": played})
    (folder / "images/frame_00001.png").write_bytes(b"\x89PNG\r\n\x1a\nbroken")
    (folder / "depths/frame_00002.png").unlink()
    for address in ("frames/1/photo", "frames/2/depth", "frames/2/photo"):
        answer = client.get(f"/api/v1/recordings/desk/{address}")
        assert answer.status_code == 500
        assert "frame_0000" in answer.json()["detail"]
        assert "secret place" not in answer.text


def test_a_photo_without_depth_says_why_it_has_no_mpi(opened: Open) -> None:
    client = opened()
    client.put(CAPTURE, content=upload_without_depth())
    assert "depth" in wait_for(client, "failed")["problem"]


def test_damaged_sessions_are_listed_without_their_path(tmp_path: Path) -> None:
    root = tmp_path / "the store"
    (root / "s1").mkdir(parents=True)
    (root / "s1" / "log.jsonl").write_bytes(b"\0" * 100 + b"\n")
    config = ServerOptions(devices=None, client_dir=tmp_path)
    app = create_app(store=SessionStore(root), config=config)
    handlers: Any = next(r for r in app.routes if getattr(r, "path", "") == "/api/v1/server")
    told = handlers.endpoint.__self__._list().problems
    assert told
    assert not [problem for problem in told if str(tmp_path) in problem]
    handlers.endpoint.__self__.close()


def test_a_wrong_upload_is_told_without_internals() -> None:
    with pytest.raises(BadUpload) as caught:
        parse_upload(upload_of(b"\xff\xd8" + bytes(100) + b"\xff\xd9"))
    assert "holds no picture" in str(caught.value)
