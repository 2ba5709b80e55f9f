"""GET …/selection: every policy on the captures of a live session."""

from __future__ import annotations

import csv
import io
import json
import tempfile
import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
import pytest
from starlette.testclient import TestClient

from capture_uploads import (
    HEIGHT,
    SESSION_ID,
    WIDTH,
    body_of,
    capture_id,
    depth_mm,
    header,
    new_session,
    photo,
    upload,
    upload_without_depth,
)
from peaking.best_frames.files import COLUMNS
from peaking.datasets import open_recording
from peaking.options import DEFAULT, POLICY_NAMES
from peaking.output import encode_jpeg
from peaking.selection.registry import POLICIES
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore
from server.test_two_speeds import wait_for

SESSION = f"/api/v1/sessions/{SESSION_ID}"
CAPTURES = 5
ASKED = {
    "threshold": {"threshold_share": "0.05"},
    "plenoptic": {"spacing_m": "0.05"},
    "all": {},
}
"""What policies go by that are not asked for a number of views here."""


@contextmanager
def started(root: Path) -> Generator[TestClient]:
    """Start a server whose MPIs are small, with a session."""
    options = replace(DEFAULT, pixels=4096, num_planes=8)
    config = ServerOptions(devices=None, client_dir=root, options=options)
    app = create_app(store=SessionStore(root / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        yield client


def send(client: TestClient, number: int, *, photo: bytes | None = None) -> None:
    """Send a capture, and wait for its MPI."""
    body = upload(number)
    if photo is not None:
        body = body_of(header(number, photo_bytes=len(photo)), photo + depth_mm(number).tobytes())
    client.put(f"{SESSION}/captures/{capture_id(number)}", content=body)
    wait_for(client, number, lambda c: c["state"] == "ready")


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Generator[TestClient]:
    with started(tmp_path_factory.mktemp("selection")) as client:
        for n in range(1, CAPTURES + 1):
            send(client, n)
        yield client


def chosen(client: TestClient, **query: str) -> dict[str, Any]:
    answer = client.get(f"{SESSION}/selection", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_every_name_is_a_policy() -> None:
    assert set(POLICY_NAMES) == set(POLICIES)


@pytest.mark.parametrize("policy", sorted(POLICIES))
def test_every_policy_chooses_among_the_captures(client: TestClient, policy: str) -> None:
    found = chosen(client, policy=policy, **ASKED.get(policy, {"views": "2"}))
    assert [capture["number"] for capture in found["captures"]] == list(range(1, CAPTURES + 1))
    assert all(capture["reason"] for capture in found["captures"])
    kept = [capture["number"] for capture in found["captures"] if capture["kept"]]
    if policy not in ASKED:
        assert len(kept) == 2
    assert kept == sorted(kept)
    assert kept
    assert (policy == "all") == (len(kept) == CAPTURES) or policy in ("plenoptic", "threshold")


def test_an_undone_capture_is_no_candidate(client: TestClient) -> None:
    removed = f"{SESSION}/captures/{capture_id(CAPTURES + 1)}"
    client.put(removed, content=upload(CAPTURES + 1))
    client.delete(removed)
    assert len(chosen(client, policy="all")["captures"]) == CAPTURES


def test_ours_says_how_many_are_enough_and_what_is_wrong_with_each(client: TestClient) -> None:
    found = chosen(client)
    assert found["enough"] == sum(capture["kept"] for capture in found["captures"]) >= 1
    numbers = [point["num_views"] for point in found["curve"]]
    assert numbers == list(range(1, CAPTURES + 1))
    assert all(
        capture["sharpness"] > 0 and capture["brightness"] > 0 for capture in found["captures"]
    )
    assert all(capture["faults"] == [] for capture in found["captures"])
    assert "enough" not in chosen(client, views="2") or chosen(client, views="2")["enough"] is None


def test_a_dark_and_a_blurred_capture_are_told(tmp_path: Path) -> None:
    with started(tmp_path) as client:
        for n in range(1, 9):
            rgb = np.random.default_rng(n).integers(60, 200, (HEIGHT, WIDTH, 3)).astype(np.uint8)
            rgb = (rgb // 2).astype(np.uint8) if n == 3 else rgb
            rgb = np.asarray(cv2.blur(rgb, (7, 7)), np.uint8) if n == 6 else rgb
            send(client, n, photo=encode_jpeg(rgb, quality=95))
        faults = {c["number"]: c["faults"] for c in chosen(client)["captures"] if c["faults"]}
        assert faults == {3: ["darker"], 6: ["blurred"]}


def test_asking_twice_computes_once(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    first = chosen(client, views="3")

    def computed_again(*_: object) -> None:
        raise AssertionError

    with monkeypatch.context() as patch:
        patch.setattr("peaking.server.selection.select_captures", computed_again)
        assert chosen(client, views="3") == first
        with pytest.raises(AssertionError):
            client.get(f"{SESSION}/selection", params={"views": "4"})


def test_when_a_capture_changes_it_is_computed_again(tmp_path: Path) -> None:
    with started(tmp_path) as client:
        for n in (1, 2, 3):
            send(client, n)
        assert len(chosen(client)["captures"]) == 3
        client.delete(f"{SESSION}/captures/{capture_id(2)}")
        assert [c["number"] for c in chosen(client)["captures"]] == [1, 3]
        client.delete(SESSION)
        assert client.get(f"{SESSION}/selection").status_code == 410


# The data set of the best


@pytest.mark.parametrize("views", ["2", "auto", "99"])
def test_the_best_are_a_data_set(client: TestClient, tmp_path: Path, views: str) -> None:
    found = chosen(client, **({} if views == "auto" else {"views": views}))
    kept = [f"images/{c['number']:06d}.jpg" for c in found["captures"] if c["kept"]]
    address = f"{SESSION}/dataset.zip?views={views}"
    assert client.head(address).status_code == 200
    answer = client.get(address)
    assert answer.status_code == 200
    assert "-best.zip" in answer.headers["Content-Disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path)
    recording = open_recording(tmp_path)
    assert len(recording) == len(kept) == (2 if views == "2" else len(kept))
    frames = json.loads((tmp_path / "transforms.json").read_text())["frames"]
    assert [frame["file_path"] for frame in frames] == kept
    assert len(list((tmp_path / "images").iterdir())) == len(kept)
    assert all(recording.read(i).depth_m is not None for i in range(len(recording)))
    rows = list(csv.DictReader((tmp_path / "selection.csv").read_text().splitlines()))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == CAPTURES
    assert [row["name"] for row in rows if row["kept"] == "1"] == kept
    assert [row["reason"] for row in rows] == [c["reason"] for c in found["captures"]]


def test_all_of_them_are_as_before(client: TestClient) -> None:
    with zipfile.ZipFile(io.BytesIO(client.get(f"{SESSION}/dataset.zip").content)) as archive:
        names = archive.namelist()
    assert "selection.csv" not in names
    assert sum(name.endswith(".jpg") for name in names) == CAPTURES


@pytest.mark.parametrize("to", ["colmap", "colmap-text", "instant-ngp", "llff", "tum"])
@pytest.mark.parametrize("views", [None, "2"])
def test_the_data_set_comes_in_other_formats(
    client: TestClient, tmp_path: Path, views: str | None, to: str
) -> None:
    query = {"format": to} if views is None else {"format": to, "views": views}
    assert client.head(f"{SESSION}/dataset.zip", params=query).status_code == 200
    answer = client.get(f"{SESSION}/dataset.zip", params=query)
    assert answer.status_code == 200
    assert f"-{to}.zip" in answer.headers["Content-Disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        archive.extractall(tmp_path)
    count = CAPTURES if views is None else 2
    pictures = [name for name in names if name.startswith("rgb/" if to == "tum" else "images/")]
    assert len(pictures) == count
    assert ("selection.csv" in names) == (views is not None)
    assert ("notes.txt" in names) == (to == "tum")
    if to in ("colmap", "colmap-text"):
        model = pycolmap.Reconstruction(tmp_path / "sparse/0")
        assert model.num_reg_images() == count
        assert len(model.points3D) > 100
    if to == "instant-ngp":
        recording = open_recording(tmp_path)
        assert len(recording) == count
        assert all(recording.has_depth)
    assert list(Path(tempfile.gettempdir()).glob("peaking-download-*")) == []


@pytest.mark.parametrize("to", ["ply", "", "COLMAP"])
def test_a_wrong_format_is_refused(client: TestClient, to: str) -> None:
    answer = client.get(f"{SESSION}/dataset.zip", params={"format": to})
    assert answer.status_code == 400
    assert "format" in answer.json()["detail"]


def test_what_a_format_needs_and_captures_lack_is_said(tmp_path: Path) -> None:
    with started(tmp_path) as client:
        assert client.get(f"{SESSION}/dataset.zip?format=tum").status_code == 409
        body = body_of(header(1, depth=None), photo(1))
        assert client.put(f"{SESSION}/captures/{capture_id(1)}", content=body).status_code == 201
        answer = client.get(f"{SESSION}/dataset.zip?format=llff")
        assert answer.status_code == 409
        assert "how far away things are" in answer.json()["detail"]
        assert str(tmp_path) not in answer.text


@pytest.mark.parametrize("views", ["0", "best", "-1", "2.5", ""])
def test_a_wrong_number_is_refused(client: TestClient, views: str) -> None:
    answer = client.get(f"{SESSION}/dataset.zip", params={"views": views})
    assert answer.status_code == 400
    assert "views" in answer.json()["detail"]


def test_without_depth_there_is_no_best(tmp_path: Path) -> None:
    with started(tmp_path) as client:
        client.put(f"{SESSION}/captures/{capture_id(1)}", content=upload_without_depth(1))
        wait_for(client, 1, lambda c: c["state"] == "failed")
        assert chosen(client) == {
            "policy": "peaking", "captures": [], "curve": [], "enough": 0
        }  # fmt: skip
        answer = client.get(f"{SESSION}/dataset.zip?views=auto")
        assert answer.status_code == 409
        assert "Download all" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ({"policy": "best"}, "best"),
        ({"policy": "uniform"}, "need a number of views for the policy uniform"),
        ({"policy": "uniform", "views": "6"}, "need at least 6 candidates for 6 views, got 5"),
        ({"views": "0"}, "views"),
        ({"threshold_share": "nan"}, "threshold_share"),
        ({"whatever": "1"}, "whatever"),
    ],
)
def test_wrong_questions_are_refused_with_a_sentence(
    client: TestClient, query: dict[str, str], says: str
) -> None:
    answer = client.get(f"{SESSION}/selection", params=query)
    assert answer.status_code == 400
    assert says in answer.json()["detail"]
