"""A small scene that stands in for the drawn ones, which take seconds to light."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from peaking.photographers import pictures, recording, session, steps
from peaking.photographers.drawn.drawing import PALETTE, fractal, to_uint8
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import matte, shape
from peaking.photographers.drawn_mesh import build_mesh
from peaking.photographers.scene import Scene


def made_of(
    boxes: list[tuple[tuple[float, float, float], Pose]], rng: np.random.Generator
) -> Scene:
    parts = {}
    for k, (size_m, pose) in enumerate(boxes):
        mesh = MeshParts()
        mesh.box(size_m, pose, tile_m=(0.7, 0.7))
        spots = fractal(rng, (128, 128), 24.0)[..., None]
        picture = to_uint8(np.clip(PALETTE[3 * k % 18] * (1 + 0.4 * spots), 0, 1))
        parts[f"box_{k}"] = shape(f"box_{k}", mesh, matte(picture))
    mesh, _ = build_mesh([parts])
    return Scene(mesh, np.full_like(mesh.points_m, 0.5))


@pytest.fixture(scope="session")
def small_scene() -> Scene:
    """A room with a few boxes in it, away from where the desk's photographers walk."""
    room = [
        ((5.0, 0.1, 3.0), Pose((0.0, 2.5, 1.5))),
        ((5.0, 0.1, 3.0), Pose((0.0, -2.5, 1.5))),
        ((0.1, 5.0, 3.0), Pose((2.5, 0.0, 1.5))),
        ((0.1, 5.0, 3.0), Pose((-2.5, 0.0, 1.5))),
        ((5.0, 5.0, 0.1), Pose((0.0, 0.0, -0.05))),
        ((5.0, 5.0, 0.1), Pose((0.0, 0.0, 3.05))),
        ((0.4, 0.3, 0.9), Pose((-0.3, 1.3, 0.6), yaw_deg=20)),
        ((0.3, 0.3, 0.6), Pose((0.4, 1.6, 0.9), yaw_deg=-30)),
    ]
    return made_of(room, np.random.default_rng(3))


@pytest.fixture
def drawn(small_scene: Scene, monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    """Every scene is the small one."""

    def small(_: str) -> Scene:
        return small_scene

    for module in (pictures, recording, session, steps):
        monkeypatch.setattr(module, "open_scene", small)
    steps.test_pictures.cache_clear()
    yield small_scene
    steps.test_pictures.cache_clear()
