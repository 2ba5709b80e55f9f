# pyright: basic
"""Triangle meshes of drawn scenes: boxes, turned shapes, tubes and leaves.

Texture coordinates have their origin at the picture's top left, v down. A `Rect` is a part of a
texture: u0, v0, u1, v1. World axes: +Z up, metres.
"""

from dataclasses import dataclass, field

import numpy as np

Rect = tuple[float, float, float, float]
WHOLE: Rect = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class Pose:
    """Where a part stands: `world = R_z(yaw) R_x(pitch) R_y(roll) @ part + at_m`."""

    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    def rotation(self) -> np.ndarray:
        """`world_from_part`'s rotation."""
        (cz, cx, cy), (sz, sx, sy) = (
            f(np.radians((self.yaw_deg, self.pitch_deg, self.roll_deg))) for f in (np.cos, np.sin)
        )
        r_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        r_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        r_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        return r_z @ r_x @ r_y

    def apply(self, points_m: np.ndarray) -> np.ndarray:
        """Move part points into the world."""
        return points_m @ self.rotation().T + np.asarray(self.at_m)


@dataclass
class MeshParts:
    """Collects parts that share one texture; `arrays` joins them."""

    smooth: bool = False
    _points: list[np.ndarray] = field(default_factory=list)
    _uvs: list[np.ndarray] = field(default_factory=list)
    _faces: list[np.ndarray] = field(default_factory=list)
    _count: int = 0

    def add(self, points_m: np.ndarray, uvs: np.ndarray, faces: np.ndarray) -> None:
        """Append world points with their texture coordinates and triangles."""
        self._points.append(points_m)
        self._uvs.append(uvs)
        self._faces.append(faces + self._count)
        self._count += len(points_m)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (n 3), texture coordinates (n 2) and triangles (m 3)."""
        return np.concatenate(self._points), np.concatenate(self._uvs), np.concatenate(self._faces)

    def box(
        self, size_m: tuple[float, float, float], pose: Pose, *,
        rects: dict[str, Rect] | None = None, tile_m: tuple[float, float] | None = None,
    ) -> None:  # fmt: skip
        """A box centred on `pose`.

        Faces are `front` (-y), `back`, `left` (-x), `right`, `top`, `bottom`. Each shows its
        `Rect` (or `all`, or the whole texture); with `tile_m` the texture repeats every so many
        metres along u and v instead, and the grain runs along each face's longer side.
        """
        sx, sy, sz = size_m
        rects = rects or {}
        # name: (centre of the face, direction of u, direction of v), all in half sizes
        frames = {
            "front": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
            "back": ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
            "left": ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
            "right": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
            "top": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
            "bottom": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
        }
        half = np.array((sx, sy, sz)) / 2
        for name, (centre, u, v) in frames.items():
            c, u, v = (np.array(a) * half for a in (centre, u, v))
            points = np.stack([c - u - v, c + u - v, c + u + v, c - u + v])
            u0, v0, u1, v1 = rects.get(name, rects.get("all", WHOLE))
            uvs = np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1)])
            if tile_m is not None:
                wide, high = 2 * np.linalg.norm(u), 2 * np.linalg.norm(v)
                corners = np.array([(0, 0), (wide, 0), (wide, high), (0, high)])
                corners = corners[:, ::-1] if high > wide else corners
                uvs = corners / np.array(tile_m) + (u0, v0)
            self.add(pose.apply(points), uvs, np.array([(0, 2, 1), (0, 3, 2)]))

    def grid(self, points_m: np.ndarray, rect: Rect = WHOLE) -> None:
        """A sheet of `rows columns 3` world points, first row on the texture's top."""
        rows, cols = points_m.shape[:2]
        v, u = np.meshgrid(
            np.linspace(rect[1], rect[3], rows), np.linspace(rect[0], rect[2], cols), indexing="ij"
        )
        i = np.arange(rows * cols).reshape(rows, cols)
        a, b, c, d = (x.ravel() for x in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
        faces = np.concatenate([np.stack([a, c, b], -1), np.stack([a, d, c], -1)])
        self.add(points_m.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2), faces)

    def turned(
        self,
        profile_m: list[tuple[float, float]],
        pose: Pose,
        *,
        sides: int = 48,
        longer: float = 1.0,
    ) -> None:
        """A turned shape: `profile_m` lists (radius, height) from its top to its bottom.

        `longer` stretches it along its y.
        """
        angle = np.linspace(0, 2 * np.pi, sides + 1)
        radius, height = np.array(profile_m).T
        ring = np.stack([np.cos(angle), np.sin(angle)], -1)
        points = np.concatenate(
            [
                radius[:, None, None] * ring[None],
                np.broadcast_to(height[:, None, None], (len(radius), sides + 1, 1)),
            ],
            -1,
        )
        self.grid(pose.apply(points * (1.0, longer, 1.0)))

    def tube(
        self, path_m: np.ndarray, radius_m: float, *, sides: int = 10, rect: Rect = WHOLE
    ) -> None:
        """A round rod along the points of `path_m`."""
        along = np.gradient(path_m, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        side = np.cross(along, (0.31, 0.17, 0.93) if abs(along[0, 2]) < 0.9 else (1.0, 0.2, 0.0))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        other = np.cross(along, side)
        angle = -np.linspace(0, 2 * np.pi, sides + 1)
        ring = (
            np.cos(angle)[None, :, None] * side[:, None]
            + np.sin(angle)[None, :, None] * other[:, None]
        )
        self.grid(path_m[:, None] + radius_m * ring, rect)

    def leaf(
        self,
        base_m: np.ndarray,
        azimuth_deg: float,
        rise_deg: float,
        *,
        length_m: float,
        width_m: float,
        droop: float,
    ) -> None:
        """A leaf blade that starts at `base_m`, rises and then droops."""
        steps = np.linspace(0, 1, 13)
        rise = np.radians(rise_deg) - droop * steps
        out = np.array((np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg)), 0.0))
        across = np.array((-out[1], out[0], 0.0))
        step = np.cos(rise)[:, None] * out + np.sin(rise)[:, None] * np.array((0, 0, 1.0))
        spine = base_m + np.cumsum(step, axis=0) * length_m / len(steps)
        half = 0.5 * width_m * np.sin(np.pi * steps**0.75) ** 0.8 + 0.001
        k = np.linspace(-1, 1, 7)
        fold = np.abs(k)[None, :, None] * half[:, None, None] * 0.35 * np.array((0, 0, 1.0))
        wave = (
            0.06
            * width_m
            * np.sin(9 * steps)[:, None, None]
            * (k[None, :, None] ** 2)
            * np.array((0, 0, 1.0))
        )
        points = spine[:, None] + half[:, None, None] * k[None, :, None] * across + fold + wave
        self.grid(points[::-1])


def vertex_normals(points_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area-weighted normals; vertices at the same place share theirs."""
    a, b, c = (points_m[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    _, place = np.unique(np.round(points_m, 6), axis=0, return_inverse=True)
    place = place.ravel()
    total = np.zeros((place.max() + 1, 3))
    for k in range(3):
        np.add.at(total, place[faces[:, k]], normal)
    total = total[place]
    return total / (np.linalg.norm(total, axis=1, keepdims=True) + 1e-12)
