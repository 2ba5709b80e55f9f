# pyright: basic
"""A drawn scene as one mesh of small triangles, with textures in mip levels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64, UInt8

from peaking.photographers._raster_numba import CLUSTER
from peaking.photographers.drawn.mesh import MeshParts, Pose
from peaking.photographers.drawn.parts import Part, ball

LONGEST_EDGE_M = 0.12
"""Light is baked at the corners, so this is how fine shadows are."""

MOST_TEXTURE_PX = 1024
LEVELS = 11


@dataclass(frozen=True)
class Panel:
    """A rectangle that shines: centre, half sides as vectors, and light (linear RGB)."""

    centre_m: Float64[np.ndarray, "3"]
    half_u_m: Float64[np.ndarray, "3"]
    half_v_m: Float64[np.ndarray, "3"]
    rgb: Float64[np.ndarray, "3"]


@dataclass(frozen=True)
class DrawnMesh:
    """Triangles in the world, metres; every corner has a texture coordinate and a normal.

    Attributes:
        points_m: Corners.
        uvs: Texture coordinates; v down.
        normals: Of length 1.
        faces: Numbers of corners.
        texture_of: Of every face.
        density_px_per_m: Texels of the finest level per metre of every face.
        glow: Light that a corner has of its own, linear RGB; NaN where it is lit by lamps.
        textures: Start, width and height of every level of every texture.
        texels: All textures, one after the other, sRGB.
        clusters: Centre and radius of a ball around every `CLUSTER` faces.
    """

    points_m: Float32[np.ndarray, "n 3"]
    uvs: Float32[np.ndarray, "n 2"]
    normals: Float32[np.ndarray, "n 3"]
    faces: Int32[np.ndarray, "m 3"]
    texture_of: Int32[np.ndarray, "m"]
    density_px_per_m: Float32[np.ndarray, "m"]
    glow: Float32[np.ndarray, "n 3"]
    textures: Int64[np.ndarray, "t levels 3"]
    texels: UInt8[np.ndarray, "texels 3"]
    clusters: Float32[np.ndarray, "clusters 4"]


class MeshBuilder:
    """Collects parts."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._points: list[np.ndarray] = []
        self._uvs: list[np.ndarray] = []
        self._normals: list[np.ndarray] = []
        self._glow: list[np.ndarray] = []
        self._faces: list[np.ndarray] = []
        self._texture_of: list[np.ndarray] = []
        self._count = 0
        self._textures: list[np.ndarray] = []

    def add(self, part: Part, image: np.ndarray, *, glow: float | None = None) -> None:
        """Add a mesh with its picture; one that glows is as bright from everywhere."""
        points_m, uvs, faces = part.points_m, part.uvs, part.faces
        normals = face_normals(points_m, faces) if part.normals is None else part.normals
        points_m, uvs, normals, faces = split(points_m, uvs, normals, faces)
        self._points.append(points_m)
        self._uvs.append(uvs)
        self._normals.append(normals)
        self._faces.append(faces + self._count)
        self._texture_of.append(np.full(len(faces), len(self._textures), np.int32))
        self._glow.append(np.full((len(points_m), 3), np.nan if glow is None else glow))
        self._count += len(points_m)
        self._textures.append(image)

    def build(self) -> DrawnMesh:
        """Join all parts."""
        levels, texels, start = [], [], 0
        for image in self._textures:
            sizes = []
            for picture in mip_levels(image):
                high, wide = picture.shape[:2]
                sizes.append((start, wide, high))
                texels.append(picture.reshape(-1, 3))
                start += wide * high
            levels.append(sizes)
        points_m, uvs = np.concatenate(self._points), np.concatenate(self._uvs)
        faces, texture_of = np.concatenate(self._faces), np.concatenate(self._texture_of)
        order = along_a_curve(points_m[faces].mean(axis=1))
        faces, texture_of = faces[order], texture_of[order]
        textures = np.array(levels, dtype=np.int64)
        return DrawnMesh(
            points_m.astype(np.float32),
            uvs.astype(np.float32),
            np.concatenate(self._normals).astype(np.float32),
            faces.astype(np.int32),
            texture_of,
            density(points_m, uvs, faces, textures[texture_of, 0, 1:]).astype(np.float32),
            np.concatenate(self._glow).astype(np.float32),
            textures,
            np.concatenate(texels),
            balls(points_m, faces),
        )


