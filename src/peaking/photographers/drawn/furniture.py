# pyright: basic
"""What stands in the living room."""

import itertools
from typing import Any

import numpy as np

from peaking.photographers.drawn import prints, room_surfaces, surfaces
from peaking.photographers.drawn.living_room import HALF_X_M, HALF_Y_M, SPHERE, VASE
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import (
    BOOKS_IN_ATLAS,
    ball,
    book,
    bush,
    matte,
    satin,
    shape,
    shelves,
)

TABLE_AT_M, TABLE_TOP_M = (-1.2, 1.0), 0.73
BALL = ("beach_ball",)
BALL_RADIUS_M = 0.16


def black_bookshelf(rng: np.random.Generator) -> dict[str, Any]:
    """Six boards of books on the north wall, in black wood."""
    boards, books = MeshParts(), MeshParts()
    back = HALF_Y_M - 0.02
    shelves(rng, boards, books, x_m=(-2.35, -1.15), y_m=(back - 0.3, back), count=7)
    wood = surfaces.wood(
        rng, (256, 1024), light=(0.2, 0.175, 0.16), dark=(0.1, 0.09, 0.08), boards=1
    )
    return {
        "shelf_boards": shape("shelf_boards", boards, satin(wood, 0.3)),
        "shelf_books": shape(
            "shelf_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.35)
        ),
    }


def television(rng: np.random.Generator) -> dict[str, Any]:
    """A dark screen on a low bench, with loudspeakers, a box and records beside it."""
    bench, screen, speakers, cones = (MeshParts(smooth=k == 3) for k in range(4))
    front = HALF_Y_M - 0.42
    bench.box((1.9, 0.38, 0.05), Pose((0.3, HALF_Y_M - 0.22, 0.44)), tile_m=(0.9, 0.4))
    for k in range(4):
        bench.box(
            (0.04, 0.36, 0.42), Pose((-0.62 + 0.61 * k, HALF_Y_M - 0.22, 0.21)), tile_m=(0.9, 0.4)
        )
    bench.box((1.9, 0.36, 0.03), Pose((0.3, HALF_Y_M - 0.22, 0.06)), tile_m=(0.9, 0.4))
    screen.box((1.1, 0.045, 0.64), Pose((0.3, HALF_Y_M - 0.2, 0.86)), tile_m=(0.5, 0.5))
    screen.box((0.4, 0.2, 0.02), Pose((0.3, HALF_Y_M - 0.2, 0.48)), tile_m=(0.5, 0.5))
    for x in (-0.48, 1.08):
        speakers.box((0.2, 0.24, 0.36), Pose((x, front + 0.16, 0.65)), tile_m=(0.4, 0.4))
        for z, radius in ((0.57, 0.07), (0.73, 0.04)):
            cone = [(0.0, 0.004), (0.5 * radius, 0.012), (radius, 0.022), (radius, 0.0)]
            cones.turned(cone, Pose((x, front + 0.04, z), pitch_deg=90))
    records = MeshParts()
    for k in range(26):
        book(
            records,
            (0.02, 0.29, 0.3 + 0.01 * (k % 3)),
            Pose((-0.5 + 0.0215 * k, HALF_Y_M - 0.23, 0.24)),
            index=7 * k,
        )
    black = surfaces.wood(
        rng, (256, 1024), light=(0.3, 0.2, 0.13), dark=(0.15, 0.09, 0.06), boards=2
    )
    return {
        "bench": shape("bench", bench, satin(black, 0.3)),
        "screen": shape(
            "screen", screen, satin(surfaces.plastic_grain(rng, (0.085, 0.085, 0.09)), 0.12)
        ),
        "speakers": shape(
            "speakers",
            speakers,
            satin(
                surfaces.wood(
                    rng, (256, 512), light=(0.5, 0.3, 0.17), dark=(0.3, 0.16, 0.09), boards=1
                )
            ),
        ),
        "cones": shape("cones", cones, satin(surfaces.plastic_grain(rng, (0.09, 0.09, 0.1)), 0.3)),
        "records": shape("records", records, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)),
    }


