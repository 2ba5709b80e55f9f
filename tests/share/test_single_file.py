"""One HTML file: nothing is fetched, and what is inside is what was put there."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from peaking.errors import ToolMissing
from peaking.share.place import Place, PlaceView, SharedPlace
from peaking.share.single_file import packed_bytes, page_with_place
from peaking.share.writing import room_for
from recordings import lateral_cameras
from stub_client import write_client

TITLE = "Tom & Jerry's </title><script>alert(1)</script>"


class _Elements(HTMLParser):
    """Elements as a browser finds them, with their text."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None], str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), ""))

    def handle_data(self, data: str) -> None:
        if self.found:
            tag, attributes, text = self.found[-1]
            self.found[-1] = (tag, attributes, text + data)


def elements(page: bytes) -> list[tuple[str, dict[str, str | None], str]]:
    """Return the elements of a page, with what stands in each up to the next."""
    parser = _Elements()
    parser.feed(page.decode())
    return parser.found


@pytest.fixture
def client(tmp_path: Path) -> Path:
    return write_client(tmp_path / "client")


def a_place(splat: str | None = None) -> Place:
    (camera,) = lateral_cameras(1, 64, 48)
    view = PlaceView("a", camera, mpi="mpis/0.mpi")
    return Place(TITLE, "light-field", [view], licence="</script>", splat=splat)


def test_nothing_is_fetched(client: Path) -> None:
    for tag, attributes, _ in elements(page_with_place(a_place(), {}, client)):
        assert "src" not in attributes
        assert tag != "link"
        assert attributes.get("type") in (None, "application/json", "text/plain")


def test_what_is_inside_is_what_was_put_there(client: Path) -> None:
    data = np.random.default_rng(0).integers(0, 256, 1001, np.uint8).tobytes()
    page = page_with_place(a_place(), {"mpis/0.mpi": data, "poster.jpg": b""}, client)
    inlined = {a["data-file"]: text for _, a, text in elements(page) if "data-file" in a}
    assert base64.b64decode(inlined["mpis/0.mpi"]) == data
    assert base64.b64decode(inlined["poster.jpg"]) == b""


def test_the_place_is_read_back_whatever_it_is_called(client: Path) -> None:
    found = elements(page_with_place(a_place(), {}, client))
    (text,) = (text for _, attributes, text in found if attributes.get("id") == "place")
    assert json.loads(text) == json.loads(a_place().to_json())
    assert [text.strip() for tag, _, text in found if tag == "title"] == [TITLE]


def test_the_script_comes_last_and_does_not_end_early(client: Path) -> None:
    found = elements(page_with_place(a_place(), {}, client))
    tag, attributes, text = found[-1]
    assert (tag, attributes) == ("script", {})
    assert r"'\x3c/script>'; show(end);" in text
    assert ("main", {"id": "view"}) in [(tag, attributes) for tag, attributes, _ in found]


def test_what_is_looked_at_first_comes_first_after_the_script(client: Path) -> None:
    cameras = lateral_cameras(3, 64, 48)
    views = [PlaceView(str(i), camera, mpi=f"mpis/{i}.mpi") for i, camera in enumerate(cameras)]
    place = Place(TITLE, "light-field", views, start=2)
    files = {"poster.jpg": b"", **{f"mpis/{i}.mpi": b"" for i in range(3)}}
    found = elements(page_with_place(place, files, client))
    order = [a.get("data-file", a.get("id", tag)) for tag, a, _ in found if tag == "script"]
    assert order == ["place", "poster.jpg", "script", "mpis/2.mpi", "mpis/1.mpi", "mpis/0.mpi"]


def test_gaussians_need_the_large_viewer(client: Path) -> None:
    assert b"showAll" not in page_with_place(a_place(), {}, client)
    assert b"showAll" in page_with_place(a_place("splat.ply"), {}, client)


def test_all_styles_are_inside(client: Path) -> None:
    style = re.search(rb"<style>(.*?)</style>", page_with_place(a_place(), {}, client), re.DOTALL)
    assert style is not None
    assert b"body { margin: 0 }" in style[1]
    assert b".strip" in style[1]


def test_the_room_that_is_promised_is_there(client: Path, tmp_path: Path) -> None:
    """What fits into it does not make the page larger than was allowed."""
    room = room_for(SharedPlace(a_place()), tmp_path / "a.html", 100_000, client)
    page = page_with_place(a_place(), {"mpis/0.mpi": bytes(room - 100)}, client)
    assert 99_000 < len(page) <= 100_000
    bare = page_with_place(a_place(), {}, client)
    page = page_with_place(a_place(), {"photos/00000.jpg": bytes(1000)}, client)
    assert len(page) - len(bare) == packed_bytes(1000)


def test_a_client_that_is_not_built_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(ToolMissing, match="run: make client"):
        page_with_place(a_place(), {}, tmp_path)
