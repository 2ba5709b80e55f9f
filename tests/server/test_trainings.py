"""Training 3D Gaussians on a session: from the button to the file, stopped, gone on with, ended."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session
from desk_uploads import DESK, HEIGHT_PX, WIDTH_PX, upload_of_desk
from patience import PATIENCE_S
from peaking.datasets import open_recording
from peaking.export.splats import read_splats
from peaking.metrics.psnr_ssim import psnr
from peaking.options import DEFAULT
from peaking.server.app import ServerOptions, create_app
from peaking.server.open_session import OpenSession
from peaking.server.sessions import SessionStore
from peaking.server.training import Trainings
from peaking.server.training_process import suggestion_of
from peaking.server.upload import BadUpload
from peaking.splat.rasterise import render

SESSION = f"/api/v1/sessions/{SESSION_ID}"
OTHER = f"/api/v1/sessions/{UUID(int=77)}"
SMALL = replace(DEFAULT, pixels=4096, num_planes=8)
VIEWS = 9
ENOUGH, LONG = 60, 100_000
"""Steps that are soon done, and steps that nobody waits for."""


@contextmanager
def server_of(folder: Path, steps: int = ENOUGH) -> Generator[TestClient]:
    config = ServerOptions(devices=None, client_dir=folder, options=SMALL, training_steps=steps)
    app = create_app(store=SessionStore(folder / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        yield client


def fill(client: TestClient, session: str = SESSION, count: int = VIEWS) -> None:
    client.put(session, json=new_session(name=session[-4:]))
    for number in range(count):
        client.put(f"{session}/captures/{capture_id(number)}", content=upload_of_desk(4 * number))


def order(client: TestClient, state: str, session: str = SESSION) -> dict[str, Any]:
    answer = client.put(f"{session}/training", json={"state": state})
    assert answer.status_code == 200, answer.text
    return answer.json()


def until(
    client: TestClient, wanted: Callable[[dict[str, Any]], bool], session: str = SESSION
) -> dict[str, Any]:
    """Wait for a training to come to something."""
    end_s = time.monotonic() + PATIENCE_S
    answer: dict[str, Any] = {}
    while time.monotonic() < end_s:
        answer = client.get(f"{session}/training").json()
        if wanted(answer):
            return answer
        time.sleep(0.05)
    raise AssertionError(f"it did not come to that: {answer}")


def state_is(*states: str) -> Callable[[dict[str, Any]], bool]:
    return lambda training: training["state"] in states


def processes() -> list[int]:
    """Return the ids of the processes that train for this one."""
    found: list[int] = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            command = (folder / "cmdline").read_bytes()
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if b"training_process" in command and parent == os.getpid() and state != "Z":
            found.append(int(folder.name))
    return found


def test_a_session_becomes_gaussians(tmp_path: Path) -> None:
    with server_of(tmp_path) as client:
        fill(client)
        before = client.get(f"{SESSION}/training").json()
        assert before["state"] == "none"
        assert before["splat_version"] == 0
        assert order(client, "running")["state"] in ("waiting", "running")
        done = until(client, state_is("done", "failed"))
        assert done["state"] == "done", done
        assert (done["step"], done["steps"]) == (ENOUGH, ENOUGH)
        assert (done["views"], done["held_out"]) == (7, 2)
        assert not done["outdated"]
        splat = client.get(f"{SESSION}/training/splat/{done['splat_version']}")
        assert len(splat.content) == done["splat_bytes"]
        assert "immutable" in splat.headers["cache-control"]
        path = tmp_path / f"splat.{done['splat_format']}"
        path.write_bytes(splat.content)
        gaussians = read_splats(path)
        assert len(gaussians) == done["gaussians"]
        # In the session's own axes, and of what was held out too.
        frame = open_recording(DESK).read(0).resized(WIDTH_PX, HEIGHT_PX)
        rgb = np.clip(render(gaussians, frame.camera).rgb, 0, 1).astype(np.float64)
        assert psnr(rgb, frame.rgb / 255.0) > 15
        assert done["psnr_db"] > 15
        numbers = [view["number"] for view in done["worst"]]
        assert len(numbers) == 3
        captures = client.get(SESSION).json()["captures"]
        assert {view["capture"] for view in done["worst"]} <= {c["id"] for c in captures}
        # No part of the data set.
        assert b"splat" not in client.get(f"{SESSION}/dataset.zip").content[-4000:]


def test_it_stops_and_goes_on_where_it_was(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client)
        order(client, "running")
        until(client, lambda t: t["step"] > 5 and t["splat_version"] > 0)
        order(client, "stopped")
        stopped = until(client, state_is("stopped"))
        until(client, lambda _: processes() == [])
        order(client, "running")
        going = until(client, lambda t: t["state"] == "running" and t["step"] > stopped["step"])
        assert going["step"] < stopped["step"] + 10_000
        assert going["splat_version"] >= stopped["splat_version"]
    assert processes() == []  # it ended with the server …
    with server_of(tmp_path, LONG) as client:
        again = client.get(f"{SESSION}/training").json()  # … and can go on with the next
        assert again["state"] == "stopped"
        assert again["step"] >= stopped["step"]


def test_views_that_came_since_are_said_and_begin_it_anew(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=4)
        order(client, "running")
        until(client, lambda t: t["step"] > 0)
        order(client, "stopped")
        stopped = until(client, state_is("stopped"))
        assert not stopped["outdated"]
        client.put(f"{SESSION}/captures/{capture_id(8)}", content=upload_of_desk(32))
        assert client.get(f"{SESSION}/training").json()["outdated"]
        (snapshot,) = (tmp_path / "sessions").rglob("snapshot.npz")
        assert order(client, "running")["step"] == 0
        until(client, lambda _: not snapshot.exists())  # no later training takes it for its own
        assert until(client, lambda t: t["step"] > 0)["views"] == 5


def test_a_process_that_is_killed_is_said(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=4)
        order(client, "running")
        until(client, lambda t: t["step"] > 0)
        (process,) = processes()
        assert os.getpgid(process) != os.getpgid(0)  # Ctrl-C does not reach it …
        os.kill(process, signal.SIGINT)  # … nor does it end by it
        step = client.get(f"{SESSION}/training").json()["step"]
        until(client, lambda t: t["step"] > step + 20)
        os.kill(process, signal.SIGKILL)
        failed = until(client, state_is("failed"))
        assert "begun again" in failed["problem"]
        order(client, "running")
        until(client, lambda t: t["state"] == "running" and t["step"] > 0)


def test_one_that_failed_goes_on_from_its_snapshot(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=4)
        order(client, "running")
        until(client, lambda t: t["step"] > 5)
        order(client, "stopped")
        stopped = until(client, state_is("stopped"))
        until(client, lambda _: processes() == [])
        order(client, "running")
        until(client, lambda t: t["step"] > stopped["step"])
        (process,) = processes()
        os.kill(process, signal.SIGKILL)
        failed = until(client, state_is("failed"))
        assert order(client, "running")["step"] == failed["step"]
        until(client, lambda _: len(processes()) == 1)
        going = until(client, lambda t: t["state"] == "running" and t["step"] != failed["step"])
        assert going["step"] >= stopped["step"]


def test_one_at_a_time_and_one_that_waits_can_be_stopped(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=3)
        fill(client, OTHER, count=3)
        order(client, "running")
        until(client, lambda t: t["step"] > 0)
        assert order(client, "running", OTHER)["state"] == "waiting"
        assert len(processes()) == 1
        assert order(client, "stopped", OTHER)["state"] == "stopped"
        order(client, "running", OTHER)
        order(client, "stopped")
        until(client, lambda t: t["state"] == "running", OTHER)


def test_what_is_erased_is_in_no_gaussians(tmp_path: Path) -> None:
    with server_of(tmp_path) as client:
        fill(client, count=4)
        order(client, "running")
        done = until(client, state_is("done"))
        splat = f"{SESSION}/training/splat/{done['splat_version']}"
        assert client.get(splat).status_code == 200
        capture = f"{SESSION}/captures/{capture_id(2)}"
        client.patch(capture, json={"ending": "erased"})
        assert client.get(splat).status_code == 404
        assert client.get(f"{SESSION}/training").json()["state"] == "none"
        assert not list((tmp_path / "sessions").rglob("splat-*"))


def test_a_session_that_is_deleted_is_not_trained_on(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=3)
        order(client, "running")
        until(client, lambda t: t["step"] > 0)
        client.patch(SESSION, json={"deleted": True})
        assert processes() == []
        assert client.get(f"{SESSION}/training").status_code == 410
        client.patch(SESSION, json={"deleted": False})
        assert client.get(f"{SESSION}/training").json()["state"] == "stopped"


def test_nothing_is_trained_while_a_session_is_deleted_or_erased(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trainings: list[Trainings] = []
    end, delete, erase = Trainings.end, SessionStore.delete, SessionStore.erase

    def ended(self: Trainings, session_id: str) -> None:
        trainings.append(self)
        end(self, session_id)

    def deleted(self: SessionStore, session_id: str) -> OpenSession:
        with pytest.raises(BadUpload, match="being deleted"):
            trainings[0].run(self.get(session_id))
        return delete(self, session_id)

    def erased(self: SessionStore, session_id: str) -> None:
        session = self.get(session_id)
        erase(self, session_id)
        with pytest.raises(BadUpload, match="being deleted"):
            trainings[0].run(session)

    monkeypatch.setattr(Trainings, "end", ended)
    monkeypatch.setattr(SessionStore, "delete", deleted)
    monkeypatch.setattr(SessionStore, "erase", erased)
    with server_of(tmp_path, LONG) as client:
        fill(client, count=3)
        assert client.patch(SESSION, json={"deleted": True}).status_code == 200
        client.patch(SESSION, json={"deleted": False})
        order(client, "running")
        until(client, lambda t: t["step"] > 0)
        assert client.delete(SESSION).status_code == 204
        assert processes() == []
        assert not list((tmp_path / "sessions").rglob("training"))


def test_a_process_does_not_make_an_erased_folder_again(tmp_path: Path) -> None:
    with server_of(tmp_path, LONG) as client:
        fill(client, count=3)
        order(client, "running")
        until(client, lambda t: t["splat_version"] > 0)
        (folder,) = (tmp_path / "sessions").rglob("training")
        shutil.rmtree(folder)
        order(client, "stopped")
        until(client, state_is("failed"))
        assert not folder.exists()


def test_what_is_erased_is_not_told_of_by_who_asks_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions: list[OpenSession] = []
    forget, end = Trainings.forget, Trainings.end

    def forgotten(self: Trainings, session: OpenSession) -> None:
        sessions.append(session)
        forget(self, session)

    def ended(self: Trainings, session_id: str) -> None:
        end(self, session_id)
        self.of(sessions[0])  # as a GET would

    with server_of(tmp_path) as client:
        fill(client, count=4)
        order(client, "running")
        until(client, state_is("done"))
        monkeypatch.setattr(Trainings, "forget", forgotten)
        monkeypatch.setattr(Trainings, "end", ended)
        client.patch(f"{SESSION}/captures/{capture_id(2)}", json={"ending": "erased"})
        assert client.get(f"{SESSION}/training").json()["state"] == "none"
        assert order(client, "running")["state"] in ("waiting", "running")
        gone = tmp_path / "sessions" / "splat-1.spz"

        def went(_self: Trainings, _session: OpenSession, _version: int) -> Path:
            return gone

        monkeypatch.setattr(Trainings, "splat", went)
        assert client.get(f"{SESSION}/training/splat/1").status_code == 404


def test_what_cannot_be_trained_on_is_said(tmp_path: Path) -> None:
    with server_of(tmp_path) as client:
        fill(client, count=2)
        refused = client.put(f"{SESSION}/training", json={"state": "running"})
        assert refused.status_code == 409
        assert "at least 3" in refused.json()["detail"]
        assert client.get(f"{SESSION}/training/splat/1").status_code == 404
        assert client.get(f"{SESSION}/training/splat/none").status_code == 404
        assert client.put(f"{SESSION}/training", json={"state": "done"}).status_code == 422


@pytest.mark.parametrize(
    ("psnr_db", "said"), [(26.5, "As good"), (24.5, "One more"), (20.0, "Two more")]
)
def test_views_far_below_the_others_want_more(psnr_db: float, said: str) -> None:
    assert suggestion_of(psnr_db, 27.0).startswith(said)
