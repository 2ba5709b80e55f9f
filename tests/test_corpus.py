"""What earlier versions wrote opens, or is refused in one sentence (docs/compatibility.md)."""

from __future__ import annotations

import io
import json
import shutil
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from capture_uploads import capture_id
from corpus.write import (
    FINISHED,
    HALF_WAY,
    IN_STUDY,
    RECORDED_FRAMES,
    SMALL,
    facts_of,
    means_of,
    upload,
)
from patience import PATIENCE_S
from peaking.cli import main
from peaking.datasets import open_recording
from peaking.mpi_file import decode
from peaking.server.app import ServerOptions, create_app
from peaking.server.sessions import SessionStore
from peaking.server.study.app import StudyServerOptions, create_study_app
from peaking.server.study.open_study import OpenStudy
from peaking.splat.ply import read_ply
from peaking.study.records import read_participants

CORPUS = Path(__file__).parent / "corpus"
VERSIONS = sorted(path.parent for path in CORPUS.glob("*/about.json"))
SESSIONS = "/api/v1/sessions"
LEVELS = 1.0
"""So much may the mean of JPEG texels differ, of 255, on another decoder; measured: 0."""

Opened = Callable[[str], Path]


@pytest.fixture(params=VERSIONS, ids=lambda path: path.name)
def opened(request: pytest.FixtureRequest, tmp_path: Path) -> Opened:
    """Return a copy of something that a version wrote: opening it may change it."""

    def copy(name: str) -> Path:
        source, copied = request.param / name, tmp_path / name
        copied.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, copied, dirs_exist_ok=True)
        else:
            shutil.copy(source, copied)
        return copied

    return copy


def capture_app(store: SessionStore) -> Any:
    return create_app(
        store=store, config=ServerOptions(devices=None, client_dir=store.root / "no client")
    )


def client_of(root: Path) -> TestClient:
    store = SessionStore(root)
    assert store.problems == []
    return TestClient(capture_app(store), base_url="http://localhost")


