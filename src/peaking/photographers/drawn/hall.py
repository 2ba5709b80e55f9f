# pyright: basic
"""A hall 6.4 m long and 1.7 m wide, with things that hide each other, and shelves along it.

World axes: +Z up; the hall runs along +X from 0, the middle of the floor is y = 0.
"""

from typing import Any

import numpy as np

from peaking.photographers.drawn import prints, room_surfaces, surfaces
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import (
    BOOKS_IN_ATLAS,
    ball,
    book_row,
    bush,
    glowing_picture,
    matte,
    panel,
    picture_frame,
    satin,
    shape,
)

LONG_M, WIDE_M, HIGH_M = 6.4, 1.7, 2.4


def lights() -> dict[str, Any]:
    """Three panels in the ceiling; the window at the far end shines as well."""
    out: dict[str, Any] = {}
    for k, x in enumerate((1.0, 3.2, 5.4)):
        out[f"light_{k}"] = {
            "type": "rectangle",
            "to_world": panel((0.5, 0.5), Pose((x, 0.0, HIGH_M - 0.02), pitch_deg=90)),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": (9.0, 8.6, 7.6)}},
        }
    return out


def shell(rng: np.random.Generator) -> dict[str, Any]:
    """Floor with a runner, two walls, the ends, the ceiling, the window, pictures."""
    floor, runner, walls, ends, ceiling, frames = (MeshParts() for _ in range(6))
    middle = LONG_M / 2
    floor.box((LONG_M, WIDE_M, 0.02), Pose((middle, 0, -0.01)), tile_m=(1.5, 1.5))
    runner.box((4.6, 0.8, 0.012), Pose((middle, 0.05, 0.006), yaw_deg=1))
    for side in (-1, 1):
        at_m = (middle, side * (WIDE_M / 2 + 0.01), HIGH_M / 2)
        walls.box((LONG_M, 0.02, HIGH_M), Pose(at_m), tile_m=(1.5, 1.5))
        ends.box((0.02, WIDE_M, HIGH_M), Pose((middle + side * (middle + 0.01), 0, HIGH_M / 2)))
    ceiling.box((LONG_M, WIDE_M, 0.02), Pose((middle, 0, HIGH_M + 0.01)), tile_m=(0.6, 0.6))
    out: dict[str, Any] = {}
    hung = (
        (prints.map_poster(rng), (0.5, 0.7), 1.0, 1), (prints.art_poster(rng), (0.42, 0.6), 2.6, 1),
        (prints.landscape(rng, (500, 760)), (0.7, 0.46), 4.7, 1),
        (prints.cork_board(rng), (0.7, 0.54), 1.9, -1), (prints.page(rng), (0.32, 0.44), 3.3, -1),
        (prints.art_poster(rng), (0.5, 0.7), 4.1, -1),
        (prints.map_poster(rng), (0.5, 0.7), 5.6, -1),
    )  # fmt: skip
    for k, (image, size_m, x, side) in enumerate(hung):
        sheet, yaw = MeshParts(), 0.0 if side == 1 else 180.0
        pose = Pose((x, side * (WIDE_M / 2 - 0.012), 1.6), yaw)
        sheet.box((size_m[0], 0.012, size_m[1]), pose)
        picture_frame(frames, size_m, pose, bar_m=0.022)
        out[f"hung_{k}"] = shape(f"hung_{k}", sheet, matte(image))
    window = Pose((LONG_M - 0.012, 0.15, 1.55), yaw_deg=-90)
    picture_frame(frames, (0.7, 1.0), window, bar_m=0.05)
    out["window_view"] = glowing_picture(
        prints.landscape(rng, (600, 420)), (0.7, 1.0), window, radiance=5.0
    )
    wood = surfaces.wood(
        rng, (128, 1024), light=(0.4, 0.27, 0.16), dark=(0.2, 0.12, 0.07), boards=1
    )
    return out | {
        "floor": shape("floor", floor, satin(surfaces.parquet(rng, 1024, 12), 0.3)),
        "runner": shape("runner", runner, matte(surfaces.rug(rng, (400, 1600)))),
        "walls": shape("walls", walls, matte(surfaces.wallpaper(rng, 1024))),
        "ends": shape("ends", ends, matte(room_surfaces.damask(rng, (0.26, 0.34, 0.3)))),
        "ceiling": shape("ceiling", ceiling, matte(surfaces.ceiling_tiles(rng, 512))),
        "frames": shape("frames", frames, satin(wood)),
    }


