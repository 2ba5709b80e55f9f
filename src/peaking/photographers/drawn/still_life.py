# pyright: basic
"""A still life on a stand in the middle of a room, to be walked around.

World axes: +Z up; the stand is at the origin, its top at 0.8 m; the walls are 2.4 m away.
"""

from typing import Any

import numpy as np

from peaking.photographers.drawn import prints, room_surfaces, surfaces
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import (
    BOOKS_IN_ATLAS,
    ball,
    book,
    bush,
    matte,
    panel,
    picture_frame,
    satin,
    shape,
)

HALF_M, HIGH_M, TOP_M = 2.4, 2.6, 0.8


def lights() -> dict[str, Any]:
    """A large panel in the ceiling, off the middle, and a low one at a wall, for shadows."""

    def lamp(size_m: tuple[float, float], pose: Pose, rgb: tuple[float, float, float]) -> Any:
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": rgb}}
        return {"type": "rectangle", "to_world": panel(size_m, pose), "emitter": emitter}

    return {
        "light_ceiling": lamp(
            (1.2, 1.2), Pose((0.6, -0.5, HIGH_M - 0.02), pitch_deg=90), (8, 7, 6)
        ),
        "light_wall": lamp((1.0, 1.0), Pose((-HALF_M + 0.03, 0.6, 1.7), yaw_deg=90), (6, 7, 8)),
    }


def shell(rng: np.random.Generator) -> dict[str, Any]:
    """Floor, rug, two kinds of walls with pictures, ceiling."""
    floor, rug, pale, dark, ceiling, frames = (MeshParts() for _ in range(6))
    wide = 2 * HALF_M
    floor.box((wide, wide, 0.02), Pose((0, 0, -0.01)), tile_m=(1.5, 1.5))
    rug.box((1.9, 1.9, 0.012), Pose((0, 0, 0.006), yaw_deg=14))
    ceiling.box((wide, wide, 0.02), Pose((0, 0, HIGH_M + 0.01)), tile_m=(0.6, 0.6))
    out: dict[str, Any] = {}
    for k, yaw in enumerate((0.0, 90.0, 180.0, -90.0)):
        turned = Pose(yaw_deg=yaw)
        wall = tuple(turned.apply(np.array((0.0, HALF_M + 0.01, HIGH_M / 2))))
        walls = pale if k % 2 else dark
        walls.box((wide, 0.02, HIGH_M), Pose(wall, yaw), tile_m=(1.4, 1.4))
        for j, image in enumerate((prints.map_poster(rng), prints.art_poster(rng))):
            at_m = tuple(turned.apply(np.array((-1.0 + 1.7 * j, HALF_M - 0.012, 1.5))))
            size_m, sheet = ((0.6, 0.84), (0.5, 0.7))[j], MeshParts()
            sheet.box((size_m[0], 0.012, size_m[1]), Pose(at_m, yaw))
            picture_frame(frames, size_m, Pose(at_m, yaw), bar_m=0.024)
            out[f"hung_{k}_{j}"] = shape(f"hung_{k}_{j}", sheet, matte(image))
    wood = surfaces.wood(rng, (128, 1024), light=(0.3, 0.2, 0.13), dark=(0.14, 0.1, 0.07), boards=1)
    return out | {
        "floor": shape("floor", floor, satin(surfaces.parquet(rng, 1024, 12), 0.3)),
        "rug": shape("rug", rug, matte(surfaces.rug(rng, (900, 900)))),
        "pale": shape("pale", pale, matte(surfaces.wallpaper(rng, 1024))),
        "dark": shape("dark", dark, matte(room_surfaces.damask(rng, (0.2, 0.3, 0.32)))),
        "ceiling": shape("ceiling", ceiling, matte(room_surfaces.plaster(rng, (0.8, 0.8, 0.78)))),
        "frames": shape("frames", frames, satin(wood)),
    }


