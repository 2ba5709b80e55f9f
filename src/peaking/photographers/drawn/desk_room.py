# pyright: basic
"""The desk scene's model: what stands where, of which material.

World axes: +Z up, +X right and +Y away from the camera's home at about (0, 0, 1.2) m. From near
to far: a plant on books at the left (0.5 m), a desk with a keyboard, papers, mug, monitor, glass
sphere and standing mirror (0.6 to 1.4 m), boxes, a cabinet and a plant (1.6 to 2.3 m), a
bookshelf, posters and a window (2.3 to 2.8 m). Behind the camera lies the rest of the room, which
the mirror shows.
"""

from typing import Any

import cv2
import numpy as np

from peaking.photographers.drawn import prints, surfaces
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
    shelves,
)

DESK_TOP_M = 0.74
MIRROR, GLASS = "mirror_pane", "glass_sphere"
"""The names of the one mirror-like and the one glass-like shape."""


def lights() -> dict[str, Any]:
    """A wide window at the left, a softer one behind the camera at the right, a ceiling panel."""

    def lamp(
        size_m: tuple[float, float], pose: Pose, rgb: tuple[float, float, float], weight: float
    ) -> dict[str, Any]:
        emitter = {
            "type": "area",
            "radiance": {"type": "rgb", "value": rgb},
            "sampling_weight": weight,
        }
        return {"type": "rectangle", "to_world": panel(size_m, pose), "emitter": emitter}

    return {
        "light_window": lamp(
            (2.2, 1.5), Pose((-1.78, 0.75, 1.75), yaw_deg=90), (6.6, 7.1, 7.8), 1.0
        ),
        "light_right": lamp((1.6, 1.4), Pose((1.83, -0.4, 1.6), yaw_deg=-90), (6.4, 5.8, 4.9), 0.8),
        "light_ceiling": lamp(
            (1.5, 0.9), Pose((0.1, 0.9, 2.72), pitch_deg=90), (5.2, 4.7, 3.9), 0.9
        ),
    }


def room(rng: np.random.Generator) -> dict[str, Any]:
    """Floor, rug, walls, ceiling, posters, the window and the wall behind the camera."""
    floor, rug, walls, ceiling, frames, skirting = (MeshParts() for _ in range(6))
    floor.box((3.8, 4.6, 0.02), Pose((0, 0.6, -0.01)), tile_m=(1.5, 1.5))
    rug.box((1.9, 2.2, 0.012), Pose((0.1, 1.0, 0.006)))
    walls.box((3.8, 0.02, 2.8), Pose((0, 2.78, 1.4)), tile_m=(1.5, 1.5))
    walls.box((3.8, 0.02, 2.8), Pose((0, -1.6, 1.4)), tile_m=(1.5, 1.5))
    for side in (-1, 1):
        walls.box((0.02, 4.6, 2.8), Pose((side * 1.86, 0.6, 1.4)), tile_m=(1.5, 1.5))
    ceiling.box((3.8, 4.6, 0.02), Pose((0, 0.6, 2.76)), tile_m=(0.6, 0.6))
    skirting.box((3.8, 0.02, 0.12), Pose((0, 2.76, 0.06)), tile_m=(0.9, 0.3))
    wood_frame = surfaces.wood(
        rng, (128, 1024), light=(0.45, 0.3, 0.18), dark=(0.22, 0.13, 0.07), boards=1
    )
    out: dict[str, Any] = {}
    pictures = [
        ("map", prints.map_poster(rng), (0.56, 0.78), (-0.12, 2.755, 1.90)),
        ("art", prints.art_poster(rng), (0.46, 0.64), (0.53, 2.755, 1.97)),
        ("cork", prints.cork_board(rng), (0.52, 0.42), (0.50, 2.755, 1.365)),
        ("cork_low", prints.cork_board(rng), (0.5, 0.4), (-0.12, 2.755, 1.20)),
    ]
    for name, image, (wide, high), at in pictures:
        parts = MeshParts()
        parts.box((wide, 0.012, high), Pose(at))
        picture_frame(frames, (wide, high), Pose((at[0], at[1] - 0.008, at[2])), bar_m=0.022)
        out[f"poster_{name}"] = shape(f"poster_{name}", parts, matte(image))
    behind = MeshParts()
    behind.box((0.9, 0.012, 1.25), Pose((-0.75, -1.58, 1.5), yaw_deg=180))
    behind.box((0.8, 0.012, 1.1), Pose((0.35, -1.58, 1.6), yaw_deg=180))
    out["poster_behind"] = shape("poster_behind", behind, matte(prints.map_poster(rng)))
    window = Pose((1.24, 2.755, 1.75))
    picture_frame(frames, (0.78, 1.15), window, bar_m=0.05)
    frames.box((0.025, 0.03, 1.15), window, tile_m=(0.9, 0.1))
    frames.box((0.78, 0.03, 0.025), Pose((1.24, 2.755, 1.95)), tile_m=(0.9, 0.1))
    frames.box((0.94, 0.12, 0.03), Pose((1.24, 2.71, 1.14)), tile_m=(0.9, 0.1))
    out["window_view"] = glowing_picture(
        cv2.GaussianBlur(prints.landscape(rng), (0, 0), 4),
        (0.78, 1.15),
        Pose((1.24, 2.762, 1.75)),
        radiance=0.95,
    )
    return out | {
        "floor": shape("floor", floor, satin(surfaces.parquet(rng), 0.3)),
        "rug": shape("rug", rug, matte(surfaces.rug(rng))),
        "walls": shape("walls", walls, matte(surfaces.wallpaper(rng))),
        "ceiling": shape("ceiling", ceiling, matte(surfaces.ceiling_tiles(rng))),
        "frames": shape("frames", frames, satin(wood_frame)),
        "skirting": shape("skirting", skirting, satin(wood_frame)),
    }


