# pyright: basic
"""The desk itself and what stands on it: the near half of the desk scene."""

import itertools
from typing import Any

import numpy as np

from peaking.photographers.drawn import drawing, prints, surfaces
from peaking.photographers.drawn.desk_room import DESK_TOP_M, GLASS, MIRROR
from peaking.photographers.drawn.mesh import MeshParts, Pose, Rect
from peaking.photographers.drawn.parts import (
    BOOKS_IN_ATLAS,
    book,
    book_row,
    bush,
    glowing_picture,
    matte,
    panel,
    picture_frame,
    satin,
    shape,
)


def desk(rng: np.random.Generator) -> dict[str, Any]:
    """Top, legs, drawers under the top, and the chair pushed under it."""
    top, body, pulls, seat = (MeshParts() for _ in range(4))
    top.box((1.9, 0.80, 0.035), Pose((0.1, 1.02, DESK_TOP_M - 0.0175)), tile_m=(1.9, 0.80))
    for k in range(3):
        at = (-0.48 + 0.58 * k, 0.665, 0.64)
        body.box(
            (0.57, 0.02, 0.125),
            Pose(at),
            tile_m=(0.8, 0.4),
            rects={"all": (0.3 * k, 0.17 * k, 1, 1)},
        )
        pulls.box((0.14, 0.022, 0.014), Pose((at[0], 0.648, 0.645)), tile_m=(0.2, 0.2))
    for x in (-0.8, 1.0):
        for y in (0.68, 1.36):
            body.box((0.06, 0.06, 0.71), Pose((x, y, 0.355)), tile_m=(0.8, 0.4))
    body.box((0.42, 0.6, 0.56), Pose((0.72, 1.02, 0.42)), tile_m=(0.8, 0.4))
    seat.box((0.44, 0.42, 0.075), Pose((0.0, 0.72, 0.44), yaw_deg=8), tile_m=(0.3, 0.3))
    light, dark = (0.74, 0.56, 0.38), (0.54, 0.36, 0.21)
    board = surfaces.wood(rng, (860, 2048), light=light, dark=dark, boards=6)
    return {
        "desk_top": shape("desk_top", top, satin(board, 0.22)),
        "desk_body": shape(
            "desk_body",
            body,
            satin(surfaces.wood(rng, (430, 860), light=light, dark=dark, boards=2), 0.3),
        ),
        "desk_pulls": shape(
            "desk_pulls", pulls, satin(surfaces.plastic_grain(rng, (0.2, 0.2, 0.22)), 0.35)
        ),
        "seat": shape("seat", seat, matte(surfaces.cloth(rng))),
    }


def near_plant(rng: np.random.Generator) -> dict[str, Any]:
    """The closest object: a pot of leaves on a stack of books, at the left."""
    books, pot, leaves, stalks = (MeshParts(smooth=k > 0) for k in range(4))
    z = DESK_TOP_M
    for k, (thick, yaw) in enumerate(((0.045, 4.0), (0.032, -6.0), (0.05, 9.0), (0.03, -3.0))):
        book(
            books,
            (thick, 0.17, 0.235),
            Pose((-0.315, 0.775, z + thick / 2), yaw, 0.0, -90.0),
            index=3 + 5 * k,
        )
        z += thick
    profile = [
        (0.0, 0.105),
        (0.052, 0.105),
        (0.056, 0.118),
        (0.066, 0.118),
        (0.066, 0.095),
        (0.060, 0.092),
        (0.046, 0.0),
    ]
    pot.turned(profile, Pose((-0.315, 0.755, z)))
    bush(
        rng,
        leaves,
        stalks,
        root_m=(-0.315, 0.755, z + 0.1),
        count=26,
        stalk_m=(0.03, 0.17),
        length_m=(0.09, 0.15),
        spread_deg=(25, 85),
    )
    clay = [(0.68, 0.36, 0.24), (0.62, 0.31, 0.2), (0.86, 0.78, 0.64), (0.24, 0.38, 0.42)]
    return {
        "stack": shape("stack", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)),
        "pot": shape("pot", pot, satin(surfaces.glazed(rng, (240, 960), clay, rings=9), 0.3)),
        "near_leaves": shape("near_leaves", leaves, satin(surfaces.leaf(rng), 0.35)),
        "near_stalks": shape(
            "near_stalks", stalks, matte(surfaces.plastic_grain(rng, (0.36, 0.46, 0.2)))
        ),
    }


