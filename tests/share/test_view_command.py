"""`peaking view`: a page on this machine whose files are made when they are asked for."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import peaking.server.serving
from peaking.cli import main
from peaking.commands.view import View
from peaking.datasets import open_recording
from peaking.errors import MpiFileError
from peaking.mpi_file import decode
from peaking.options import DEFAULT
from peaking.server.serving import bind
from peaking.share.place import Place, PlaceView, SharedPlace
from peaking.share.place_server import PlaceServer
from peaking.share.recorded_files import RecordedFiles
from peaking.share.recorded_place import MOST_VIEWS, place_of_recording, whole_contents
from recordings import lateral_cameras, write_recording
from stub_client import PAGE, write_client


@contextmanager
def served(shared: SharedPlace, client: Path) -> Generator[PlaceServer]:
    with PlaceServer(bind("127.0.0.1", 0), shared, client) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def get(
    server: PlaceServer, path: str, *, host: str | None = None, method: str = "GET"
) -> tuple[int, str, bytes]:
    """Return status, type and body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    connection.request(method, path, headers={"Host": host or f"localhost:{server.port}"})
    answer = connection.getresponse()
    found = answer.status, answer.getheader("Content-Type") or "", answer.read()
    connection.close()
    return found


@pytest.fixture
def client(tmp_path: Path) -> Path:
    return write_client(tmp_path / "client")


def test_the_page_its_parts_and_files_made_when_asked_for(client: Path, tmp_path: Path) -> None:
    room = write_recording(tmp_path / "room", num_frames=3, width_px=160, height_px=120)
    files = RecordedFiles(open_recording(room), replace(DEFAULT, pixels=19200))
    before = set(tmp_path.rglob("*"))
    with served(place_of_recording(files, whole_contents(files)), client) as server:
        status, kind, body = get(server, "/")
        assert (status, kind) == (200, "text/html; charset=utf-8")
        assert body.decode() == PAGE.replace("<title>peaking", "<title>room")
        assert get(server, "/assets/view-abc.js")[:2] == (200, "text/javascript")
        place = json.loads(get(server, "/place.json")[2])
        view = place["views"][1]
        assert decode(get(server, f"/{view['mpi']}")[2]).camera.pinhole.size_px == (160, 120)
        assert get(server, f"/{view['photo']}?a=b")[:2] == (200, "image/jpeg")
        assert len(get(server, "/points.bin")[2]) % 15 == 0
        status, _, body = get(server, f"/{view['mpi']}", method="HEAD")
        assert (status, body) == (200, b"")
    assert set(tmp_path.rglob("*")) == before


def a_place(**files: Callable[[], bytes]) -> SharedPlace:
    (camera,) = lateral_cameras(1, 64, 48)
    return SharedPlace(Place("a", "place", [PlaceView("a", camera)]), files)


def test_only_what_a_place_names_is_there(client: Path) -> None:
    with served(a_place(), client) as server:
        for path in ("/nothing", "/../client/view.html", "/%2e%2e/view.html", "/assets/"):
            status, kind, body = get(server, path)
            assert (status, kind) == (404, "application/problem+json")
            assert json.loads(body)["detail"] == "There is nothing at this address."


def test_other_names_of_this_machine_are_refused(client: Path) -> None:
    with served(a_place(), client) as server:
        for host in (
            "evil.example",
            f"evil.example:{server.port}",
            "localhost.evil:80",
            "[::1",
        ):
            assert get(server, "/place.json", host=host)[0] == 403
        assert get(server, "/place.json", host=f"127.0.0.1:{server.port}")[0] == 200
        assert get(server, "/place.json", host="localhost")[0] == 200


def test_a_file_that_cannot_be_made_is_a_sentence(client: Path) -> None:
    def broken() -> bytes:
        raise MpiFileError("frame_3: cannot be read; take it again")

    with served(a_place(broken=broken), client) as server:
        status, kind, body = get(server, "/broken")
        assert (status, kind) == (422, "application/problem+json")
        assert json.loads(body)["detail"] == "frame_3: cannot be read; take it again"


def test_the_first_image_is_made_before_it_is_asked_for(client: Path) -> None:
    made, broke = threading.Event(), threading.Event()

    def make() -> bytes:
        made.set()
        return b"abc"

    def broken() -> bytes:
        broke.set()
        raise MpiFileError("frame_3: cannot be read; take it again")

    for event, maker in ((made, make), (broke, broken)):
        (camera,) = lateral_cameras(1, 64, 48)
        place = Place("a", "light-field", [PlaceView("a", camera, mpi="a.mpi")])
        with served(SharedPlace(place, {"a.mpi": maker}), client) as server:
            server.warm_up()
            assert event.wait(60)


def test_a_file_is_made_once(client: Path) -> None:
    made: list[int] = []

    def once() -> bytes:
        made.append(1)
        return b"abc"

    with served(a_place(once=once), client) as server:
        assert [get(server, "/once")[2] for _ in range(3)] == [b"abc"] * 3
    assert made == [1]


def test_long_recordings_show_some_of_their_frames(tmp_path: Path) -> None:
    room = write_recording(tmp_path / "room", num_frames=130, width_px=16, height_px=12)
    contents = whole_contents(RecordedFiles(open_recording(room), DEFAULT))
    assert len(contents.indices) == MOST_VIEWS
    assert (contents.indices[0], contents.indices[-1]) == (0, 129)


def test_without_depth_cameras_and_photographs_are_shown(tmp_path: Path) -> None:
    flat = write_recording(tmp_path / "flat", num_frames=3, with_depth=False)
    files = RecordedFiles(open_recording(flat), DEFAULT)
    place = place_of_recording(files, whole_contents(files)).place
    assert (place.shown, place.options, place.points) == ("place", None, None)
    assert [view.mpi for view in place.views] == [None] * 3


def test_the_browser_is_opened_and_ctrl_c_ends_it(
    client: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    room = write_recording(tmp_path / "room", num_frames=2)
    opened: list[str] = []

    def interrupted(_: PlaceServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(peaking.server.serving, "CLIENT_DIR", client)
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(PlaceServer, "serve_forever", interrupted)
    View(room, port=0).run()
    assert opened[0].startswith("http://localhost:")
    assert opened[0] in capsys.readouterr().out


@pytest.mark.parametrize("name", ["broken.mpi", "broken.ply", "broken.spz", "broken.zip", "none"])
def test_what_cannot_be_shown_is_a_sentence(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if name != "none":
        (tmp_path / name).write_bytes(b"nothing of that kind")
    with pytest.raises(SystemExit) as ended:
        main(["view", str(tmp_path / name), "--no-open"])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert name in said
    assert "Traceback" not in said