def sofa(rng: np.random.Generator) -> dict[str, Any]:
    """A sofa of black leather at the dark wall, with cushions and a blanket."""
    body, blanket = MeshParts(), MeshParts(smooth=True)
    x, y = -0.45, -HALF_Y_M + 0.46
    tile_m = (0.6, 0.6)
    body.box((2.0, 0.86, 0.2), Pose((x, y, 0.18)), tile_m=tile_m)
    for k in range(2):
        body.box(
            (0.83, 0.66, 0.16),
            Pose((x - 0.42 + 0.84 * k, y + 0.08, 0.36), yaw_deg=k),
            tile_m=tile_m,
        )
        body.box(
            (0.82, 0.18, 0.46),
            Pose((x - 0.42 + 0.84 * k, y - 0.27, 0.64), pitch_deg=9),
            tile_m=tile_m,
        )
    for side in (-1, 1):
        body.box((0.18, 0.86, 0.5), Pose((x + 0.92 * side, y, 0.36)), tile_m=tile_m)
    u, v = np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40))
    drop = np.clip(v - 0.45, 0, 1)
    points = np.stack(
        [
            x + 0.2 + 0.5 * u + 0.02 * np.sin(9 * v),
            y - 0.1 + 0.9 * np.minimum(v, 0.58) + 0.012 * np.sin(14 * u),
            0.455 + 0.008 * np.sin(11 * u + 4 * v) - 0.5 * np.clip(drop - 0.13, 0, 1),
        ],
        -1,
    )
    blanket.grid(points)
    out: dict[str, Any] = {}
    for k, (at_x, yaw, roll) in enumerate(((-0.72, 12, 7), (-0.4, -8, -12), (0.66, -16, 9))):
        pillow = MeshParts()
        pillow.box((0.4, 0.13, 0.4), Pose((x + at_x, y - 0.1, 0.62), yaw, 18, roll))
        out[f"cushion_{k}"] = shape(f"cushion_{k}", pillow, matte(room_surfaces.cushion(rng)))
    return out | {
        "sofa": shape("sofa", body, satin(room_surfaces.leather(rng, (0.17, 0.15, 0.15)), 0.35)),
        "blanket": shape("blanket", blanket, matte(room_surfaces.striped(rng, (3, 6, 8, 14)))),
    }