def computer(rng: np.random.Generator) -> dict[str, Any]:
    """Monitor with sticky notes, keyboard, mouse on its mat."""
    case, keys, mat, mouse, notes = (MeshParts(smooth=k == 3) for k in range(5))
    at, wide, high = Pose((-0.02, 1.235, 1.06), yaw_deg=-3), 0.56, 0.335
    case.box(
        (wide + 0.03, 0.03, high + 0.035),
        Pose((-0.02, 1.252, 1.057), yaw_deg=-3),
        tile_m=(0.3, 0.3),
    )
    case.box((0.06, 0.03, 0.2), Pose((-0.01, 1.285, 0.84)), tile_m=(0.3, 0.3))
    case.box((0.26, 0.18, 0.014), Pose((-0.01, 1.26, DESK_TOP_M + 0.007)), tile_m=(0.3, 0.3))
    for k, (x, z) in enumerate(((-0.2, -0.2), (-0.11, -0.205), (0.2, -0.198))):
        spot = at.apply(np.array((x, -0.006, z)))
        notes.box((0.075, 0.001, 0.075), Pose(tuple(spot), -3, -8 + 2 * k, 3 - 4 * k))
    plastic: Rect = (0.94, 0.76, 0.99, 0.99)
    board = Pose((0.03, 0.93, DESK_TOP_M + 0.011), yaw_deg=4, pitch_deg=3)
    keys.box((0.44, 0.145, 0.018), board, rects={"all": plastic})
    for row in range(5):
        for col in range(15):
            if row == 4 and 4 <= col <= 8:
                continue
            k = (row * 15 + col) % 62
            cap: Rect = (k % 16 / 16, k // 16 / 4, (k % 16 + 1) / 16, (k // 16 + 1) / 4)
            spot = board.apply(np.array((-0.203 + 0.029 * col, 0.056 - 0.028 * row, 0.0135)))
            keys.box(
                (0.0255, 0.0245, 0.011),
                Pose(tuple(spot), 4, 3),
                rects={"all": cap, "front": (0.02, 0.01, 0.04, 0.02)},
            )
    space = board.apply(np.array((-0.203 + 0.029 * 6, -0.056, 0.0135)))
    keys.box((0.142, 0.0245, 0.011), Pose(tuple(space), 4, 3), rects={"all": plastic})
    mat.box((0.21, 0.19, 0.003), Pose((0.375, 0.925, DESK_TOP_M + 0.0015), yaw_deg=-6))
    angle = np.linspace(0, np.pi / 2, 13)
    dome = [(float(np.sin(a)), float(np.cos(a))) for a in angle]
    mouse.turned(
        [(0.031 * r, 0.034 * h) for r, h in dome],
        Pose((0.365, 0.925, DESK_TOP_M + 0.003), yaw_deg=-8),
        longer=1.7,
    )
    return {
        "screen": glowing_picture(prints.code_screen(rng), (wide, high), at, radiance=0.9),
        "monitor_case": shape(
            "monitor_case", case, satin(surfaces.plastic_grain(rng, (0.16, 0.165, 0.18)), 0.35)
        ),
        "keyboard": shape("keyboard", keys, satin(prints.key_atlas(), 0.35)),
        "mat": shape("mat", mat, matte(surfaces.cloth(rng))),
        "mouse": shape("mouse", mouse, satin(surfaces.plastic_grain(rng, (0.2, 0.2, 0.22)), 0.3)),
        "notes": shape("notes", notes, matte(sticky_note(rng))),
    }


def sticky_note(rng: np.random.Generator) -> np.ndarray:
    """A yellow note with handwriting."""
    image = np.full((180, 180, 3), (0.9, 0.8, 0.36))
    for y in range(38, 170, 30):
        drawing.write_text(
            image, drawing.phrase(rng, 2), (12, y), height_px=18, colour=(0.16, 0.2, 0.42)
        )
    return drawing.to_uint8(image)


def papers(rng: np.random.Generator) -> dict[str, Any]:
    """Printed sheets, an open pad and a closed book, lying on the desk."""
    out: dict[str, Any] = {}
    places = (
        (0.03, 0.72, -9.0),
        (0.22, 0.74, 14.0),
        (0.60, 0.80, 27.0),
        (-0.32, 1.0, -22.0),
        (-0.06, 0.74, 3.0),
    )
    for k, (x, y, yaw) in enumerate(places):
        sheet = MeshParts()
        sheet.box(
            (0.19, 0.268, 0.0012), Pose((x, y + 0.03, DESK_TOP_M + 0.001 + 0.0015 * k), yaw_deg=yaw)
        )
        out[f"page_{k}"] = shape(f"page_{k}", sheet, matte(prints.page(rng)))
    cover = MeshParts()
    cover.box(
        (0.15, 0.2, 0.022),
        Pose((0.62, 0.86, DESK_TOP_M + 0.019), yaw_deg=-16),
        rects={"front": (0, 0, 1, 0.05)},
    )
    return out | {"cover": shape("cover", cover, satin(prints.book_cover(rng), 0.3))}


def small_things(rng: np.random.Generator) -> dict[str, Any]:
    """Mug, pens in a cup, desk lamp, a row of books between ends, a small box."""
    mug, cup, pens, lamp, books, box = (MeshParts(smooth=k < 4) for k in range(6))
    z = DESK_TOP_M
    mug.turned(
        [
            (0.0, 0.012),
            (0.036, 0.012),
            (0.037, 0.095),
            (0.041, 0.095),
            (0.041, 0.004),
            (0.036, 0.0),
        ],
        Pose((-0.215, 0.985, z)),
    )
    bend = np.linspace(-1.35, 1.35, 14)
    handle = np.stack([0.038 + 0.026 * np.cos(bend), 0 * bend, 0.05 + 0.03 * np.sin(bend)], -1)
    mug.tube(Pose((-0.215, 0.985, z), yaw_deg=-35).apply(handle), 0.006)
    cup.turned(
        [(0.0, 0.01), (0.034, 0.01), (0.036, 0.1), (0.039, 0.1), (0.039, 0.0)],
        Pose((0.305, 1.165, z)),
    )
    for k in range(9):
        a, tilt = 2.4 * k, 0.022
        foot = np.array((0.305 - 0.02 * np.cos(a), 1.165 - 0.02 * np.sin(a), z + 0.012))
        tip = np.array(
            (
                0.305 + (0.02 + tilt) * np.cos(a),
                1.165 + (0.02 + tilt) * np.sin(a),
                z + rng.uniform(0.14, 0.185),
            )
        )
        cell = (k % 6 + 0.2) / 18
        pens.tube(
            foot + (tip - foot) * np.linspace(0, 1, 5)[:, None],
            0.0038,
            rect=(cell, 0, cell + 0.03, 1),
        )
    base = np.array((-0.62, 1.25, z))
    lamp.turned([(0.0, 0.024), (0.075, 0.022), (0.085, 0.0)], Pose(tuple(base)))
    joints = base + np.array([(0, 0, 0.02), (-0.05, 0.02, 0.34), (0.24, -0.06, 0.58)])
    for a, b in itertools.pairwise(joints):
        lamp.tube(a + (b - a) * np.linspace(0, 1, 4)[:, None], 0.008)
    lamp.turned(
        [(0.018, 0.05), (0.022, 0.0), (0.085, -0.1), (0.083, -0.1), (0.02, -0.004)],
        Pose(tuple(joints[2]), 0, 12, -18),
    )
    book_row(rng, books, (-0.56, 1.16, z), length_m=0.30, height_m=(0.17, 0.25), depth_m=0.16)
    box.box((0.2, 0.15, 0.12), Pose((0.83, 1.02, z + 0.06), yaw_deg=-20))
    glaze = [(0.82, 0.78, 0.68), (0.2, 0.36, 0.46), (0.82, 0.78, 0.68), (0.7, 0.34, 0.22)]
    cup_glaze = [(0.22, 0.34, 0.28), (0.76, 0.7, 0.5), (0.3, 0.42, 0.34), (0.86, 0.8, 0.66)]
    stripes = np.repeat((drawing.PALETTE[:18] * 255).astype(np.uint8)[None], 64, axis=0)
    return {
        "mug": shape("mug", mug, satin(surfaces.glazed(rng, (240, 640), glaze, rings=7), 0.2)),
        "cup": shape("cup", cup, satin(surfaces.glazed(rng, (240, 640), cup_glaze, rings=8), 0.3)),
        "pens": shape("pens", pens, satin(stripes, 0.3)),
        "lamp": shape("lamp", lamp, satin(surfaces.plastic_grain(rng, (0.62, 0.2, 0.13)), 0.25)),
        "desk_books": shape(
            "desk_books", books, satin(prints.spine_atlas(rng, BOOKS_IN_ATLAS), 0.3)
        ),
        "small_box": shape("small_box", box, matte(surfaces.cardboard(rng))),
    }


def mirror_and_glass(rng: np.random.Generator) -> dict[str, Any]:
    """The standing mirror in its frame, and the glass sphere on its ring."""
    frame, ring = MeshParts(), MeshParts(smooth=True)
    pose = Pose((0.515, 1.12, DESK_TOP_M + 0.245), yaw_deg=-17, pitch_deg=-7)
    size = (0.26, 0.40)
    picture_frame(frame, size, pose, bar_m=0.028, deep_m=0.028)
    frame.box(
        (size[0], 0.008, size[1]),
        Pose(tuple(pose.apply(np.array((0, 0.01, 0)))), pose.yaw_deg, pose.pitch_deg),
        tile_m=(0.9, 0.1),
    )
    frame.box(
        (0.02, 0.02, 0.4),
        Pose((0.555, 1.23, DESK_TOP_M + 0.19), pose.yaw_deg, 14),
        tile_m=(0.9, 0.1),
    )
    ring.turned(
        [(0.024, 0.016), (0.032, 0.022), (0.042, 0.016), (0.046, 0.0)],
        Pose((0.195, 1.04, DESK_TOP_M)),
    )
    wood = surfaces.wood(
        rng, (128, 1024), light=(0.5, 0.28, 0.15), dark=(0.26, 0.12, 0.06), boards=1
    )
    radius = 0.062
    return {
        "mirror_frame": shape("mirror_frame", frame, satin(wood, 0.25)),
        "glass_ring": shape("glass_ring", ring, satin(wood, 0.25)),
        MIRROR: {
            "type": "rectangle",
            "to_world": panel(size, pose),
            "bsdf": {"type": "conductor", "material": "Ag"},
        },
        GLASS: {
            "type": "sphere",
            "center": [0.195, 1.04, DESK_TOP_M + radius + 0.010],
            "radius": radius,
            "bsdf": {"type": "dielectric", "int_ior": 1.5},
        },
    }
