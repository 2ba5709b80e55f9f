"""LLFF (Fyusion/LLFF): images/ in the order of their names, and poses_bounds.npy.

A row for each picture: 3x5, of columns down, right, back, position, (height, width, focal length),
then the distances of the nearest and the farthest thing. There is no room for a principal point or
for two focal lengths: pictures of a camera that has them are cut, and drawn again, so that it has
not.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float64

from peaking.errors import RecordingError
from peaking.export.checking import Meant, meant
from peaking.export.material import Material, points_seen_m
from peaking.export.writing import Written, encode_mask, write
from peaking.frame import Frame
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.output import encode_jpeg

POSES = "poses_bounds.npy"
NUM_SEEN = 5000
"""Points of a frame that is drawn again, for the check."""
NEAR_FAR = (0.1, 99.9)
"""Percentiles of depth, as LLFF takes them."""


def write_llff(material: Material, folder: Path) -> Written:
    """Write pictures, and poses_bounds.npy.

    Raises:
        RecordingError: Nothing tells how far away things are.
    """
    pinhole = _centred([camera.pinhole for camera in material.cameras])
    rows: dict[str, Float64[np.ndarray, "17"]] = {}
    notes: dict[str, Meant] = {}
    bounds: dict[str, Float64[np.ndarray, "2"]] = {}
    for place in material.places:
        frame = material.read(place)
        seen = material.seen_m(frame)
        if len(seen):
            bounds[frame.name] = np.percentile(seen[:, 2], NEAR_FAR)
        if frame.camera.pinhole == pinhole:
            data, ending = material.picture(place, frame)
        else:
            some = seen[:: 1 + len(seen) // NUM_SEEN]
            frame = _drawn_again(frame, pinhole, points_seen_m(frame.camera, some))
            data, ending = encode_jpeg(frame.rgb), "jpg"
        name = f"images/{frame.name}.{ending}"
        write(folder, name, data)
        if frame.mask is not None:
            write(folder, f"masks/{frame.name}.{ending}.png", encode_mask(frame.mask))
        notes[name] = meant(material, frame, (name, data))
        pose = frame.camera.world_from_cam.matrix()[:3] @ _LLFF_FROM_OPENCV
        size = [[pinhole.height_px], [pinhole.width_px], [pinhole.fx_px]]
        rows[name] = np.hstack([pose, size]).ravel()
    if not bounds:
        raise RecordingError(
            material.recording.path,
            "says nowhere how far away things are, and LLFF needs the nearest and the farthest",
            remedy="take another format, or a recording with depth or points",
        )
    everywhere = np.array([min(b[0] for b in bounds.values()), max(b[1] for b in bounds.values())])
    names = sorted(rows)
    near_far = [bounds.get(Path(name).stem, everywhere) for name in names]
    table = np.hstack([np.array([rows[name] for name in names]), np.array(near_far)])
    with (folder / POSES).open("wb") as file:
        np.save(file, table)
    said = () if not _differs(material, pinhole) else (_said(material, pinhole),)
    return Written([notes[name] for name in names], _read_back(folder, names), said)


_LLFF_FROM_OPENCV = np.array(
    [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""From columns right, down, forward, position to columns down, right, back, position."""


def _differs(material: Material, pinhole: Pinhole) -> bool:
    return any(camera.pinhole != pinhole for camera in material.cameras)


def _said(material: Material, pinhole: Pinhole) -> str:
    width, height = material.cameras[0].pinhole.size_px
    return (
        "LLFF knows no principal point and one focal length: pictures were cut from "
        f"{width}x{height} to {pinhole.width_px}x{pinhole.height_px}, and drawn again"
    )


def _centred(pinholes: list[Pinhole]) -> Pinhole:
    """Return the largest camera with a principal point in its middle that all of these hold."""
    focal = float(np.median([k.fx_px for k in pinholes]))
    half_x = min(min(k.cx_px, k.width_px - k.cx_px) / k.fx_px for k in pinholes)
    half_y = min(min(k.cy_px, k.height_px - k.cy_px) / k.fy_px for k in pinholes)
    width = max(1, int(2 * half_x * focal + 1e-6))
    height = max(1, int(2 * half_y * focal + 1e-6))
    return Pinhole(width, height, focal, focal, width / 2, height / 2)


def _drawn_again(frame: Frame, pinhole: Pinhole, points_m: Float64[np.ndarray, "n 3"]) -> Frame:
    """Return a frame as another camera at its place would have taken it, with points as depth."""
    own = frame.camera.pinhole
    scale = np.array([own.fx_px / pinhole.fx_px, own.fy_px / pinhole.fy_px])
    shift = np.array([own.cx_px, own.cy_px]) - scale * [pinhole.cx_px, pinhole.cy_px]
    # OpenCV has the centre of the first pixel at 0 (CONVENTIONS.md).
    stored_from_new = np.column_stack([np.diag(scale), shift + 0.5 * scale - 0.5])
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    rgb = cv2.warpAffine(frame.rgb, stored_from_new, pinhole.size_px, flags=how)
    mask = frame.mask
    if mask is not None:
        nearest = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        counts = mask.astype(np.uint8)
        counts = cv2.warpAffine(counts, stored_from_new, pinhole.size_px, flags=nearest)
        mask = np.asarray(counts) > 0
    camera = Camera(pinhole, frame.camera.world_from_cam)
    drawn = replace(frame, rgb=np.asarray(rgb), mask=mask, camera=camera)
    return replace(drawn, depth_m=None, points_m=points_m)


def _read_back(folder: Path, names: list[str]) -> list[tuple[str, Camera]]:
    pictures = sorted(path.name for path in (folder / "images").iterdir())
    if [f"images/{name}" for name in pictures] != names:
        return []
    found: list[tuple[str, Camera]] = []
    for name, row in zip(names, np.load(folder / POSES), strict=True):
        down, right, back, position_m, (height, width, focal) = row[:15].reshape(3, 5).T
        pinhole = Pinhole(int(width), int(height), focal, focal, width / 2, height / 2)
        rotation = np.column_stack([right, down, -back])
        found.append((name, Camera(pinhole, Rigid(rotation, position_m))))
    return found