def sideboard(rng: np.random.Generator) -> dict[str, Any]:
    """The white sideboard under the mirror, with pots, lying books, a globe and a glass sphere."""
    body, pulls, books, pots, globe = (MeshParts(smooth=k > 2) for k in range(5))
    x, y, top = -HALF_X_M + 0.24, 0.1, 0.76
    body.box((0.44, 1.7, 0.66), Pose((x, y, 0.42)), tile_m=(0.8, 0.5))
    body.box((0.48, 1.76, 0.03), Pose((x, y, top - 0.015)), tile_m=(0.8, 0.5))
    for k in range(3):
        at_m = (x + 0.225, y - 0.56 + 0.56 * k, 0.42)
        body.box(
            (0.015, 0.53, 0.6), Pose(at_m), tile_m=(0.8, 0.5), rects={"all": (0.3 * k, 0, 1, 1)}
        )
        pulls.box((0.02, 0.1, 0.016), Pose((x + 0.24, at_m[1], 0.62)), tile_m=(0.2, 0.2))
    for k in range(4):
        book(
            books,
            (0.035, 0.17, 0.24),
            Pose((x, y - 0.62, top + 0.018 + 0.035 * k), yaw_deg=85 + 9 * (k % 2), roll_deg=90),
            index=5 + 9 * k,
        )
    tall = [(0.0, 0.3), (0.035, 0.3), (0.03, 0.26), (0.07, 0.15), (0.06, 0.02), (0.045, 0.0)]
    pots.turned(tall, Pose((x, y + 0.64, top)))
    bowl = [(0.0, 0.03), (0.09, 0.07), (0.11, 0.075), (0.09, 0.03), (0.05, 0.0)]
    pots.turned(bowl, Pose((x + 0.03, y - 0.22, top)))
    globe.turned(ball(0.11), Pose((x - 0.03, y + 0.36, top + 0.17), pitch_deg=18))
    pots.turned([(0.015, 0.06), (0.06, 0.015), (0.065, 0.0)], Pose((x - 0.03, y + 0.36, top)))
    pots.turned([(0.03, 0.012), (0.045, 0.0)], Pose((x + 0.08, y + 0.08, top)))
    glaze = [(0.16, 0.3, 0.34), (0.8, 0.74, 0.6), (0.12, 0.2, 0.26), (0.66, 0.36, 0.2)]
    white = surfaces.wood(
        rng, (512, 1024), light=(0.9, 0.89, 0.86), dark=(0.8, 0.78, 0.74), boards=3
    )
    return {
        "sideboard": shape("sideboard", body, satin(white, 0.25)),
        "sideboard_pulls": shape(
            "sideboard_pulls", pulls, satin(surfaces.plastic_grain(rng, (0.12, 0.12, 0.13)), 0.3)
        ),
        "lying_books": shape(
            "lying_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)
        ),
        "pots": shape("pots", pots, satin(surfaces.glazed(rng, (240, 800), glaze, rings=9), 0.25)),
        "globe": shape("globe", globe, satin(surfaces.globe_map(rng), 0.25)),
        SPHERE: {
            "type": "sphere",
            "center": [x + 0.08, y + 0.08, top + 0.085],
            "radius": 0.075,
            "bsdf": {"type": "dielectric", "int_ior": 1.5},
        },
    }


def round_table(rng: np.random.Generator) -> dict[str, Any]:
    """The table with the glass vase, a mug, a plate, an open pad and a plant in a pot."""
    table, china, leaves, stalks, vase = (MeshParts(smooth=True) for _ in range(5))
    (x, y), top = TABLE_AT_M, TABLE_TOP_M
    disc = [(0.0, 0.0), (0.4, 0.0), (0.41, -0.015), (0.4, -0.03), (0.05, -0.04)]
    table.turned(disc, Pose((x, y, top)))
    foot = [(0.045, -0.04), (0.035, -0.35), (0.045, -0.6), (0.24, -0.7), (0.25, -0.73)]
    table.turned(foot, Pose((x, y, top)))
    china.turned(
        [(0.0, 0.01), (0.037, 0.012), (0.038, 0.09), (0.042, 0.09), (0.042, 0.004), (0.036, 0.0)],
        Pose((x + 0.22, y - 0.16, top)),
    )
    bend = np.linspace(-1.35, 1.35, 14)
    handle = np.stack([0.04 + 0.026 * np.cos(bend), 0 * bend, 0.048 + 0.03 * np.sin(bend)], -1)
    china.tube(Pose((x + 0.22, y - 0.16, top), yaw_deg=20).apply(handle), 0.006)
    china.turned(
        [(0.0, 0.006), (0.08, 0.008), (0.12, 0.02), (0.08, 0.0)], Pose((x + 0.02, y - 0.25, top))
    )
    china.turned(
        [(0.0, 0.1), (0.055, 0.1), (0.06, 0.12), (0.068, 0.12), (0.06, 0.08), (0.045, 0.0)],
        Pose((x - 0.2, y + 0.08, top)),
    )
    bush(
        rng,
        leaves,
        stalks,
        root_m=(x - 0.2, y + 0.08, top + 0.1),
        count=22,
        stalk_m=(0.04, 0.2),
        length_m=(0.09, 0.16),
        spread_deg=(25, 85),
    )
    outline = [
        (0.0, 0.34), (0.052, 0.34), (0.056, 0.33), (0.04, 0.27), (0.05, 0.2), (0.085, 0.13),
        (0.095, 0.08), (0.075, 0.025), (0.05, 0.0), (0.0, 0.0),
    ]  # fmt: skip
    vase.turned(outline, Pose((x + 0.08, y + 0.04, top + 0.001)))
    pad = MeshParts()
    pad.box((0.2, 0.28, 0.008), Pose((x - 0.1, y - 0.2, top + 0.005), yaw_deg=-38))
    wood = surfaces.wood(
        rng, (700, 700), light=(0.62, 0.42, 0.26), dark=(0.4, 0.24, 0.13), boards=5
    )
    glaze = [(0.84, 0.82, 0.76), (0.84, 0.82, 0.76), (0.66, 0.3, 0.24), (0.2, 0.32, 0.44)]
    return {
        "round_table": shape("round_table", table, satin(wood, 0.25)),
        "china": shape(
            "china", china, satin(surfaces.glazed(rng, (240, 640), glaze, rings=6), 0.2)
        ),
        "table_leaves": shape("table_leaves", leaves, satin(surfaces.leaf(rng), 0.35)),
        "table_stalks": shape(
            "table_stalks", stalks, matte(surfaces.plastic_grain(rng, (0.36, 0.46, 0.2)))
        ),
        "pad": shape("pad", pad, matte(prints.page(rng))),
        VASE: shape(VASE, vase, {"type": "dielectric", "int_ior": 1.5}),
    }


