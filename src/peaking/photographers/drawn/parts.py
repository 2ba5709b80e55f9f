# pyright: basic
"""What drawn scenes are put together from: materials, frames, books, plants, screens."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from peaking.photographers.drawn.mesh import MeshParts, Pose, Rect, vertex_normals

BOOKS_IN_ATLAS = 40


@dataclass(frozen=True)
class Part:
    """A mesh of one material, as plain data.

    Attributes:
        name: What Mitsuba calls it.
        points_m: n 3, in the world.
        uvs: n 2, texture coordinates.
        faces: m 3, numbers of points.
        normals: n 3 where it is smooth; None: faceted.
        bsdf: The material, as Mitsuba describes it; its pictures are arrays.
    """

    name: str
    points_m: np.ndarray
    uvs: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None
    bsdf: dict[str, Any]


def texture(image: np.ndarray) -> dict[str, Any]:
    """A texture from an sRGB picture."""
    return {"type": "bitmap", "bitmap": np.ascontiguousarray(image)}


def matte(image: np.ndarray) -> dict[str, Any]:
    """A diffuse material, the same from both sides."""
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture(image)}}


def satin(image: np.ndarray, roughness: float = 0.25) -> dict[str, Any]:
    """A material with a rough clear coat: varnish, glaze, plastic."""
    coat = {"type": "roughplastic", "distribution": "ggx", "alpha": roughness, "nonlinear": True}
    return {"type": "twosided", "bsdf": coat | {"diffuse_reflectance": texture(image)}}


def shape(name: str, parts: MeshParts, bsdf: dict[str, Any]) -> Part:
    """The collected parts as one mesh."""
    points_m, uvs, faces = parts.arrays()
    normals = vertex_normals(points_m, faces) if parts.smooth else None
    return Part(name, points_m, uvs, faces, normals, bsdf)


def panel(size_m: tuple[float, float], pose: Pose) -> np.ndarray:
    """`to_world` of a rectangle that faces -y before it is posed, its texture upright."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation() @ np.array(
        [[size_m[0] / 2, 0, 0], [0, 0, -1], [0, size_m[1] / 2, 0]]
    )
    matrix[:3, 3] = pose.at_m
    return matrix


def glowing_picture(
    image: np.ndarray, size_m: tuple[float, float], pose: Pose, *, radiance: float
) -> dict[str, Any]:
    """A picture that shines: a screen, or a window's view."""
    parts_image = image[::-1]  # a rectangle's v runs up
    light = (
        np.where((s := parts_image / 255.0) > 0.04045, ((s + 0.055) / 1.055) ** 2.4, s / 12.92)
        * radiance
    )
    return {
        "type": "rectangle",
        "to_world": panel(size_m, pose),
        "bsdf": {"type": "diffuse", "reflectance": texture((parts_image * 0.35).astype(np.uint8))},
        "emitter": {
            "type": "area",
            "radiance": {
                "type": "bitmap",
                "bitmap": light.astype(np.float32),
                "raw": True,
            },
            "sampling_weight": 0.15,
        },
    }


def picture_frame(
    parts: MeshParts, size_m: tuple[float, float], pose: Pose, *, bar_m: float, deep_m: float = 0.03
) -> None:
    """Four bars around a picture that faces -y."""
    wide, high = size_m
    for offset, size in (
        ((0, 0, (high + bar_m) / 2), (wide + 2 * bar_m, deep_m, bar_m)),
        ((0, 0, -(high + bar_m) / 2), (wide + 2 * bar_m, deep_m, bar_m)),
        (((wide + bar_m) / 2, 0, 0), (bar_m, deep_m, high)),
        ((-(wide + bar_m) / 2, 0, 0), (bar_m, deep_m, high)),
    ):
        at = pose.apply(np.array(offset, float))
        parts.box(
            size, Pose(tuple(at), pose.yaw_deg, pose.pitch_deg, pose.roll_deg), tile_m=(0.9, 0.1)
        )


def book(parts: MeshParts, size_m: tuple[float, float, float], pose: Pose, *, index: int) -> None:
    """A book standing on its foot: thickness x, depth y, height z; the spine looks to -y."""
    cell = 1.0 / (BOOKS_IN_ATLAS + 1)
    u = (index % BOOKS_IN_ATLAS) * cell
    spine, cover, edges = (
        (u, 0.0, u + cell, 1.0),
        (u + 0.1 * cell, 0.1, u + 0.9 * cell, 0.9),
        (1 - cell, 0.0, 1.0, 1.0),
    )
    rects: dict[str, Rect] = {
        "front": spine,
        "left": cover,
        "right": cover,
        "top": edges,
        "bottom": edges,
        "back": edges,
    }
    parts.box(size_m, pose, rects=rects)


