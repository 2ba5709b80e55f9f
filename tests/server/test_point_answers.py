"""Points of a capture: where its depth says, in its colours, and none at edges."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

from capture_uploads import SESSION_ID, capture_id, new_session, upload, upload_without_depth
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.server.app import ServerOptions, create_app
from peaking.server.point_answers import MAX_POINTS, encode_points
from peaking.server.sessions import SessionStore

SESSION = f"/api/v1/sessions/{SESSION_ID}"


def read(data: bytes | None) -> tuple[np.ndarray, np.ndarray]:
    assert data is not None
    count, rest = divmod(len(data), 15)
    assert rest == 0
    xyz = np.frombuffer(data, "<f4", 3 * count).reshape(count, 3)
    return xyz, np.frombuffer(data, np.uint8, offset=12 * count).reshape(count, 3)


def frame_of(depth_m: np.ndarray, rgb: np.ndarray) -> Frame:
    height, width = rgb.shape[:2]
    pinhole = Pinhole(width, height, 2.0, 2.0, width / 2, height / 2)
    camera = Camera(pinhole, Rigid(np.eye(3), np.array([10.0, 0, 0])))
    return Frame("one", rgb, camera, depth_m.astype(np.float32))


def test_worked_by_hand() -> None:
    """A wall at 4 m, four pixels; the left half is red."""
    rgb = np.zeros((2, 2, 3), np.uint8)
    rgb[:, 0] = [200, 0, 0]
    xyz, colours = read(encode_points(frame_of(np.full((2, 2), 4.0), rgb)))
    # The centre of the first pixel is half a pixel left of and above the middle: -0.5 / 2 · 4 m.
    expected = [[9, -1, 4], [11, -1, 4], [9, 1, 4], [11, 1, 4]]
    np.testing.assert_allclose(xyz, expected, atol=1e-6)
    np.testing.assert_array_equal(colours[:, 0], [200, 0, 200, 0])


def test_edges_and_what_is_unknown_are_left_out() -> None:
    depth_m = np.full((8, 12), 2.0)
    depth_m[:, 6:] = 1.0
    depth_m[0, 0] = 0.0
    xyz, _ = read(encode_points(frame_of(depth_m, np.zeros((8, 12, 3), np.uint8))))
    columns = np.round((xyz[:, 0] - 10) / xyz[:, 2] * 2 + 6 - 0.5)
    assert set(columns) == {0, 1, 2, 3, 4, 7, 8, 9, 10, 11}
    assert (xyz[:, 2] > 0).all()


def test_there_are_never_more_than_allowed() -> None:
    depth_m = np.full((480, 640), 3.0)
    xyz, _ = read(encode_points(frame_of(depth_m, np.zeros((480, 640, 3), np.uint8))))
    assert 0.5 * MAX_POINTS < len(xyz) <= MAX_POINTS


@pytest.fixture
def client(tmp_path: Path) -> Generator[TestClient]:
    config = ServerOptions(devices=None, client_dir=tmp_path)
    app = create_app(store=SessionStore(tmp_path / "sessions"), config=config)
    with TestClient(app, base_url="http://localhost") as client:
        client.put(SESSION, json=new_session())
        yield client


def test_of_captures_with_depth_and_with_points(client: TestClient) -> None:
    client.put(f"{SESSION}/captures/{capture_id(0)}", content=upload(0))
    client.put(f"{SESSION}/captures/{capture_id(1)}", content=upload_without_depth(1))
    for number in (0, 1):
        answer = client.get(f"{SESSION}/captures/{capture_id(number)}/points")
        assert answer.status_code == 200
        xyz, _ = read(answer.content)
        assert len(xyz) > 10
        assert set(np.round(xyz[:, 2], 2)) <= {1.0, 2.0}
    assert client.get(f"{SESSION}/captures/{capture_id(7)}/points").status_code == 404
    client.delete(f"{SESSION}/captures/{capture_id(0)}")
    assert client.get(f"{SESSION}/captures/{capture_id(0)}/points").status_code == 404
