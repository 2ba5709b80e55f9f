# pyright: basic
# pyright: reportArgumentType=false, reportCallIssue=false
"""The living room: walls, window, lights, and what hangs on the walls.

World axes: +Z up; the floor is 5.0 m by 4.2 m around the origin. North (+Y): a black bookshelf, a
television. East (+X): the window. South: a dark sofa before a dark wall. West: a white sideboard
under a mirror. Nearer stand a table, an armchair, a stool and parcels; the middle is free to walk.
"""

from typing import Any

import numpy as np

from peaking.photographers.drawn import prints, room_surfaces, surfaces
from peaking.photographers.drawn.drawing import to_uint8
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import (
    glowing_picture,
    matte,
    panel,
    picture_frame,
    satin,
    shape,
)

HALF_X_M, HALF_Y_M, HIGH_M = 2.5, 2.1, 2.6
MIRROR, VASE, SPHERE = "wall_mirror", "glass_vase", "glass_sphere"
WINDOW_M, WINDOW_AT_M = (1.5, 1.25), (2.49, -0.1, 1.52)
SKY_RADIANCE = 18.0
"""The view through the window is about twice as bright as the picture can say."""
EAST, SOUTH, WEST = -90.0, 180.0, 90.0
"""Yaw of what hangs on a wall and looks into the room; on the north wall it is 0."""


def lights() -> dict[str, Any]:
    """The panel in the ceiling; the window and the lantern shine as well."""
    pose = Pose((0.0, 0.0, HIGH_M - 0.012), pitch_deg=90)
    return {
        "light_ceiling": {
            "type": "rectangle",
            "to_world": panel((2.0, 1.2), pose),
            "emitter": {
                "type": "area",
                "radiance": {"type": "rgb", "value": (9.6, 9.1, 8.2)},
                "sampling_weight": 1.0,
            },
        }
    }


def shell(rng: np.random.Generator) -> dict[str, Any]:
    """Floor, carpet, three pale walls and a dark one, ceiling, skirting."""
    floor, carpet, pale, dark, ceiling, skirting = (MeshParts() for _ in range(6))
    wide, deep = 2 * HALF_X_M, 2 * HALF_Y_M
    floor.box((wide, deep, 0.02), Pose((0, 0, -0.01)), tile_m=(1.9, 1.9))
    carpet.box((2.9, 2.4, 0.016), Pose((-0.05, 0.0, 0.008), yaw_deg=3))
    pale.box((wide, 0.02, HIGH_M), Pose((0, HALF_Y_M + 0.01, HIGH_M / 2)), tile_m=(1.7, 1.7))
    dark.box((wide, 0.02, HIGH_M), Pose((0, -HALF_Y_M - 0.01, HIGH_M / 2)), tile_m=(1.0, 1.0))
    for side in (-1, 1):
        at_m = (side * (HALF_X_M + 0.01), 0, HIGH_M / 2)
        pale.box((0.02, deep, HIGH_M), Pose(at_m), tile_m=(1.7, 1.7))
        at_m = (side * (HALF_X_M - 0.008), 0, 0.05)
        skirting.box((0.016, deep, 0.1), Pose(at_m), tile_m=(0.9, 0.3))
        at_m = (0, side * (HALF_Y_M - 0.008), 0.05)
        skirting.box((wide, 0.016, 0.1), Pose(at_m), tile_m=(0.9, 0.3))
    ceiling.box((wide, deep, 0.02), Pose((0, 0, HIGH_M + 0.01)), tile_m=(2.3, 2.3))
    white = surfaces.plastic_grain(rng, (0.86, 0.85, 0.82))
    return {
        "floor": shape("floor", floor, satin(room_surfaces.stone_tiles(rng), 0.2)),
        "carpet": shape("carpet", carpet, matte(room_surfaces.shag(rng, (0.15, 0.14, 0.16)))),
        "walls": shape("walls", pale, matte(room_surfaces.plaster(rng, (0.76, 0.77, 0.72)))),
        "dark_wall": shape("dark_wall", dark, matte(room_surfaces.damask(rng, (0.15, 0.18, 0.25)))),
        "ceiling": shape("ceiling", ceiling, matte(room_surfaces.plaster(rng, (0.85, 0.85, 0.84)))),
        "skirting": shape("skirting", skirting, satin(white, 0.3)),
    }