def book_row(
    rng: np.random.Generator,
    parts: MeshParts,
    start_m: tuple[float, float, float],
    *,
    length_m: float,
    height_m: tuple[float, float],
    depth_m: float,
) -> None:
    """A row of books from `start_m` (left, front, foot) to the right; some lean, some lie."""
    x, y, z = start_m
    end = x + length_m
    while x < end - 0.05:
        if rng.random() < 0.08 and end - x > 0.3:
            for k in range(4):
                thick, long = rng.uniform(0.022, 0.04), rng.uniform(0.19, 0.24)
                book(
                    parts,
                    (thick, depth_m, long),
                    Pose((x + 0.12, y + depth_m / 2, z + 0.02 + 0.036 * k), roll_deg=90),
                    index=int(rng.integers(0, 99)),
                )
            x += 0.26
            continue
        thick, high = rng.uniform(0.018, 0.048), rng.uniform(*height_m)
        lean = 7.0 if rng.random() < 0.07 else 0.0
        pull = rng.uniform(0, 0.03)
        book(
            parts,
            (thick, depth_m, high),
            Pose(
                (x + thick / 2 + lean * 0.002, y + pull + depth_m / 2, z + high / 2), roll_deg=lean
            ),
            index=int(rng.integers(0, 99)),
        )
        x += thick + 0.001 + lean * 0.004


def shelves(
    rng: np.random.Generator,
    boards: MeshParts,
    books: MeshParts,
    *,
    x_m: tuple[float, float],
    y_m: tuple[float, float],
    count: int,
) -> None:
    """A bookshelf of two columns that looks to -y, `count` boards 0.32 m apart, full of books."""
    (left, right), (front, back) = x_m, y_m
    middle, deep, high = (left + right) / 2, back - front, 0.32 * count - 0.26
    for x in (left, middle, right):
        boards.box((0.025, deep, high), Pose((x, (front + back) / 2, high / 2)), tile_m=(0.9, 0.3))
    boards.box((right - left, 0.012, high), Pose((middle, back, high / 2)), tile_m=(0.9, 0.3))
    for k in range(count):
        z = 0.06 + 0.32 * k
        boards.box(
            (right - left, deep, 0.022), Pose((middle, (front + back) / 2, z)), tile_m=(0.9, 0.3)
        )
        if k == count - 1:
            continue
        for start in (left, middle):
            length = middle - left - rng.choice((0.03, 0.03, 0.14))
            book_row(
                rng,
                books,
                (start + 0.018, front + 0.02, z + 0.011),
                length_m=length,
                height_m=(0.19, 0.285),
                depth_m=0.2,
            )


def ball(radius_m: float) -> list[tuple[float, float]]:
    """The profile of a sphere."""
    angle = np.linspace(0, np.pi, 33)
    return [(float(radius_m * np.sin(a)), float(radius_m * np.cos(a))) for a in angle]


def bush(
    rng: np.random.Generator,
    leaves: MeshParts,
    stalks: MeshParts,
    *,
    root_m: tuple[float, float, float],
    count: int,
    stalk_m: tuple[float, float],
    length_m: tuple[float, float],
    spread_deg: tuple[float, float],
) -> None:
    """Leaves on thin stalks that fan out from `root_m`."""
    root = np.array(root_m)
    for k in range(count):
        azimuth, rise = 137.5 * k + rng.uniform(-15, 15), rng.uniform(*spread_deg)
        a, e = np.radians((azimuth, rise))
        out = np.array((np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)))
        long = rng.uniform(*stalk_m)
        path = root + out * long * np.linspace(0, 1, 8)[:, None]
        stalks.tube(path, 0.003 + 0.004 * (long > 0.4))
        length = rng.uniform(*length_m)
        leaves.leaf(
            path[-1], azimuth + rng.uniform(-25, 25), rise - rng.uniform(10, 45),
            length_m=length, width_m=length * rng.uniform(0.42, 0.55), droop=rng.uniform(0.5, 1.5),
        )  # fmt: skip
