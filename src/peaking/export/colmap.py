"""Models of COLMAP, text and binary (doc/format.rst): cameras, images, points3D; pictures, masks.

Poses are those of the world in the camera (OpenCV axes); pixels have corner origin, as ours.
Points carry the pictures that see them: places where they project, so their error is 0.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int32, UInt32

from peaking.export.checking import Meant, meant
from peaking.export.material import Material
from peaking.export.points import NO_POINTS, Gathering, SeedPoints, seen_points
from peaking.export.writing import (
    Written,
    encode_mask,
    quaternion_wxyz,
    rotation_of_wxyz,
    words,
    write,
)
from peaking.geometry import Camera, Pinhole, Rigid

MODEL = "sparse/0"
IMAGES, MASKS = "images", "masks"
PINHOLE_ID = 1
MOST_OF_A_FRAME = 2000
"""Points that a picture is said to see, beside those that none before it sees; features of COLMAP's
that are matched are as many."""


@dataclass(frozen=True, eq=False)
class _Model:
    """What is in the three files; cameras, images and points are numbered from 1.

    Attributes:
        names: Of the pictures.
        cameras: One for each picture.
        pinholes: The different ones.
        seen: For each picture, the numbers of points that it sees.
        points: All.
    """

    names: Sequence[str]
    cameras: Sequence[Camera]
    pinholes: Sequence[Pinhole]
    seen: Sequence[Int32[np.ndarray, "_"]]
    points: SeedPoints

    def camera_id(self, place: int) -> int:
        return 1 + self.pinholes.index(self.cameras[place].pinhole)

    def world_in_cam(self, place: int) -> tuple[np.ndarray, np.ndarray]:
        """Quaternion w, x, y, z and translation."""
        there = self.cameras[place].world_from_cam.inverse()
        return quaternion_wxyz(there.rotation), there.translation_m

    def places_px(self, place: int) -> Float64[np.ndarray, "n 2"]:
        """Where a picture sees its points."""
        return self.cameras[place].project(self.points.xyz_m[self.seen[place]])[0]

    def tracks(self) -> Iterator[UInt32[np.ndarray, "n 2"]]:
        """Yield for each point (image, number of its place there)."""
        numbers = np.concatenate([np.zeros(0, np.int32), *self.seen])
        order = np.argsort(numbers, kind="stable")
        counts = [len(one) for one in self.seen]
        images = np.repeat(np.arange(1, len(counts) + 1, dtype=np.uint32), counts)[order]
        first = np.repeat(np.cumsum([0, *counts[:-1]]), counts)
        places = (np.arange(len(numbers)) - first).astype(np.uint32)[order]
        ends = np.cumsum(np.bincount(numbers, minlength=len(self.points)))
        for start, end in pairwise([0, *ends.tolist()]):
            yield np.column_stack([images[start:end], places[start:end]])


def write_colmap(material: Material, folder: Path) -> Written:
    """Write a binary model."""
    return _write(material, folder, text=False)


def write_colmap_text(material: Material, folder: Path) -> Written:
    """Write a model as text."""
    return _write(material, folder, text=True)


def _write(material: Material, folder: Path, *, text: bool) -> Written:
    gathering = Gathering(material, np.random.default_rng(0))
    notes: list[Meant] = []
    for place in material.places:
        frame = material.read(place)
        gathering.add(frame)
        data, ending = material.picture(place, frame)
        name = f"{frame.name}.{ending}"
        write(folder, f"{IMAGES}/{name}", data)
        if frame.mask is not None:
            write(folder, f"{MASKS}/{name}.png", encode_mask(frame.mask))
        notes.append(meant(material, frame, (f"{IMAGES}/{name}", data)))
    points = gathering.points()
    seen = _seen(material, points)
    names = [one.picture.removeprefix(f"{IMAGES}/") for one in notes]
    pinholes = list(dict.fromkeys(camera.pinhole for camera in material.cameras))
    model = _Model(names, material.cameras, pinholes, seen, points)
    where = folder / MODEL
    where.mkdir(parents=True)
    if text:
        _write_text(model, where)
        read = _read_text(where)
    else:
        _write_binary(model, where)
        read = _read_binary(where)
    cameras = [(f"{IMAGES}/{name}", camera) for name, camera in read]
    return Written(notes, cameras, () if len(points) else (NO_POINTS,))


def _seen(material: Material, points: SeedPoints) -> list[Int32[np.ndarray, "_"]]:
    """Return which points each frame is said to see.

    Of all that it sees these are the first ones, the same in all frames, and those that no frame
    before it saw.
    """
    untold = np.ones(len(points), np.bool_)
    seen: list[Int32[np.ndarray, "_"]] = []
    for place in material.places:
        numbers = seen_points(material.read(place), points)
        kept = untold[numbers]
        kept[:MOST_OF_A_FRAME] = True
        seen.append(numbers[kept])
        untold[numbers] = False
    return seen


def _write_text(model: _Model, where: Path) -> None:
    with (where / "cameras.txt").open("w", encoding="utf-8") as file:
        file.write("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[] (fx, fy, cx, cy)\n")
        for number, k in enumerate(model.pinholes, 1):
            params = words([k.fx_px, k.fy_px, k.cx_px, k.cy_px])
            file.write(f"{number} PINHOLE {k.width_px} {k.height_px} {params}\n")
    with (where / "images.txt").open("w", encoding="utf-8") as file:
        file.write("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n")
        file.write("# POINTS2D[] as (X, Y, POINT3D_ID)\n")
        for place, name in enumerate(model.names):
            pose = " ".join(map(words, model.world_in_cam(place)))
            file.write(f"{place + 1} {pose} {model.camera_id(place)} {name}\n")
            places = zip(model.places_px(place).tolist(), model.seen[place].tolist(), strict=True)
            file.write(" ".join(f"{x!r} {y!r} {number + 1}" for (x, y), number in places) + "\n")
    with (where / "points3D.txt").open("w", encoding="utf-8") as file:
        file.write("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n")
        for number, track in enumerate(model.tracks()):
            r, g, b = model.points.rgb[number].tolist()
            at = " ".join(map(str, track.ravel().tolist()))
            file.write(f"{number + 1} {words(model.points.xyz_m[number])} {r} {g} {b} 0 {at}\n")


def _write_binary(model: _Model, where: Path) -> None:
    with (where / "cameras.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(model.pinholes)))
        for number, k in enumerate(model.pinholes, 1):
            file.write(struct.pack("<IiQQ", number, PINHOLE_ID, k.width_px, k.height_px))
            file.write(struct.pack("<4d", k.fx_px, k.fy_px, k.cx_px, k.cy_px))
    with (where / "images.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(model.names)))
        for place, name in enumerate(model.names):
            q, t = model.world_in_cam(place)
            file.write(struct.pack("<I7dI", place + 1, *q, *t, model.camera_id(place)))
            file.write(name.encode() + b"\0")
            rows = np.zeros(len(model.seen[place]), [("xy", "<f8", 2), ("point", "<u8")])
            rows["xy"], rows["point"] = model.places_px(place), model.seen[place] + 1
            file.write(struct.pack("<Q", len(rows)) + rows.tobytes())
    with (where / "points3D.bin").open("wb") as file:
        file.write(struct.pack("<Q", len(model.points)))
        for number, track in enumerate(model.tracks()):
            xyz, rgb = model.points.xyz_m[number], model.points.rgb[number].tolist()
            file.write(struct.pack("<Q3d3BdQ", number + 1, *xyz, *rgb, 0.0, len(track)))
            file.write(track.astype("<u4").tobytes())


def _read_text(where: Path) -> list[tuple[str, Camera]]:
    """Read a text model that was written here."""
    pinholes: dict[str, Pinhole] = {}
    for line in _lines(where / "cameras.txt"):
        number, _, width, height, *params = line.split()
        pinholes[number] = Pinhole(int(width), int(height), *map(float, params))
    found: list[tuple[str, Camera]] = []
    for line in _lines(where / "images.txt")[::2]:
        _, *pose, camera, name = line.split(" ", 9)
        found.append((name, _camera(np.array(pose, float), pinholes[camera])))
    return found


def _lines(path: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8").split("\n")[:-1]
    return [line for line in lines if not line.startswith("#")]


def _read_binary(where: Path) -> list[tuple[str, Camera]]:
    """Read a binary model that was written here."""
    data = (where / "cameras.bin").read_bytes()
    pinholes: dict[int, Pinhole] = {}
    for number, _, width, height, *params in struct.iter_unpack("<IiQQ4d", data[8:]):
        pinholes[number] = Pinhole(width, height, *params)
    data = (where / "images.bin").read_bytes()
    found: list[tuple[str, Camera]] = []
    at = 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        _, *pose, camera = struct.unpack_from("<I7dI", data, at)
        end = data.index(b"\0", at + 64)
        found.append((data[at + 64 : end].decode(), _camera(np.array(pose), pinholes[camera])))
        at = end + 9 + 24 * struct.unpack_from("<Q", data, end + 1)[0]
    return found


def _camera(pose: Float64[np.ndarray, "7"], pinhole: Pinhole) -> Camera:
    rotation = rotation_of_wxyz(pose[:4])
    return Camera(pinhole, Rigid(rotation.T, -rotation.T @ pose[4:]))
