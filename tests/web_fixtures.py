"""Writes web/fixtures: what the method in Python answers, for the tests in TypeScript to read.

    .venv/bin/python tests/web_fixtures.py

`tests/web/test_fixtures.py` fails when the files in web/fixtures are not those of the code.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from drawn_room import bare, disturbed, photographed, upright_stripes
from peaking import tracking
from peaking.datasets import open_recording
from peaking.error_map.exposure import STRIDE_PX, Exposure, measure_exposure
from peaking.geometry import Cam, Camera, Pinhole, Rigid, World
from peaking.guidance import (
    DepthScan,
    Guide,
    PlenopticBound,
    hemisphere,
    plane_stack,
    plenoptic_grid,
    progress,
)
from peaking.guidance.guide import next_target, within_reach
from peaking.guidance.scan import middle_depth_m
from peaking.hole_filling import DEPTHS, choose_filling_views
from peaking.mpi import Mpi
from peaking.mpi_file import encode
from peaking.options import Options
from peaking.pipeline import Reconstruction
from peaking.rendering import Rendering
from peaking.server.recordings import wire_of_camera
from peaking.tracking import solution
from peaking.view_weights import (
    Neighbour,
    nearest_by_distance,
    nearest_by_overlap,
    overlap_shares,
)

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "web" / "fixtures"
OPTIONS = Options(
    pixels=60 * 130,
    generator="layered",
    num_planes=8,
    align="robust",
    neighbours=4,
    blend_weights="overlap",
    opacity="seen",
    filling_views=3,
    error_threshold=0.4,
    shift_px=0.5,
    compensate_exposure=True,
    marks="apart",
)


def fixtures() -> dict[str, bytes]:
    """Return all files by name."""
    mpi = desk_mpi()
    lossless = encode(mpi, codec="lossless")
    return {
        "desk.jpeg.mpi": encode(mpi, codec="jpeg"),
        "desk.lossless.mpi": lossless,
        "mpi_file.json": as_json(content_of(mpi)),
        "view_weights.json": as_json(view_weight_cases()),
        "exposure.json": as_json(exposure_cases()),
        "hole_filling.json": as_json(hole_filling_cases()),
        "guidance.json": as_json(guidance_cases()),
        "align.json": as_json(align_cases()),
    }


def desk_mpi() -> Mpi:
    """Return a small MPI of the sample scene."""
    field = Reconstruction(OPTIONS)
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


def view_weight_cases() -> list[dict[str, Any]]:
    """Return views, target and the neighbours by both ways, for random and for awkward cameras."""
    random = np.random.default_rng(7)
    cases = [
        view_weight_case([camera(random) for _ in range(n)], camera(random), 1.3, count)
        for n, count in ((1, 3), (2, 3), (5, 1), (12, 3), (12, 4), (90, 4))
    ]
    here = camera(random)
    cases += [
        view_weight_case([here], here, 2.0, 3),
        view_weight_case([here, here, here], here, 2.0, 2),
        view_weight_case([camera(random), here, camera(random)], here, 0.7, 3),
    ]
    return cases


def view_weight_case(
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
    """Return samples of a view and of a live picture, and the exposure."""
    random = np.random.default_rng(11)
    cases: list[dict[str, Any]] = []
    for gain, falloff, covered, size in (
        ((1.0, 1.0, 1.0), 0.0, 1.0, (20, 30)),
        ((1.3, 1.1, 0.8), 0.0, 0.7, (21, 30)),
        ((0.8, 0.8, 0.9), -0.3, 1.0, (40, 30)),
        ((1.0, 1.0, 1.0), -0.4, 0.8, (30, 40)),
        ((3.0, 0.3, 1.0), 0.0, 1.0, (20, 30)),  # beyond the range
        ((1.3, 1.3, 1.3), 0.0, 1.0, (4, 6)),  # too few
        ((1.2, 1.2, 1.2), 0.0, 0.0, (20, 30)),  # nothing covered
    ):
        view = random.integers(0, 256, (*size, 4), dtype=np.uint8)
        view[..., 3] = np.where(random.uniform(size=size) < covered, 255, 90)
        noise = random.uniform(0.9, 1.1, (*size, 3))
        corners = Exposure(np.ones(3, np.float32), falloff).factors(size[1], size[0])[..., None]
        lit = view[..., :3] * np.array(gain) * corners
        live = np.clip(lit * noise, 0, 255).astype(np.uint8)
        spread = np.ones((STRIDE_PX, STRIDE_PX, 1), np.uint8)
        rgba = np.kron(view, spread).astype(np.float32) / np.float32(255)
        rendering = Rendering(rgba, np.ones(rgba.shape[:2], np.float32))
        opaque = np.full((*size, 1), 255, np.uint8)
        found = measure_exposure(rendering, np.kron(live, spread))
        cases.append(
            {
                "view": view.ravel().tolist(),
                "live": np.concatenate([live, opaque], axis=-1).ravel().tolist(),
                "width_px": STRIDE_PX * size[1],
                "height_px": STRIDE_PX * size[0],
                "gain": found.gain.astype(float).tolist(),
                "falloff": found.falloff,
            }
        )
    return cases


def hole_filling_cases() -> list[dict[str, Any]]:
    """Return cameras and opacities of blocks, and which views fill what is empty."""
    random = np.random.default_rng(17)
    depths_m = np.array([3.0, 2.2, 1.6, 1.1, 0.8])
    pinhole = Pinhole(28, 42, 30.0, 30.0, 14.5, 20.0)
    cases: list[dict[str, Any]] = []
    for views, empty in ((3, 0.3), (12, 0.2), (12, 0.0), (80, 0.6), (1, 0.5)):
        cameras = [Camera(pinhole, camera(random).world_from_cam) for _ in range(views)]
        target = Camera(pinhole, camera(random).world_from_cam)
        opacity = np.full((42, 28), 255, np.uint8)
        opacity[:, : round(28 * empty)] = random.integers(0, 200, (42, round(28 * empty)))
        chosen = choose_filling_views(
            cameras,
            target,
            opacity.astype(np.float32) / np.float32(255),
            depths_m,
            blended=[0],
            count=3,
        )
        cases.append(
            {
                "cameras": [wire(view) for view in cameras],
                "target": wire(target),
                "opacity": opacity.ravel().tolist(),
                "fill_depths_m": np.quantile(depths_m, DEPTHS).tolist(),
                "scene_depth_m": float(np.median(depths_m)),
                "chosen": list(chosen),
            }
        )
    return cases


def guidance_cases() -> dict[str, Any]:
    """Return scans with their z_min, and guides with their targets and what views have taken."""
    random = np.random.default_rng(13)
    scans: list[dict[str, Any]] = []
    for known in (1.0, 0.6, 0.04):
        scan = DepthScan()
        maps = random.integers(300, 4000, (5, 12, 16)) * (random.uniform(size=(5, 12, 16)) < known)
        answers: list[list[float]] = []
        for depth_mm in maps:
            scan.add(depth_mm / 1000.0)
            middle_m = middle_depth_m(depth_mm / 1000.0)
            answers.append([-1.0 if m is None else m for m in (scan.z_min_m, middle_m)])
        scans.append({"maps_mm": maps.reshape(5, -1).tolist(), "z_min_and_middle_m": answers})
    bounds = [
        (camera(random), z_min_m, area_side_m, num_planes)
        for z_min_m, area_side_m, num_planes in ((0.5, 0.15, 32), (0.31, 0.06, 16), (1.2, 0.1, 64))
    ]
    return {
        "scans": scans,
        "guides": [guide_case(random, *bound) for bound in bounds],
    }


def guide_case(
    random: np.random.Generator,
    here: Camera,
    z_min_m: float,
    area_side_m: float,
    num_planes: int,
) -> dict[str, Any]:
    """Return a bound and its three guides around a camera, each with views near its targets."""
    bound = PlenopticBound.of_camera(
        here.pinhole, z_min_m, area_side_m=area_side_m, num_planes=num_planes
    )
    anchor = here.world_from_cam
    guides: dict[str, Guide] = {
        "plenoptic": plenoptic_grid(anchor, bound),
        "planes": plane_stack(anchor, bound),
        "hemisphere": hemisphere(anchor, 2 * z_min_m),
    }
    return {
        "camera": wire(here),
        "z_min_m": z_min_m,
        "area_side_m": area_side_m,
        "num_planes": num_planes,
        "spacing_m": bound.spacing_m,
        "num_views": bound.num_views,
        "views_per_side": bound.views_per_side,
        "pitch_m": bound.pitch_m,
        "guides": {name: guide_answers(random, here, guide) for name, guide in guides.items()},
    }


def guide_answers(random: np.random.Generator, here: Camera, guide: Guide) -> dict[str, Any]:
    """Return targets, views around some of them, and what those have taken; -1 is none."""
    views: list[Camera] = []
    for index in random.integers(0, len(guide.targets), 12):
        target = guide.targets[index]
        step_m = random.normal(size=3) * 0.6 * guide.near_enough.position_m
        turn = turned(random.normal(size=3), abs(random.normal() * 0.1))
        pose = Rigid[World, Cam](target.rotation @ turn, target.translation_m + step_m)
        views.append(Camera(here.pinhole, pose))
    taken_by = progress(guide, views).taken_by
    return {
        "targets": [target.matrix()[:3].ravel().tolist() for target in guide.targets],
        "position_tolerance_m": guide.near_enough.position_m,
        "views": [wire(view) for view in views],
        "taken_by": [none_is_minus_one(by) for by in taken_by],
        "next": [none_is_minus_one(next_target(guide, view, taken_by)) for view in views],
        "within_reach": [none_is_minus_one(within_reach(guide, view, taken_by)) for view in views],
    }


def align_cases() -> dict[str, Any]:
    """Return pictures with where they were taken, and the constants of the alignment."""
    lens = Pinhole(60, 80, 60.0, 60.5, 30.5, 39.5)
    here = Camera(lens, Rigid.identity())
    rendered = photographed(here)[1]
    hole = rendered.rgba.copy()
    hole[20:40, 10:30] = 0.0
    random = np.random.default_rng(17)
    noise = np.repeat(random.integers(0, 256, (80, 60, 1), dtype=np.uint8), 3, axis=-1)
    partly = photographed(disturbed(5, lens=lens))[0].copy()
    partly[:20] = noise[:20]
    tint = np.array([0.8, 0.7, 0.5])
    dark = np.round(tint * photographed(disturbed(3, lens=lens))[0]).astype(np.uint8)
    stripes = disturbed(4, 0.006, 0.0, lens=lens)
    cases = [
        *((photographed(disturbed(k, lens=lens))[0], rendered) for k in range(3)),
        (dark, rendered),
        (photographed(disturbed(6, lens=lens))[0], Rendering(hole, rendered.depth_m)),
        (partly, rendered),
        (photographed(stripes, upright_stripes)[0], photographed(here, upright_stripes)[1]),
        (photographed(here)[0], rendered),
        (photographed(here, bare)[0], photographed(here, bare)[1]),
        (noise, rendered),
        (photographed(disturbed(8, 0.25, lens=lens))[0], rendered),
    ]
    return {
        "constants": {
            name: getattr(module, name)
            for module in (tracking, solution)
            for name in dir(module)
            if name.isupper() and isinstance(getattr(module, name), int | float)
        },
        "cases": [align_case(here, live, rendering) for live, rendering in cases],
    }


def align_case(here: Camera, live: np.ndarray, rendering: Rendering) -> dict[str, Any]:
    """Return pictures as bytes (rows from the top; depth in tenths of a millimetre) and answer."""
    rgba = np.round(255 * rendering.rgba).astype(np.uint8)
    depth = np.round(10_000 * rendering.depth_m).astype("<u2")
    exact = Rendering(
        rgba.astype(np.float32) / np.float32(255), depth.astype(np.float32) / np.float32(10_000)
    )
    answer = tracking.align(exact, here, live, backend="numpy")
    live_from_cam = answer.camera.world_from_cam.inverse() @ here.world_from_cam
    opaque = np.full((*live.shape[:2], 1), 255, np.uint8)
    return {
        "lens": wire(here)["pinhole"],
        "rendered": packed(rgba),
        "depth_0_1_mm": packed(depth),
        "live": packed(np.concatenate([live, opaque], axis=-1)),
        "failure": answer.failure,
        "live_from_cam": live_from_cam.matrix()[:3].ravel().tolist(),
        "move_sd_m": answer.move_sd_m.tolist(),
        "turn_sd_rad": answer.turn_sd_rad.tolist(),
        "agreeing": answer.agreeing,
        "num_pixels": answer.num_pixels,
        "moved_m": answer.moved_m,
        "turned_rad": answer.turned_rad,
    }


def packed(values: np.ndarray) -> str:
    """Return the bytes of an array, deflated, as text."""
    return base64.b64encode(zlib.compress(values.tobytes(), 9)).decode()


def none_is_minus_one(index: int | None) -> int:
    """Return an index as a number, so that documents can be compared number by number."""
    return -1 if index is None else index


def camera(random: np.random.Generator) -> Camera:
    """Return a camera within a metre of the origin that looks within a radian of +z."""
    rotation = turned(random.normal(size=3), random.uniform(0, 1.0))
    width, height = (294, 639) if random.uniform() < 0.5 else (640, 480)
    fx, fy = random.uniform(250, 700, 2)
    cx, cy = width * random.uniform(0.4, 0.6), height * random.uniform(0.4, 0.6)
    pinhole = Pinhole(width, height, float(fx), float(fy), float(cx), float(cy))
    return Camera(pinhole, Rigid(rotation, random.uniform(-1, 1, 3)))


def turned(axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Return the rotation about an axis of any length."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


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
