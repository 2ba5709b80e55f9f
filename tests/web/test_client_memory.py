"""What the client remembers, on the card, against Python's memory: in a real browser."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from playwright.sync_api import Page

from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.memory import Memory
from peaking.mpi import Mpi
from peaking.options import DEFAULT
from peaking.server.recordings import wire_of_camera
from peaking.view_builder import ViewBuilder
from recordings import Room
from web.test_render_core import base64_of, pixels_of, scene_of

PINHOLE = Pinhole(96, 144, 90.0, 90.0, 48.0, 72.0)
OPTIONS = replace(DEFAULT, pixels=96 * 144, num_planes=16, align_poses=False)
ROOM, EMPTY = Room(), Room(box_m=None)


def camera(x_m: float, y_m: float = 0.0, z_m: float = 0.0) -> Camera:
    return Camera(PINHOLE, Rigid(np.eye(3), np.array([x_m, y_m, z_m])))


def view(room: Room, x_m: float) -> Mpi:
    rgb, depth_m = room.photographed(camera(x_m))
    return ViewBuilder(OPTIONS).generate(Frame("view", rgb, camera(x_m), depth_m))


def looked(room: Room, at: Camera, *, depth: bool = True) -> dict[str, Any]:
    rgb, depth_m = room.photographed(at)
    rgba = np.concatenate([rgb, np.full((*rgb.shape[:2], 1), 255, np.uint8)], axis=-1)
    mm = np.round(1000 * depth_m[::2, ::2]).astype(np.uint16)
    return {
        "camera": msgspec.to_builtins(wire_of_camera(at)),
        "live": base64_of(np.ascontiguousarray(rgba[::-1]).tobytes()),
        "depth": {"width": 48, "height": 72, "mm": base64_of(mm.tobytes())} if depth else None,
    }


def told(page: Page, mpis: list[Mpi], looks: list[dict[str, Any]], copies: int = 0) -> list[Any]:
    scene = scene_of(mpis, mpis[0].camera, ROOM.photographed(mpis[0].camera)[0], OPTIONS)
    answers = page.evaluate(
        "([scene, looks, copies]) => core.lookAround(scene, looks, copies)", [scene, looks, copies]
    )
    for answer in answers:
        assert answer["gl_error"] == 0
        if answer["said"] is not None:
            answer["said"] = pixels_of(answer["said"], 48, 72) > 127
    return answers


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))


BESIDE = [camera(0.5), camera(-0.4, 0.1), camera(0.0, 0.0, -0.6)]


@pytest.mark.parametrize("copies", [0, 9])
def test_what_no_view_saw_is_told_as_python_does(page: Page, copies: int) -> None:
    """Also once there are more views than first had room, and those here have left the card."""
    mpis = [view(ROOM, 0.0), view(ROOM, 0.3)]
    answers = told(page, mpis, [looked(ROOM, at) for at in BESIDE], copies)
    for at, answer in zip(BESIDE, answers, strict=True):
        ours = answer["said"][..., 0]
        python = Memory(mpis).look(at, ROOM.photographed(at)[1]).unseen
        assert 0.03 < python.mean() < 0.9
        assert overlap(ours, python) > 0.85
        assert answer["said"][..., 1].mean() < 0.01


def test_what_has_moved_is_told_as_python_does(page: Page) -> None:
    mpis = [view(EMPTY, x_m) for x_m in (0.0, 0.3, -0.3)]
    at = camera(0.1)
    with_depth, without = told(page, mpis, [looked(ROOM, at), looked(ROOM, at, depth=False)])
    live_m = ROOM.photographed(at)[1]
    result = pixels_of(with_depth["result"], 96, 144)
    box = live_m < 1.5
    moved = np.kron(with_depth["said"][..., 1], np.ones((2, 2), bool))
    wrong = (result[..., 0] > 127) | (result[..., 3] > 64)
    python = Memory(mpis).moved(at, wrong, live_m)
    assert overlap(moved & wrong, python) > 0.8
    assert moved[box & wrong].mean() > 0.7
    # What is said is drawn: it asks for no view any more.
    assert (result[..., 0] > 127)[box & wrong].mean() < 0.3
    assert without["said"] is None


def test_what_is_wrong_outside_the_picture_is_remembered(page: Page) -> None:
    mpis = [view(EMPTY, 0.0)]
    turned = Rigid(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), np.zeros(3))
    away = Camera(PINHOLE, turned)  # looks along +x
    wall = looked(EMPTY, away)
    wall["depth"] = looked(EMPTY, camera(0.0))["depth"]
    wall["live"] = base64_of(np.full((144, 96, 4), 128, np.uint8).tobytes())
    here, aside = told(page, mpis, [looked(ROOM, camera(0.0)), wall])
    assert here["elsewhere"] is None  # it is in the picture
    right, _, ahead = aside["elsewhere"]
    assert right < -0.5 * abs(ahead)  # the box is to the left of who looks along +x
    assert len(base64.b64decode(aside["result"])) == 4 * 96 * 144
