"""Tiny recordings for tests: a textured wall and a box before it, cast ray by ray.

Pictures and depth are right for every pose (no noise but the rounding to 8 bits and millimetres),
so a test can render what any camera would have seen and compare.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from peaking.geometry import OPENCV_FROM_OPENGL, Cam, Camera, Pinhole, Rigid, World
from peaking.output import encode_png

STEP_M = 0.05
"""Between two neighbouring cameras of a recording."""


@dataclass(frozen=True)
class Room:
    """A wall at `z = wall_m + slant * x` and, before it, a box (none when `box_m` is None)."""

    wall_m: float = 2.0
    slant: float = 0.0
    box_m: tuple[tuple[float, float, float], tuple[float, float, float]] | None = (
        (-0.25, -0.2, 1.0),
        (0.25, 0.2, 1.3),
    )

    def seen(
        self, rays: Float64[np.ndarray, "*n 3"], world_from_cam: Rigid[World, Cam]
    ) -> tuple[UInt8[np.ndarray, "*n 3"], Float32[np.ndarray, "*n"]]:
        """Return colour and depth in metres (0 where nothing is hit) of rays with z = 1."""
        start = world_from_cam.translation_m
        step = rays @ world_from_cam.rotation.T
        with np.errstate(divide="ignore", invalid="ignore"):
            depth_m = (self.wall_m + self.slant * start[0] - start[2]) / (
                step[..., 2] - self.slant * step[..., 0]
            )
            depth_m = np.where(depth_m > 0, depth_m, np.inf)
            on_box = np.zeros(depth_m.shape, dtype=bool)
            if self.box_m is not None:
                low, high = (np.array(corner) for corner in self.box_m)
                sides = np.sort(np.stack([(low - start) / step, (high - start) / step]), axis=0)
                enters, leaves = sides[0].max(axis=-1), sides[1].min(axis=-1)
                on_box = (enters > 0) & (enters <= leaves) & (enters < depth_m)
                depth_m = np.where(on_box, enters, depth_m)
        hit = np.isfinite(depth_m)
        points_m = start + step * np.where(hit, depth_m, 0.0)[..., None]
        colour = np.where(on_box[..., None], _on_box(points_m), _on_wall(points_m))
        colour = np.where(hit[..., None], colour, 0.0)
        return np.round(255 * colour).astype(np.uint8), np.where(hit, depth_m, 0.0).astype(
            np.float32
        )

    def photographed(
        self, camera: Camera
    ) -> tuple[UInt8[np.ndarray, "h w 3"], Float32[np.ndarray, "h w"]]:
        """Return the picture and the depth in metres that a camera gets."""
        return self.seen(camera.pinhole.rays(), camera.world_from_cam)


def lateral_cameras(num_frames: int, width_px: int, height_px: int) -> list[Camera]:
    """Return cameras that go sideways along x and turn a little, centred before the box."""
    pinhole = Pinhole(
        width_px,
        height_px,
        0.9 * width_px,
        0.9 * width_px,
        width_px / 2 + 1.25,
        height_px / 2 - 0.5,
    )
    cameras: list[Camera] = []
    for i in range(num_frames):
        along = i - (num_frames - 1) / 2
        turn_rad = 0.02 * along
        rotation = np.array(
            [
                [np.cos(turn_rad), 0.0, -np.sin(turn_rad)],
                [0.0, 1.0, 0.0],
                [np.sin(turn_rad), 0.0, np.cos(turn_rad)],
            ]
        )
        position_m = np.array([STEP_M * along, 0.01 * (i % 2), 0.0])
        cameras.append(Camera(pinhole, Rigid(rotation, position_m)))
    return cameras


def transforms_json(cameras: list[Camera], *, with_depth: bool = True) -> dict[str, Any]:
    """Return transforms.json for cameras that share their intrinsics."""
    k = cameras[0].pinhole
    frames: list[dict[str, Any]] = []
    for i, camera in enumerate(cameras):
        world_from_opengl = camera.world_from_cam.matrix() @ OPENCV_FROM_OPENGL
        frame: dict[str, Any] = {
            "file_path": f"images/frame_{i:05d}.png",
            "transform_matrix": world_from_opengl.tolist(),
            "timestamp": i / 30,
        }
        if with_depth:
            frame["depth_file_path"] = f"depths/frame_{i:05d}.png"
        frames.append(frame)
    top: dict[str, Any] = {
        "camera_model": "PINHOLE",
        "fl_x": k.fx_px,
        "fl_y": k.fy_px,
        "cx": k.cx_px,
        "cy": k.cy_px,
        "w": k.width_px,
        "h": k.height_px,
    }
    return {**top, "frames": frames}


def write_recording(
    folder: Path,
    *,
    num_frames: int = 4,
    width_px: int = 64,
    height_px: int = 48,
    with_depth: bool = True,
    room: Room | None = None,
    cameras: list[Camera] | None = None,
) -> Path:
    """Write a nerfstudio data set of cameras (`lateral_cameras`) in a room; return its folder."""
    cameras = cameras or lateral_cameras(num_frames, width_px, height_px)
    room = room or Room()
    (folder / "images").mkdir(parents=True)
    (folder / "depths").mkdir()
    for i, camera in enumerate(cameras):
        rgb, depth_m = room.photographed(camera)
        (folder / f"images/frame_{i:05d}.png").write_bytes(encode_png(rgb))
        if with_depth:
            depth_mm = np.round(1000 * depth_m).astype(np.uint16)
            (folder / f"depths/frame_{i:05d}.png").write_bytes(encode_png(depth_mm))
    text = json.dumps(transforms_json(cameras, with_depth=with_depth), indent=1)
    (folder / "transforms.json").write_text(text)
    return folder


def _on_wall(points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
    """Colour in 0…1, without edges finer than about 20 cm."""
    x, y, _ = np.moveaxis(points_m, -1, 0)
    turn = 2 * np.pi
    return 0.5 + 0.4 * np.stack(
        [np.sin(turn * 2.1 * x), np.sin(turn * (1.3 * x + 2.3 * y)), np.cos(turn * 1.7 * y)],
        axis=-1,
    )


def _on_box(points_m: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
    """Warm colours, so that box and wall are never alike."""
    x, y, z = np.moveaxis(points_m, -1, 0)
    waves = np.sin(2 * np.pi * (3.1 * x + 2.7 * z)) * np.cos(2 * np.pi * 2.9 * y)
    return np.stack([0.8 + 0.15 * waves, 0.45 + 0.2 * waves, 0.1 + 0.05 * waves], axis=-1)