def armchair(rng: np.random.Generator) -> dict[str, Any]:
    """A green armchair that looks to the middle, a stool with books, parcels, a plant."""
    chair, legs, stool, books, parcels = (MeshParts() for _ in range(5))
    yaw = -52.0  # its front, -y, turns to the middle of the room
    at = Pose((1.42, 1.12, 0.0), yaw_deg=yaw)

    def put(
        parts: MeshParts,
        size_m: tuple[float, float, float],
        spot_m: tuple[float, ...],
        pitch: float = 0.0,
    ) -> None:
        place = at.apply(np.array(spot_m))
        parts.box(size_m, Pose(tuple(place), yaw, pitch), tile_m=(0.45, 0.45))

    put(chair, (0.6, 0.6, 0.2), (0, 0, 0.32))
    put(chair, (0.6, 0.16, 0.6), (0, 0.28, 0.66), -12)
    for side in (-1, 1):
        put(chair, (0.12, 0.66, 0.36), (0.36 * side, 0.0, 0.42))
        for front in (-0.26, 0.26):
            put(legs, (0.04, 0.04, 0.22), (0.34 * side, front, 0.11))
    pillow = MeshParts()
    spot = at.apply(np.array((0.02, 0.14, 0.6)))
    pillow.box((0.36, 0.12, 0.36), Pose(tuple(spot), yaw, -20, 14))
    stool.turned([(0.0, 0.0), (0.2, 0.0), (0.2, -0.03), (0.0, -0.03)], Pose((1.3, -0.95, 0.46)))
    for a in np.radians((45, 165, 285)):
        legs.tube(
            np.array(
                [
                    (1.3 + r * np.cos(a), -0.95 + r * np.sin(a), z)
                    for r, z in ((0.12, 0.44), (0.17, 0.22), (0.2, 0.0))
                ]
            ),
            0.016,
        )
    z = 0.46
    for k, (thick, turn) in enumerate(((0.04, 8.0), (0.05, -12.0), (0.03, 20.0), (0.045, 2.0))):
        book(
            books,
            (thick, 0.18, 0.25),
            Pose((1.3, -0.95, z + thick / 2), 140 + turn, 0, -90),
            index=2 + 6 * k,
        )
        z += thick
    for size, at_m, turn in (
        ((0.46, 0.36, 0.38), (-1.72, -1.02, 0.19), 25.0),
        ((0.36, 0.3, 0.28), (-1.7, -1.0, 0.52), 4.0),
        ((0.26, 0.2, 0.18), (-1.74, -1.03, 0.75), 40.0),
        ((0.4, 0.3, 0.26), (-1.6, -1.42, 0.13), -12.0),
    ):
        parcels.box(size, Pose(at_m, yaw_deg=turn))
    green = room_surfaces.leather(rng, (0.16, 0.25, 0.2))
    dark = surfaces.wood(rng, (128, 512), light=(0.3, 0.2, 0.13), dark=(0.16, 0.1, 0.06), boards=1)
    return {
        "armchair": shape("armchair", chair, matte(green)),
        "pillow": shape("pillow", pillow, matte(room_surfaces.cushion(rng))),
        "legs": shape("legs", legs, satin(dark, 0.3)),
        "stool": shape("stool", stool, satin(dark, 0.3)),
        "stool_books": shape(
            "stool_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)
        ),
        "parcels": shape("parcels", parcels, matte(surfaces.cardboard(rng))),
    }


