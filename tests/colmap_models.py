"""COLMAP models of drawn shots: by pycolmap, which is COLMAP's own code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap

from peaking.geometry import Camera
from written_formats import Shot, png


def reconstruction(
    taken: Sequence[Shot],
    names: Sequence[str],
    *,
    model: str = "PINHOLE",
    params: Sequence[float] | None = None,
    step: int = 4,
) -> pycolmap.Reconstruction:
    """Return a model of shots: each pixel of every `step` is a point seen in that shot alone."""
    found = pycolmap.Reconstruction()
    k = taken[0].camera.pinhole
    own = [k.fx_px, k.fy_px, k.cx_px, k.cy_px] if params is None else list(params)
    found.add_camera_with_trivial_rig(
        pycolmap.Camera(model=model, width=k.width_px, height=k.height_px, params=own, camera_id=7)
    )
    for number, (shot, name) in enumerate(zip(taken, names, strict=True), start=1):
        features = k.pixel_centers()[::step, ::step].reshape(-1, 2)
        cam_from_world = shot.camera.world_from_cam.inverse().matrix()[:3]
        image = pycolmap.Image(name=name, camera_id=7, image_id=number, keypoints=features)
        found.add_image_with_trivial_frame(image, pycolmap.Rigid3d(cam_from_world))
        points_m = points_of(shot, step)
        for index, point_m in enumerate(points_m):
            track = pycolmap.Track()
            track.add_element(number, index)
            found.add_point3D(point_m, track, np.array([1, 2, 3], np.uint8))
    return found


def points_of(shot: Shot, step: int = 4) -> np.ndarray:
    camera: Camera = shot.camera
    depth_m = shot.depth_m[::step, ::step].reshape(-1, 1).astype(np.float64)
    in_cam_m = camera.pinhole.rays()[::step, ::step].reshape(-1, 3) * depth_m
    return camera.world_from_cam.apply(in_cam_m)


def write_colmap(
    root: Path,
    taken: Sequence[Shot],
    *,
    text: bool = False,
    place: str = "sparse/0",
    pictures: str | None = "images",
    names: Sequence[str] | None = None,
) -> Path:
    names = names or [f"frame_{i}.png" for i in range(len(taken))]
    folder = root / place
    folder.mkdir(parents=True)
    found = reconstruction(taken, names)
    (found.write_text if text else found.write_binary)(str(folder))
    for shot, name in zip(taken, names, strict=True):
        if pictures is not None:
            png(root / pictures / name, shot.rgb)
    return root