def occluders(rng: np.random.Generator) -> dict[str, Any]:
    """Posts, shelves that stand out from the walls, parcels, plants and a ladder."""
    posts, boards, books, parcels, pots = (MeshParts() for _ in range(5))
    leaves, stalks, rungs, globe = (MeshParts(smooth=True) for _ in range(4))
    for x, y in ((1.55, 0.72), (3.0, -0.72), (4.4, 0.72)):
        posts.box((0.2, 0.22, HIGH_M), Pose((x, y, HIGH_M / 2)), tile_m=(0.5, 0.5))
    for x, side in ((2.2, 1), (3.75, -1), (5.2, 1)):
        y = side * (WIDE_M / 2 - 0.15)
        for z in (0.35, 0.75, 1.15):
            boards.box((0.8, 0.26, 0.025), Pose((x, y, z)), tile_m=(0.9, 0.3))
            start = (x - 0.36, y - 0.11, z + 0.0125)
            book_row(rng, books, start, length_m=0.68, height_m=(0.18, 0.29), depth_m=0.2)
        for end in (-0.4, 0.4):
            boards.box((0.025, 0.26, 1.5), Pose((x + end, y, 0.75)), tile_m=(0.9, 0.3))
    for size, at_m, turn in (
        ((0.42, 0.34, 0.4), (0.75, -0.6, 0.2), 12), ((0.34, 0.3, 0.3), (0.78, -0.62, 0.55), -9),
        ((0.24, 0.2, 0.2), (0.74, -0.6, 0.8), 30), ((0.4, 0.3, 0.34), (4.75, -0.62, 0.17), -14),
        ((0.3, 0.26, 0.26), (4.72, -0.63, 0.47), 8), ((0.36, 0.3, 0.3), (6.0, 0.55, 0.15), 20),
    ):  # fmt: skip
        parcels.box(size, Pose(at_m, yaw_deg=turn))
    pot = [(0.0, 0.31), (0.12, 0.31), (0.15, 0.34), (0.165, 0.34), (0.16, 0.28), (0.12, 0.0)]
    for (x, y), count in (((2.45, -0.62), 22), ((5.85, -0.6), 22), ((3.6, 0.64), 18)):
        pots.turned(pot, Pose((x, y, 0.0)))
        bush(
            rng, leaves, stalks, root_m=(x, y, 0.32), count=count, stalk_m=(0.2, 0.8),
            length_m=(0.14, 0.24), spread_deg=(58, 88),
        )  # fmt: skip
    for side in (-0.16, 0.16):
        rungs.tube(np.array([(1.25 + side, -0.58 - 0.2 * t, 1.9 * t) for t in (0, 0.5, 1)]), 0.02)
    for k in range(1, 7):
        y, z = -0.58 - 0.2 * k / 7, 1.9 * k / 7
        rungs.tube(np.array([(1.09, y, z), (1.25, y, z), (1.41, y, z)]), 0.014)
    globe.turned(ball(0.12), Pose((4.75, -0.63, 0.73), pitch_deg=18))
    clay = [(0.62, 0.31, 0.2), (0.86, 0.78, 0.64), (0.24, 0.38, 0.42), (0.7, 0.34, 0.22)]
    wood = surfaces.wood(
        rng, (256, 1024), light=(0.68, 0.5, 0.31), dark=(0.46, 0.3, 0.17), boards=1
    )
    return {
        "posts": shape("posts", posts, matte(room_surfaces.stone_tiles(rng))),
        "boards": shape("boards", boards, satin(wood, 0.3)),
        "books": shape("books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)),
        "parcels": shape("parcels", parcels, matte(surfaces.cardboard(rng))),
        "pots": shape("pots", pots, satin(surfaces.glazed(rng, (300, 900), clay, rings=7), 0.3)),
        "leaves": shape("leaves", leaves, satin(surfaces.leaf(rng), 0.4)),
        "stalks": shape("stalks", stalks, matte(surfaces.plastic_grain(rng, (0.3, 0.4, 0.18)))),
        "ladder": shape("ladder", rungs, matte(wood)),
        "globe": shape("globe", globe, satin(surfaces.globe_map(rng), 0.25)),
    }


PARTS = (shell, occluders)
