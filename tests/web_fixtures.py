"""Writes web/fixtures: what the method in Python answers, for the tests in TypeScript to read.

    .venv/bin/python tests/web_fixtures.py

`tests/web/test_fixtures.py` fails when the files in web/fixtures are not those of the code.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from peaking.datasets.nerfstudio import open_recording
from peaking.error_map import GAIN_STRIDE, exposure_gain
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.mpi_file import encode
from peaking.nearest import (
    Neighbour,
    nearest_by_distance,
    nearest_by_overlap,
    overlap_shares,
)
from peaking.pipeline import LocalLightField
from peaking.presets import Options
from peaking.render import Rendering
from peaking.server.recordings import wire_of_camera

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "web" / "fixtures"
OPTIONS = Options(
    pixels=60 * 130,
    generator="layered",
    num_planes=8,
    align="robust",
    neighbours=4,
    weights="overlap",
    opacity="seen",
    error_threshold=0.4,
    shift_px=1,
    compensate_exposure=True,
)


def fixtures() -> dict[str, bytes]:
    """Return all files by name."""
    mpi = desk_mpi()
    lossless = encode(mpi, codec="lossless")
    return {
        "desk.jpeg.mpi": encode(mpi, codec="jpeg"),
        "desk.lossless.mpi": lossless,
        "mpi_file.json": as_json(content_of(mpi)),
        "nearest.json": as_json(nearest_cases()),
        "exposure.json": as_json(exposure_cases()),
    }


def desk_mpi() -> Mpi:
    """Return a small MPI of the sample scene."""
    field = LocalLightField(OPTIONS)
    return field.add_view(open_recording(ROOT / "scenes" / "desk").read(0))


def content_of(mpi: Mpi) -> dict[str, Any]:
    """Return what a reader must find in the files, and the lossless one's texels as a digest."""
    return {
        "camera": wire(mpi.camera),
        "plane_depths_m": mpi.plane_depths_m.tolist(),
        "num_tiles": len(mpi.texels),
        "places": mpi.tile_places.ravel().tolist(),
        "texels_sha256": hashlib.sha256(mpi.texels.tobytes()).hexdigest(),
    }


def nearest_cases() -> list[dict[str, Any]]:
    """Return views, target and the neighbours by both ways, for random and for awkward cameras."""
    random = np.random.default_rng(7)
    cases = [
        nearest_case([camera(random) for _ in range(n)], camera(random), 1.3, count)
        for n, count in ((1, 3), (2, 3), (5, 1), (12, 3), (12, 4), (90, 4))
    ]
    here = camera(random)
    cases += [
        nearest_case([here], here, 2.0, 3),
        nearest_case([here, here, here], here, 2.0, 2),
        nearest_case([camera(random), here, camera(random)], here, 0.7, 3),
    ]
    return cases


def nearest_case(
    views: list[Camera], target: Camera, scene_depth_m: float, count: int
) -> dict[str, Any]:
    """Return one case with its answers."""
    return {
        "views": [wire(view) for view in views],
        "target": wire(target),
        "scene_depth_m": scene_depth_m,
        "count": count,
        "overlap": overlap_shares(views, target, scene_depth_m).tolist(),
        "by_distance": answers(nearest_by_distance(views, target, count=count)),
        "by_overlap": answers(nearest_by_overlap(views, target, scene_depth_m, count=count)),
    }


def answers(near: tuple[Neighbour, ...]) -> list[list[float]]:
    """Return index, weight and distance of every neighbour."""
    return [[n.index, n.weight, n.distance_m] for n in near]


def exposure_cases() -> list[dict[str, Any]]:
    """Return samples of a view and of a live picture, and the gain per channel."""
    random = np.random.default_rng(11)
    cases: list[dict[str, Any]] = []
    for gain, covered, size in (
        ((1.0, 1.0, 1.0), 1.0, (20, 30)),
        ((1.3, 1.1, 0.8), 0.7, (21, 30)),
        ((3.0, 0.3, 1.0), 1.0, (20, 30)),  # beyond the range
        ((1.3, 1.3, 1.3), 1.0, (6, 8)),  # too few
        ((1.2, 1.2, 1.2), 0.0, (20, 30)),  # nothing covered
    ):
        view = random.integers(0, 256, (*size, 4), dtype=np.uint8)
        view[..., 3] = np.where(random.uniform(size=size) < covered, 255, 90)
        noise = random.uniform(0.9, 1.1, (*size, 3))
        live = np.clip(view[..., :3] * np.array(gain) * noise, 0, 255).astype(np.uint8)
        spread = np.ones((GAIN_STRIDE, GAIN_STRIDE, 1), np.uint8)
        rgba = np.kron(view, spread).astype(np.float32) / np.float32(255)
        rendering = Rendering(rgba, np.ones(rgba.shape[:2], np.float32))
        opaque = np.full((*size, 1), 255, np.uint8)
        cases.append(
            {
                "view": view.ravel().tolist(),
                "live": np.concatenate([live, opaque], axis=-1).ravel().tolist(),
                "gain": exposure_gain(rendering, np.kron(live, spread)).astype(float).tolist(),
            }
        )
    return cases


def camera(random: np.random.Generator) -> Camera:
    """Return a camera within a metre of the origin that looks within a radian of +z."""
    axis, angle = random.normal(size=3), random.uniform(0, 1.0)
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    width, height = (294, 639) if random.uniform() < 0.5 else (640, 480)
    fx, fy = random.uniform(250, 700, 2)
    cx, cy = width * random.uniform(0.4, 0.6), height * random.uniform(0.4, 0.6)
    pinhole = Pinhole(width, height, float(fx), float(fy), float(cx), float(cy))
    return Camera(pinhole, Rigid(rotation, random.uniform(-1, 1, 3)))


def wire(camera: Camera) -> dict[str, Any]:
    """Return the camera as it is on the wire."""
    return msgspec.to_builtins(wire_of_camera(camera))


def as_json(value: object) -> bytes:
    """Return JSON whose numbers read back the same."""
    return json.dumps(value, separators=(",", ":")).encode() + b"\n"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, data in fixtures().items():
        (FOLDER / name).write_bytes(data)