def lantern_and_plants(rng: np.random.Generator) -> dict[str, Any]:
    """A floor lamp with a paper lantern, the radiator under the window, two tall plants."""
    pole, pots, leaves, stalks, ribs = (MeshParts(smooth=k < 4) for k in range(5))
    lamp = (1.15, -1.68)
    pole.turned([(0.0, 0.02), (0.13, 0.015), (0.14, 0.0)], Pose((*lamp, 0.0)))
    pole.tube(np.array([(*lamp, z) for z in np.linspace(0.0, 1.4, 6)]), 0.012)
    pot = [(0.0, 0.31), (0.13, 0.31), (0.15, 0.34), (0.165, 0.34), (0.16, 0.28), (0.12, 0.0)]
    for (x, y), count in (((2.12, 1.72), 26), ((2.1, -1.72), 22)):
        pots.turned(pot, Pose((x, y, 0.0)))
        bush(
            rng,
            leaves,
            stalks,
            root_m=(x, y, 0.32),
            count=count,
            stalk_m=(0.25, 0.85),
            length_m=(0.18, 0.3),
            spread_deg=(55, 86),
        )
    for k in range(16):
        ribs.box(
            (0.08, 0.05, 0.5),
            Pose((HALF_X_M - 0.1, -0.1 - 0.6 + 0.08 * k, 0.42)),
            tile_m=(0.3, 0.3),
        )
    for z, side in itertools.product((0.2, 0.64), (-1,)):
        ribs.box((0.05, 1.32, 0.03), Pose((HALF_X_M + 0.1 * side, -0.1, z)), tile_m=(0.3, 0.3))
    clay = [(0.2, 0.2, 0.22), (0.62, 0.58, 0.5), (0.14, 0.15, 0.18), (0.72, 0.66, 0.54)]
    return {
        "pole": shape("pole", pole, satin(surfaces.plastic_grain(rng, (0.1, 0.1, 0.11)), 0.25)),
        "floor_pots": shape(
            "floor_pots", pots, satin(surfaces.glazed(rng, (300, 900), clay, rings=7), 0.3)
        ),
        "floor_leaves": shape("floor_leaves", leaves, satin(surfaces.leaf(rng), 0.4)),
        "floor_stalks": shape(
            "floor_stalks", stalks, matte(surfaces.plastic_grain(rng, (0.3, 0.4, 0.18)))
        ),
        "radiator": shape(
            "radiator", ribs, satin(surfaces.plastic_grain(rng, (0.87, 0.86, 0.83)), 0.3)
        ),
        "lantern": {
            "type": "sphere",
            "center": [*lamp, 1.55],
            "radius": 0.17,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": (0.8, 0.78, 0.7)}},
            "emitter": {
                "type": "area",
                "radiance": {"type": "rgb", "value": (10.5, 9.6, 8.2)},
                "sampling_weight": 0.5,
            },
        },
    }


def beach_ball(_: np.random.Generator) -> dict[str, Any]:
    """The ball at the origin, which lies somewhere else in every picture."""
    parts = MeshParts(smooth=True)
    parts.turned(ball(BALL_RADIUS_M), Pose(pitch_deg=25))
    return {BALL[0]: shape(BALL[0], parts, satin(room_surfaces.beach_ball(), 0.25))}