def capture_of(client: TestClient, session: str, number: int) -> dict[str, Any]:
    """Return a capture when its MPI is made, or could not be."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        captures = client.get(f"{SESSIONS}/{session}").json()["captures"]
        (capture,) = [one for one in captures if one["id"] == capture_id(number)]
        if capture["state"] != "queued":
            return capture
        time.sleep(0.05)
    raise AssertionError(f"the MPI of capture {number} was not made")


def test_there_is_a_corpus() -> None:
    assert "0.1.0" in {path.name for path in VERSIONS}


@pytest.mark.parametrize("version", VERSIONS, ids=lambda path: path.name)
def test_it_stays_small(version: Path) -> None:
    files = [path for path in version.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 2e6
    assert len(files) < 150


def test_a_finished_session_is_served_in_full(opened: Opened, tmp_path: Path) -> None:
    root = opened("sessions")
    with client_of(root) as client:
        told = {summary["id"]: summary for summary in client.get(SESSIONS).json()}
        assert set(told) == {FINISHED, HALF_WAY}
        finished = told[FINISHED]
        assert (finished["name"], finished["finished"], finished["captures"]) == (
            "Kitchen",
            True,
            2,
        )
        assert finished["peaked_share"] == 0.05
        session = f"{SESSIONS}/{FINISHED}"
        removed = {c["number"]: c["removed"] for c in client.get(session).json()["captures"]}
        assert removed == {1: False, 2: True, 3: False}
        samples = client.get(f"{session}/peaked").json()["samples"]
        assert len(samples) == 8
        assert [sample["unseen_share"] for sample in samples[:2]] == [0.1, 0.05]
        for number in (1, 3):
            assert capture_of(client, FINISHED, number)["state"] == "ready"
            capture = f"{session}/captures/{capture_id(number)}"
            for picture in ("photo", "thumbnail"):
                assert client.get(f"{capture}/{picture}").content[:2] == b"\xff\xd8"
            assert len(decode(client.get(f"{capture}/mpi").content).plane_depths_m) == 8
        zipped = client.get(f"{session}/dataset.zip").content
    with zipfile.ZipFile(io.BytesIO(zipped)) as archive:
        archive.extractall(tmp_path / "dataset")
    for dataset in (tmp_path / "dataset", next(root.glob(f"*_{FINISHED[:8]}"))):
        frames = [open_recording(dataset).read(index) for index in range(2)]
        assert all(frame.depth_m is not None for frame in frames)
        assert frames[0].camera.position_m[0] < frames[1].camera.position_m[0]


def test_a_session_that_was_half_way_goes_on(opened: Opened) -> None:
    root = opened("sessions")
    session = f"{SESSIONS}/{HALF_WAY}"
    with client_of(root) as client:
        assert client.get(session).json()["summary"]["name"] == "Küche, 2. Versuch"
        assert capture_of(client, HALF_WAY, 4)["state"] == "ready"
        without_depth = capture_of(client, HALF_WAY, 5)
        assert (without_depth["number"], without_depth["state"]) == (5, "failed")
        assert "depth" in without_depth["problem"]
        new = f"{session}/captures/{capture_id(6)}"
        assert client.put(new, content=upload(6)).status_code == 201
        assert capture_of(client, HALF_WAY, 6)["number"] == 6
        assert client.delete(f"{session}/captures/{capture_id(3)}").json()["removed"]
        assert client.patch(session, json={"finished": True}).json()["finished"]
    with client_of(root) as client:
        kept = [c for c in client.get(session).json()["captures"] if not c["removed"]]
        assert [capture["number"] for capture in kept] == [1, 4, 5, 6]
    assert len(open_recording(next(root.glob(f"*_{HALF_WAY[:8]}")))) == 4


@pytest.mark.parametrize("codec", ["lossless", "jpeg"])
def test_mpi_files_say_what_they_said(opened: Opened, codec: str) -> None:
    expected = json.loads(opened(f"mpi/{codec}.json").read_text())
    found = facts_of(opened(f"mpi/{codec}.mpi"))
    for facts in (expected, found):
        if codec == "jpeg":
            facts.pop("texels_sha256")
    assert found.pop("mean_rgba") == pytest.approx(expected.pop("mean_rgba"), abs=LEVELS)
    assert found == expected


def test_gaussians_are_read(opened: Opened) -> None:
    facts = json.loads(opened("splat.json").read_text())
    gaussians = read_ply(opened("splat.ply"))
    assert len(gaussians) == facts["gaussians"]
    mean = np.mean(gaussians.means_m, axis=0, dtype=np.float64)
    np.testing.assert_allclose(mean, facts["mean"]["means_m"], atol=1e-5)
    colour = np.mean(gaussians.sh, axis=0, dtype=np.float64).ravel()
    np.testing.assert_allclose(colour, facts["mean"]["sh"], atol=1e-5)


def test_the_captured_views_of_a_replay_are_a_recording(opened: Opened) -> None:
    whole = open_recording(opened("recording"))
    replay = opened("replay")
    captured = open_recording(replay / "captured")
    assert len(whole) == RECORDED_FRAMES
    assert 1 < len(captured) < len(whole)
    first, last = captured.read(0), captured.read(len(captured) - 1)
    np.testing.assert_array_equal(first.rgb, whole.read(0).rgb)
    np.testing.assert_allclose(last.camera.position_m, whole.cameras[-1].position_m)
    assert last.depth_m is not None
    assert len((replay / "frames.csv").read_text().splitlines()) == RECORDED_FRAMES + 1
    assert json.loads((replay / "summary.json").read_text())["captured"] == len(captured)


def test_an_evaluation_goes_on_or_says_why_not(
    opened: Opened, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, out = opened("recording"), opened("evaluation")
    kept = {path.name: path.stat().st_mtime_ns for path in (out / "cache").iterdir()}
    lost = sorted((out / "cache").glob("ScoreStep-*.json"))[0]
    lost.unlink()
    command = ["evaluate", str(recording), "--out", str(out), "--workers", "1", "--views", "3"]
    main([*command, "--strategies", "peaking", "uniform", *SMALL])
    rows = json.loads((out / "results.json").read_text())["rows"]
    assert {row["strategy"] for row in rows} == {"peaking", "uniform"}
    now = {path.name: path.stat().st_mtime_ns for path in (out / "cache").glob("*.json")}
    again = {name for name, written in now.items() if kept.get(name) != written}
    assert again
    if again != {lost.name}:
        assert f"none of the {len(kept) - 1} steps" in caplog.text + capsys.readouterr().err
        assert len(again) == len(kept)


def test_a_simulated_study_is_analysed(opened: Opened) -> None:
    expected = json.loads(opened("study_simulated.json").read_text())
    found = means_of(opened("study_simulated"))
    assert {name: found[name] for name in expected} == {
        name: [None if mean is None else pytest.approx(mean) for mean in means]
        for name, means in expected.items()
    }


def test_a_study_goes_on_where_everybody_was(opened: Opened) -> None:
    folder = opened("study")
    records = {record.pseudonym: record for record in read_participants(folder)}
    assert records["P01"].trials[0].answers["sus"]["q1"] == 4
    store = SessionStore(folder / "sessions")
    config = StudyServerOptions(
        devices=None,
        client_dir=folder / "no client",
        phone_links=["http://localhost/participant?participant="],
    )
    app = create_study_app(
        study=OpenStudy(folder, store), capture=capture_app(store), config=config
    )
    with TestClient(app, base_url="http://localhost") as client:
        participants = "/api/v1/study/participants"
        assert client.get(f"{participants}/P01").json()["step"]["key"].startswith("t2.")
        step = client.get(f"{participants}/P02").json()["step"]
        assert (step["key"], step["draft"]) == ("t1.ask.sus", {"q1": 3})
        answers = {f"q{item}": 3 for item in range(1, 11)}
        form = f"{participants}/P02/steps/t1.ask.sus/answers"
        assert client.put(form, json={"answers": answers}).is_success
        session = f"{SESSIONS}/{IN_STUDY.replace('b3', '01')}"
        photo = client.get(f"{session}/captures/{capture_id(1)}/photo")
        assert photo.content[:2] == b"\xff\xd8"
        # P03 was erased, and the pseudonym is not given again.
        new = client.put("/api/v1/study/console/participants/p04-of-corpus").json()
        assert new == {"participant": "P04"}
    assert read_participants(folder)[1].trials[0].answers["sus"]["q10"] == 3