def bookshelf(rng: np.random.Generator) -> dict[str, Any]:
    """The shelf at the left of the back wall, and a small one over the window's cabinet."""
    boards, books = MeshParts(), MeshParts()
    left, right, front, back = -1.62, -0.42, 2.44, 2.74
    shelves(rng, boards, books, x_m=(left, right), y_m=(front, back), count=8)
    book_row(
        rng,
        books,
        (left + 0.05, front + 0.02, 2.321),
        length_m=0.7,
        height_m=(0.17, 0.25),
        depth_m=0.2,
    )
    wood = surfaces.wood(
        rng, (256, 1024), light=(0.68, 0.5, 0.31), dark=(0.46, 0.3, 0.17), boards=1
    )
    return {
        "shelf_boards": shape("shelf_boards", boards, satin(wood, 0.3)),
        "shelf_books": shape(
            "shelf_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.35)
        ),
    }


def far_furniture(rng: np.random.Generator) -> dict[str, Any]:
    """Behind the desk: a cabinet with a globe and books, parcels, a floor plant."""
    cabinet, pulls, parcels, books, planter, globe = (MeshParts(smooth=k > 3) for k in range(6))
    cabinet.box((1.3, 0.42, 0.78), Pose((1.12, 2.52, 0.39)), tile_m=(0.9, 0.5))
    for k in range(6):
        at = (0.70 + 0.42 * (k % 3), 2.30, 0.2 + 0.38 * (k // 3))
        cabinet.box(
            (0.40, 0.02, 0.35),
            Pose(at),
            tile_m=(0.9, 0.5),
            rects={"all": (0.13 * k, 0.2 * k, 1, 1)},
        )
        pulls.box((0.12, 0.02, 0.018), Pose((at[0], 2.285, at[2] + 0.1)), tile_m=(0.2, 0.2))
    book_row(rng, books, (0.55, 2.38, 0.78), length_m=0.42, height_m=(0.2, 0.29), depth_m=0.18)
    globe.turned(ball(0.13), Pose((1.2, 2.46, 0.98), pitch_deg=15))
    planter.turned(
        [(0.02, 0.09), (0.012, 0.06), (0.012, 0.03), (0.08, 0.015), (0.085, 0.0)],
        Pose((1.2, 2.46, 0.78)),
    )
    for size, at, yaw in (
        ((0.46, 0.34, 0.36), (0.93, 1.86, 0.18), 12.0),
        ((0.40, 0.30, 0.30), (0.90, 1.88, 0.51), -8.0),
        ((0.30, 0.24, 0.24), (0.95, 1.86, 0.78), 24.0),
        ((0.22, 0.20, 0.15), (0.92, 1.87, 0.975), -14.0),
        ((0.36, 0.30, 0.3), (-0.62, 2.2, 0.15), 20.0),
    ):
        parcels.box(size, Pose(at, yaw_deg=yaw))
    planter.turned(
        [(0.0, 0.31), (0.13, 0.31), (0.15, 0.34), (0.165, 0.34), (0.16, 0.28), (0.13, 0.0)],
        Pose((-0.86, 1.85, 0.0)),
    )
    leaves, stalks = MeshParts(smooth=True), MeshParts(smooth=True)
    bush(
        rng,
        leaves,
        stalks,
        root_m=(-0.86, 1.85, 0.32),
        count=30,
        stalk_m=(0.25, 0.95),
        length_m=(0.2, 0.34),
        spread_deg=(50, 84),
    )
    wood = surfaces.wood(
        rng, (512, 1024), light=(0.36, 0.45, 0.47), dark=(0.22, 0.3, 0.32), boards=3
    )
    clay = [(0.28, 0.36, 0.42), (0.72, 0.66, 0.54), (0.2, 0.26, 0.32), (0.8, 0.74, 0.6)]
    return {
        "cabinet": shape("cabinet", cabinet, satin(wood, 0.3)),
        "pulls": shape("pulls", pulls, satin(surfaces.plastic_grain(rng, (0.62, 0.5, 0.28)), 0.35)),
        "parcels": shape("parcels", parcels, matte(surfaces.cardboard(rng))),
        "cabinet_books": shape(
            "cabinet_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.35)
        ),
        "globe": shape("globe", globe, satin(surfaces.globe_map(rng), 0.25)),
        "planter": shape(
            "planter", planter, satin(surfaces.glazed(rng, (300, 900), clay, rings=7), 0.3)
        ),
        "floor_plant": shape("floor_plant", leaves, satin(surfaces.leaf(rng), 0.4)),
        "floor_plant_stalks": shape(
            "floor_plant_stalks", stalks, matte(surfaces.plastic_grain(rng, (0.3, 0.4, 0.18)))
        ),
    }