def window(rng: np.random.Generator) -> dict[str, Any]:
    """The window, too bright for the camera, its bars, sill and curtains."""
    bars, curtains, rod = MeshParts(), MeshParts(smooth=True), MeshParts(smooth=True)
    wide, high = WINDOW_M
    x, y, z = WINDOW_AT_M
    pose = Pose((x - 0.012, y, z), yaw_deg=EAST)
    picture_frame(bars, WINDOW_M, pose, bar_m=0.06, deep_m=0.05)
    bars.box((0.05, 0.04, high), pose, tile_m=(0.9, 0.1))
    bars.box((wide, 0.04, 0.04), Pose((x - 0.012, y, z + 0.2), yaw_deg=EAST), tile_m=(0.9, 0.1))
    bars.box((wide + 0.2, 0.2, 0.03), Pose((x - 0.1, y, z - 0.7), yaw_deg=EAST), tile_m=(0.9, 0.1))
    down = np.linspace(2.36, 0.2, 24)
    for side in (-1, 1):
        along = np.linspace(0.0, 1.0, 90)
        across = y + side * (0.68 + 0.36 * along)
        fold = 0.045 * np.sin(2 * np.pi * 6 * along + side)
        points = np.zeros((len(down), len(along), 3))
        points[..., 0] = x - 0.16 + fold[None] * (0.6 + 0.4 * (2.36 - down[:, None]) / 2)
        points[..., 1] = across[None] + 0.02 * np.sin(3 * down[:, None] + side)
        points[..., 2] = down[:, None]
        curtains.grid(points)
    rod.tube(np.array([(x - 0.16, y + t, 2.38) for t in np.linspace(-1.15, 1.15, 5)]), 0.014)
    view = to_uint8(0.5 + 0.5 * prints.landscape(rng, (750, 900)) / 255.0)
    white = surfaces.plastic_grain(rng, (0.88, 0.87, 0.85))
    cloth = room_surfaces.striped(rng, (7, 11, 13, 16, 17))
    return {
        "window_view": glowing_picture(
            view, WINDOW_M, Pose(WINDOW_AT_M, EAST), radiance=SKY_RADIANCE
        ),
        "window_bars": shape("window_bars", bars, satin(white, 0.3)),
        "curtains": shape("curtains", curtains, matte(cloth)),
        "rod": shape("rod", rod, satin(surfaces.plastic_grain(rng, (0.2, 0.17, 0.14)), 0.25)),
    }


def pictures(rng: np.random.Generator) -> dict[str, Any]:
    """What hangs on the walls, but for the mirror."""
    frames, clock = MeshParts(), MeshParts()
    out: dict[str, Any] = {}
    north, south = HALF_Y_M - 0.012, -HALF_Y_M + 0.012
    east, west = HALF_X_M - 0.012, -HALF_X_M + 0.012
    hung = (
        ("art", prints.art_poster(rng), (0.5, 0.7), (1.45, north, 1.62), 0.0),
        ("print", prints.landscape(rng, (500, 760)), (0.74, 0.5), (-0.55, north, 1.78), 0.0),
        ("sketch", prints.page(rng), (0.32, 0.44), (0.62, north, 1.9), 0.0),
        ("map", prints.map_poster(rng), (0.62, 0.86), (-1.35, south, 1.6), SOUTH),
        ("hills", prints.landscape(rng, (600, 900)), (0.9, 0.62), (-0.2, south, 1.62), SOUTH),
        ("cover", prints.book_cover(rng), (0.36, 0.48), (0.62, south, 1.75), SOUTH),
        ("cork", prints.cork_board(rng), (0.8, 0.62), (west, 1.32, 1.52), WEST),
        ("rings", prints.art_poster(rng), (0.42, 0.6), (west, -1.5, 1.5), WEST),
        ("east", prints.map_poster(rng), (0.4, 0.56), (east, 1.6, 1.6), EAST),
        ("notes", prints.page(rng), (0.3, 0.42), (east, -1.62, 1.55), EAST),
    )  # fmt: skip
    for name, image, size_m, at_m, yaw_deg in hung:
        sheet = MeshParts()
        sheet.box((size_m[0], 0.012, size_m[1]), Pose(at_m, yaw_deg))
        picture_frame(frames, size_m, Pose(at_m, yaw_deg), bar_m=0.024)
        out[f"hung_{name}"] = shape(f"hung_{name}", sheet, matte(image))
    clock.box((0.3, 0.03, 0.3), Pose((-HALF_X_M + 0.016, -0.92, 1.95), WEST))
    wood = surfaces.wood(
        rng, (128, 1024), light=(0.2, 0.16, 0.13), dark=(0.1, 0.08, 0.07), boards=1
    )
    return out | {
        "frames": shape("frames", frames, satin(wood, 0.25)),
        "clock": shape("clock", clock, satin(room_surfaces.clock_face(), 0.2)),
    }


def wall_mirror(rng: np.random.Generator) -> dict[str, Any]:
    """The mirror over the sideboard, in its frame."""
    size_m, pose = (0.72, 1.0), Pose((-HALF_X_M + 0.03, 0.1, 1.5), WEST)
    frame = MeshParts()
    picture_frame(frame, size_m, pose, bar_m=0.05, deep_m=0.04)
    gold = surfaces.plastic_grain(rng, (0.62, 0.47, 0.2))
    return {
        "mirror_frame": shape("mirror_frame", frame, satin(gold, 0.2)),
        MIRROR: {
            "type": "rectangle",
            "to_world": panel(size_m, pose),
            "bsdf": {"type": "conductor", "material": "Ag"},
        },
    }