def things(rng: np.random.Generator) -> dict[str, Any]:
    """The stand, and on it a plant, books, a globe, a jug, a box and a cup with pens."""
    stand, books, parcel = (MeshParts() for _ in range(3))
    pot, leaves, stalks, globe, foot, jug, pens = (MeshParts(smooth=True) for _ in range(7))
    stand.box((0.62, 0.62, 0.03), Pose((0, 0, TOP_M - 0.015)), tile_m=(0.6, 0.6))
    stand.box((0.3, 0.3, TOP_M - 0.03), Pose((0, 0, TOP_M / 2 - 0.015)), tile_m=(0.6, 0.6))
    z = TOP_M
    for k, (thick, yaw) in enumerate(((0.05, 10.0), (0.035, -14.0), (0.045, 28.0))):
        place = Pose((-0.15, 0.12, z + thick / 2), yaw, 0.0, -90.0)
        book(books, (thick, 0.17, 0.235), place, index=4 + 7 * k)
        z += thick
    pot.turned(
        [(0.0, 0.1), (0.05, 0.1), (0.056, 0.12), (0.066, 0.12), (0.06, 0.09), (0.046, 0.0)],
        Pose((-0.15, 0.12, z)),
    )
    bush(
        rng, leaves, stalks, root_m=(-0.15, 0.12, z + 0.1), count=20, stalk_m=(0.03, 0.17),
        length_m=(0.08, 0.14), spread_deg=(25, 85),
    )  # fmt: skip
    globe.turned(ball(0.105), Pose((0.16, 0.14, TOP_M + 0.15), pitch_deg=20))
    foot.turned([(0.02, 0.06), (0.06, 0.02), (0.07, 0.0)], Pose((0.16, 0.14, TOP_M)))
    outline = [
        (0.0, 0.02), (0.045, 0.03), (0.04, 0.27), (0.052, 0.28), (0.05, 0.2), (0.085, 0.13),
        (0.095, 0.08), (0.075, 0.02), (0.06, 0.0),
    ]  # fmt: skip
    jug.turned(outline, Pose((0.17, -0.13, TOP_M)))
    bend = np.linspace(-1.2, 1.2, 14)
    handle = np.stack([0.06 + 0.06 * np.cos(bend), 0 * bend, 0.15 + 0.08 * np.sin(bend)], -1)
    jug.tube(Pose((0.17, -0.13, TOP_M), yaw_deg=-60).apply(handle), 0.009)
    parcel.box((0.2, 0.15, 0.13), Pose((-0.14, -0.16, TOP_M + 0.065), yaw_deg=24))
    for k in range(7):
        a = 2.4 * k
        base = np.array((0.0 + 0.012 * np.cos(a), -0.22 + 0.012 * np.sin(a), TOP_M))
        tip = base + np.array((0.04 * np.cos(a), 0.04 * np.sin(a), 0.15 + 0.01 * k))
        pens.tube(base + (tip - base) * np.linspace(0, 1, 5)[:, None], 0.005)
    glaze = [(0.82, 0.78, 0.68), (0.2, 0.36, 0.46), (0.82, 0.78, 0.68), (0.7, 0.34, 0.22)]
    clay = [(0.68, 0.36, 0.24), (0.62, 0.31, 0.2), (0.86, 0.78, 0.64), (0.24, 0.38, 0.42)]
    wood = surfaces.wood(rng, (430, 860), light=(0.74, 0.56, 0.38), dark=(0.5, 0.33, 0.2), boards=2)
    return {
        "stand": shape("stand", stand, satin(wood, 0.3)),
        "books": shape("books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)),
        "pot": shape("pot", pot, satin(surfaces.glazed(rng, (240, 800), clay, rings=9), 0.3)),
        "leaves": shape("leaves", leaves, satin(surfaces.leaf(rng), 0.35)),
        "stalks": shape("stalks", stalks, matte(surfaces.plastic_grain(rng, (0.36, 0.46, 0.2)))),
        "globe": shape("globe", globe, satin(surfaces.globe_map(rng), 0.25)),
        "foot": shape("foot", foot, satin(wood, 0.25)),
        "jug": shape("jug", jug, satin(surfaces.glazed(rng, (240, 640), glaze, rings=8), 0.2)),
        "parcel": shape("parcel", parcel, matte(surfaces.cardboard(rng))),
        "pens": shape("pens", pens, matte(surfaces.plastic_grain(rng, (0.7, 0.2, 0.15)))),
    }


PARTS = (shell, things)