def along_a_curve(centres_m: np.ndarray) -> np.ndarray:
    """Return an order in which neighbours in the list are neighbours in space (Morton 1966)."""
    low_m = centres_m.min(axis=0)
    cells = ((centres_m - low_m) / (np.ptp(centres_m, axis=0).max() + 1e-9) * 1023).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def balls(points_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return centre and radius of a ball around each cluster of faces."""
    found = []
    for start in range(0, len(faces), CLUSTER):
        corners = points_m[faces[start : start + CLUSTER]].reshape(-1, 3)
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        found.append((*centre, np.linalg.norm(corners - centre, axis=1).max() + 1e-4))
    return np.array(found, dtype=np.float32)


def mip_levels(image: np.ndarray) -> list[np.ndarray]:
    """Return a picture and its halves, down to one pixel; the last is repeated."""
    scale = min(1.0, MOST_TEXTURE_PX / max(image.shape[:2]))
    if scale < 1.0:
        size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    levels = [image]
    while len(levels) < LEVELS:
        high, wide = (max(1, side // 2) for side in levels[-1].shape[:2])
        levels.append(cv2.resize(levels[-1], (wide, high), interpolation=cv2.INTER_AREA))
    return levels


def face_normals(points_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return normals of corners that belong to flat sides of their own."""
    a, b, c = (points_m[faces[:, k]] for k in range(3))
    normals = np.zeros_like(points_m)
    for k in range(3):
        np.add.at(normals, faces[:, k], np.cross(b - a, c - a))
    return normals / (np.linalg.norm(normals, axis=1, keepdims=True) + 1e-15)


def split(
    points_m: np.ndarray, uvs: np.ndarray, normals: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Halve every edge that is too long, the longest of a triangle first.

    Neighbours halve the edge that they share at the same point, so nothing gapes.
    """
    while True:
        corners = points_m[faces]
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(axis=1) > LONGEST_EDGE_M
        if not long.any():
            return points_m, uvs, normals, faces
        which = edges[long].argmax(axis=1)
        rows = np.arange(len(which))
        a, b, c = (faces[long][rows, (which + k) % 3] for k in range(3))
        middle = len(points_m) + rows
        points_m = np.concatenate([points_m, (points_m[a] + points_m[b]) / 2])
        uvs = np.concatenate([uvs, (uvs[a] + uvs[b]) / 2])
        between = normals[a] + normals[b]
        between /= np.linalg.norm(between, axis=1, keepdims=True) + 1e-15
        normals = np.concatenate([normals, between])
        halves = [np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)]
        faces = np.concatenate([faces[~long], *halves])


def density(
    points_m: np.ndarray, uvs: np.ndarray, faces: np.ndarray, sizes_px: np.ndarray
) -> np.ndarray:
    """Return texels per metre of every face: the root of the ratio of its areas."""
    a, b, c = (points_m[faces[:, k]] for k in range(3))
    area_m2 = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    ua, ub, uc = (uvs[faces[:, k]] * sizes_px for k in range(3))
    p, q = ub - ua, uc - ua
    area_px2 = np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    return np.sqrt(area_px2 / np.maximum(area_m2, 1e-12))


def build_mesh(parts: Iterable[Mapping[str, Any]]) -> tuple[DrawnMesh, Sequence[Panel]]:
    """Turn the parts of a scene into one mesh, and what shines into panels.

    What breaks the rule that a surface looks the same from everywhere is replaced: a mirror by a
    pale pane, glass by painted glass. Varnish loses its gloss.
    """
    builder, panels = MeshBuilder(), []
    for part in parts:
        for name, value in part.items():
            _add(builder, panels, name, value)
    return builder.build(), panels


def _add(builder: MeshBuilder, panels: list[Panel], name: str, value: Any) -> None:
    if isinstance(value, Part):
        builder.add(value, _picture(value.bsdf))
        return
    light = _light(value)
    if value["type"] == "rectangle":
        matrix = np.asarray(value["to_world"])
        if light is not None:
            panels.append(Panel(matrix[:3, 3], matrix[:3, 0], matrix[:3, 1], light))
        if "bsdf" in value:
            mesh = MeshParts()
            corners = np.array([(-1, 1, 0, 1), (1, 1, 0, 1), (1, -1, 0, 1), (-1, -1, 0, 1.0)])
            uvs = np.array([(0, 1), (1, 1), (1, 0), (0, 0.0)])
            mesh.add((corners @ matrix.T)[:, :3], uvs, np.array([(0, 2, 1), (0, 3, 2)]))
            glow = None if light is None else 1.0
            picture = _pane() if light is None else _shining(value)
            builder.add(Part(name, *mesh.arrays(), None, {}), picture, glow=glow)
    elif value["type"] == "sphere":
        mesh, at_m = MeshParts(smooth=True), _triple(value["center"])
        mesh.turned(ball(value["radius"]), Pose(at_m))
        points_m, uvs, faces = mesh.arrays()
        normals = (points_m - np.array(at_m)) / value["radius"]
        glow = None if light is None else 1.0
        builder.add(Part(name, points_m, uvs, faces, normals, {}), _glaze(), glow=glow)


def _triple(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return float(x), float(y), float(z)


def _light(value: Mapping[str, Any]) -> np.ndarray | None:
    radiance = value.get("emitter", {}).get("radiance")
    if radiance is None:
        return None
    if radiance["type"] == "rgb":
        return np.array(radiance["value"], dtype=np.float64)
    return radiance["bitmap"].reshape(-1, 3).mean(axis=0).astype(np.float64)


def _picture(bsdf: Mapping[str, Any]) -> np.ndarray:
    """Return the picture of a material, wherever it lies in the description."""
    inner = bsdf.get("bsdf", bsdf)
    texture = inner.get("diffuse_reflectance") or inner.get("reflectance")
    return _glaze() if texture is None else texture["bitmap"]


def _shining(value: Mapping[str, Any]) -> np.ndarray:
    """Return a picture that shines, as bright as a picture can be."""
    light = value["emitter"]["radiance"]["bitmap"]
    light = np.clip(light / max(1.0, float(np.percentile(light, 98))), 0, 1)
    return (255 * light ** (1 / 2.2) + 0.5).astype(np.uint8)


def _pane() -> np.ndarray:
    """Return a pale pane with soft clouds, in place of a mirror."""
    v, u = np.mgrid[0:128, 0:96] / 32.0
    grey = 150 + 30 * np.sin(u + 0.6 * v) + 20 * np.cos(2.3 * v - u)
    return np.stack([grey * 0.94, grey * 0.99, grey], -1).astype(np.uint8)


def _glaze() -> np.ndarray:
    """Return what glass is painted with: bands and dots."""
    v, u = np.mgrid[0:128, 0:256]
    bands = (np.sin(v * 0.4) > 0) ^ (np.sin(u * 0.3) > 0.4)
    image = np.where(bands[..., None], (70, 120, 140), (205, 214, 206))
    return image.astype(np.uint8)
