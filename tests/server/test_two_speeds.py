"""`layered` MPIs at once, learned ones later; photos without depth among others."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from jaxtyping import Float32, UInt8
from starlette.testclient import TestClient

from adampi_checkpoints import write_checkpoint
from capture_uploads import (
    SESSION_ID,
    body_of,
    capture_id,
    header,
    new_session,
    photo,
    upload,
    upload_without_depth,
)
from patience import PATIENCE_S
from peaking.errors import CheckpointError, PeakingError
from peaking.mpi import Mpi
from peaking.mpi_file import decode
from peaking.options import DEFAULT, Options
from peaking.server import generation
from peaking.server.app import ServerOptions, create_app
from peaking.server.session_log import MpiMade, SessionLog
from peaking.server.sessions import SessionStore
from peaking.view_builder import ViewBuilder

SESSION = f"/api/v1/sessions/{SESSION_ID}"


def client_of(root: Path, options: Options) -> TestClient:
    store = SessionStore(root / "sessions")
    app = create_app(
        store=store, config=ServerOptions(devices=None, client_dir=root, options=options)
    )
    return TestClient(app, base_url="http://localhost")


def capture_path(number: int) -> str:
    return f"{SESSION}/captures/{capture_id(number)}"


def wait_for(
    client: TestClient, number: int, wanted: Callable[[dict[str, Any]], bool]
) -> dict[str, Any]:
    until = time.monotonic() + PATIENCE_S
    capture: dict[str, Any] = {}
    while time.monotonic() < until:
        captures = client.get(SESSION).json()["captures"]
        (capture,) = [c for c in captures if c["id"] == capture_id(number)]
        if wanted(capture):
            return capture
        time.sleep(0.05)
    raise AssertionError(f"it did not come to that: {capture}")


@pytest.fixture
def learned(tmp_path: Path) -> Options:
    path = write_checkpoint(tmp_path / "adampi_4p.pth")
    return replace(
        DEFAULT, generator="adampi", checkpoint=path, num_planes=4, pixels=130 * 278, device="cpu"
    )


def test_the_learned_mpi_takes_the_place_of_the_first_at_another_address(
    tmp_path: Path, learned: Options
) -> None:
    with client_of(tmp_path, learned) as client:
        assert client.get("/api/v1/server").json()["options"]["generator"] == "adampi"
        client.put(SESSION, json=new_session())
        client.put(capture_path(1), content=upload(1))
        first = wait_for(client, 1, lambda c: c["state"] == "ready")
        assert first["generator"] in ("layered", "adampi")
        better = wait_for(client, 1, lambda c: c["mpi_version"] == 2)
        assert (better["state"], better["generator"]) == ("ready", "adampi")
        for address, maker in (("mpi", "layered"), ("mpi/1", "layered"), ("mpi/2", "adampi")):
            answer = client.get(f"{capture_path(1)}/{address}")
            assert decode(answer.content).generator == maker
            assert "immutable" in answer.headers["cache-control"]
        assert client.get(f"{capture_path(1)}/mpi/3").status_code == 404
        assert client.get(f"{capture_path(1)}/mpi/0").status_code == 404
    (log,) = (tmp_path / "sessions").glob("*/log.jsonl")
    made = [event for event in SessionLog(log).read()[0] if isinstance(event, MpiMade)]
    assert [(event.version, event.generator) for event in made] == [(1, "layered"), (2, "adampi")]
    # After a restart it is what it was, and is not made again.
    (session,) = SessionStore(tmp_path / "sessions").sessions()
    again = session.capture(capture_id(1))
    assert (again.state, again.mpi_version, again.generator) == ("ready", 2, "adampi")
    assert again.mpi_bytes == better["mpi_bytes"]
    assert session.unfinished("adampi") == []


def test_learned_mpis_that_were_not_made_yet_are_made_at_the_next_start(
    tmp_path: Path, learned: Options
) -> None:
    with client_of(tmp_path, DEFAULT) as client:
        client.put(SESSION, json=new_session())
        client.put(capture_path(1), content=upload(1))
        assert wait_for(client, 1, lambda c: c["state"] == "ready")["generator"] == "layered"
    with client_of(tmp_path, learned) as client:
        assert wait_for(client, 1, lambda c: c["mpi_version"] == 2)["generator"] == "adampi"


def test_where_the_learned_one_fails_the_first_stays_and_it_is_said(
    tmp_path: Path, learned: Options, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = ViewBuilder.build

    def fails(builder: ViewBuilder, *given: Any) -> Any:
        if builder.options.generator == "adampi":
            raise PeakingError("the graphics card has no room")
        return build(builder, *given)

    monkeypatch.setattr(ViewBuilder, "build", fails)
    with client_of(tmp_path, learned) as client:
        client.put(SESSION, json=new_session())
        client.put(capture_path(1), content=upload(1))
        told = wait_for(client, 1, lambda c: c["problem"] is not None)
        assert (told["state"], told["mpi_version"]) == ("ready", 1)
        assert told["problem"] == "the graphics card has no room"


def test_a_server_without_its_weights_does_not_start(tmp_path: Path) -> None:
    options = replace(DEFAULT, generator="adampi", checkpoint=tmp_path / "none.pth")
    with pytest.raises(CheckpointError, match=r"none\.pth"):
        client_of(tmp_path, options)


class WallWithBox:
    """Knows what `capture_uploads` shows, up to scale and shift."""

    name = "wall with box"
    metric = False

    def __call__(self, rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
        relative = np.zeros((32, 15), np.float32)
        relative[10:20, 4:10] = 7.0
        height, width = rgb.shape[:2]
        return cv2.resize(relative, (width, height), interpolation=cv2.INTER_NEAREST)


@pytest.fixture
def estimating(monkeypatch: pytest.MonkeyPatch) -> Options:
    def wall_with_box(model: str, *, device: str, runtime: str) -> WallWithBox:
        assert (model, device, runtime) == ("wall-with-box", "auto", "pytorch")
        return WallWithBox()

    monkeypatch.setattr(generation, "create_estimator", wall_with_box)
    return replace(DEFAULT, depth_model="wall-with-box")


def test_a_photo_without_depth_is_guessed_until_a_neighbour_tells_its_scale(
    tmp_path: Path, estimating: Options
) -> None:
    with client_of(tmp_path, estimating) as client:
        client.put(SESSION, json=new_session())
        without = body_of(header(1, depth=None), photo(1))
        assert client.put(capture_path(1), content=without).status_code == 201
        lone = wait_for(client, 1, lambda c: c["state"] != "queued")
        assert (lone["state"], lone["guessed"], lone["mpi_version"]) == ("ready", True, 1)
        client.put(capture_path(2), content=upload(2))
        told = wait_for(client, 1, lambda c: not c["guessed"])
        assert told["mpi_version"] == 2
        mpi: Mpi = decode(client.get(f"{capture_path(1)}/mpi/2").content)
        assert mpi.plane_depths_m[0] == pytest.approx(2.0, rel=0.1)
        assert mpi.plane_depths_m[-1] == pytest.approx(1.0, rel=0.1)


def test_tracked_points_tell_the_scale_of_a_photo_without_depth(
    tmp_path: Path, estimating: Options
) -> None:
    with client_of(tmp_path, estimating) as client:
        client.put(SESSION, json=new_session())
        assert client.put(capture_path(1), content=upload_without_depth(1)).status_code == 201
        made = wait_for(client, 1, lambda c: c["state"] != "queued")
        assert (made["state"], made["guessed"], made["mpi_version"]) == ("ready", False, 1)
        mpi: Mpi = decode(client.get(f"{capture_path(1)}/mpi/1").content)
        assert mpi.plane_depths_m[0] == pytest.approx(2.0, rel=0.1)
        assert mpi.plane_depths_m[-1] == pytest.approx(1.0, rel=0.1)
        broken = body_of(header(2, depth=None, points=1), photo(2) + b"\xff" * 12)
        refused = client.put(capture_path(2), content=broken)
        assert refused.status_code == 422
        assert "Point 0 is (nan" in refused.json()["detail"]
