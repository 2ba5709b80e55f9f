"""Data sets of nerfstudio, and of instant-ngp: transforms.json.

nerfstudio (docs/quickstart/data_conventions.md, nerfstudio_dataparser.py) takes depth, and masks,
for all frames or for none: where one has some, the others get maps in which all is unknown, or all
counts. instant-ngp (src/nerf_loader.cu) wants depth of the size of the picture, and in place of
masks files beside the pictures, in which what is not 0 is left out.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from peaking.datasets.nerfstudio import open_recording
from peaking.datasets.nerfstudio_writer import WrittenFrame, write_frame
from peaking.datasets.transforms_json import FILE_NAME
from peaking.export.checking import Meant, meant
from peaking.export.material import Material, depth_resized
from peaking.export.points import NO_POINTS, Gathering
from peaking.export.writing import Written, encode_mask, write
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.output import depth_mm

POINTS = "points.ply"
NGP_SCALE = 0.33
"""instant-ngp's units per metre, where a file does not say otherwise."""
NGP_LARGEST = 128
"""Of its boxes, in its units."""


def write_nerfstudio(material: Material, folder: Path) -> Written:
    """Write a data set of nerfstudio, with points to start from."""
    has_depth = any(material.recording.depth_size_px(index) for index in material.indices)
    has_masks = False
    gathering = Gathering(material, np.random.default_rng(0))
    entries: list[dict[str, Any]] = []
    notes: list[Meant] = []
    for place in material.places:
        frame = material.read(place)
        gathering.add(frame)
        if has_depth and frame.depth_m is None:
            frame = replace(frame, depth_m=np.zeros(frame.rgb.shape[:2], np.float32))
        has_masks |= frame.mask is not None
        entry, note = _written(material, place, frame, folder)
        entries.append(entry)
        notes.append(note)
    if has_masks:
        _complete_masks(entries, material, folder)
    points = gathering.points()
    top: dict[str, Any] = {"camera_model": "OPENCV", "depth_unit_scale_factor": 0.001}
    if len(points):
        write(folder, POINTS, points.encode_ply())
        top["ply_file_path"] = POINTS
    _write_json(folder, {**_shared(entries), **top, **_applied(material), "frames": entries})
    said = () if len(points) else (NO_POINTS,)
    return Written(notes, _read_back(folder), said)


def write_instant_ngp(material: Material, folder: Path) -> Written:
    """Write a data set of instant-ngp."""
    entries: list[dict[str, Any]] = []
    notes: list[Meant] = []
    far_m = 0.0
    for place in material.places:
        frame = material.read(place)
        if frame.depth_m is not None:
            frame = replace(
                frame, depth_m=depth_resized(frame.depth_m, *frame.camera.pinhole.size_px)
            )
        entry, note = _written(material, place, frame, folder)
        if "depth_file_path" in entry:
            entry["depth_path"] = entry.pop("depth_file_path")
        if frame.mask is not None:
            write(folder, f"images/dynamic_mask_{frame.name}.png", encode_mask(~frame.mask))
        far_m = max(far_m, float(np.percentile(note.seen[:, 2], 95)) if len(note.seen) else 0.0)
        entries.append(entry)
        notes.append(note)
    top = {
        **_shared(entries),
        "camera_model": "OPENCV",
        "integer_depth_scale": 0.001,
        "scale": NGP_SCALE,
        "aabb_scale": _aabb_scale(material.cameras, far_m),
    }
    _write_json(folder, {**top, **_applied(material), "frames": entries})
    return Written(notes, _read_back(folder))


def _shared(entries: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the intrinsics that all frames have: some programs look for them at the top only."""
    first = {key: entries[0][key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")}
    same = all(first.items() <= entry.items() for entry in entries)
    return first if same else {}


def _written(
    material: Material, place: int, frame: Frame, folder: Path
) -> tuple[dict[str, Any], Meant]:
    data, _ = material.picture(place, frame)
    entry = write_frame(WrittenFrame(frame, data, int(material.indices[place])), folder)
    depth = None
    if frame.depth_m is not None:
        depth = entry["depth_file_path"], depth_mm(frame.depth_m)
    return entry, meant(material, frame, (entry["file_path"], data), depth=depth)


def _complete_masks(entries: list[dict[str, Any]], material: Material, folder: Path) -> None:
    """Give frames without a mask one in which all counts."""
    for entry, name in zip(entries, material.names, strict=True):
        if "mask_path" not in entry:
            entry["mask_path"] = f"masks/{name}.png"
            mask = np.ones((entry["h"], entry["w"]), np.bool_)
            write(folder, entry["mask_path"], encode_mask(mask))


def _applied(material: Material) -> dict[str, Any]:
    """Return how the world was moved, as nerfstudio says it: written from recorded, 3x4."""
    matrix = material.out_from_world.matrix()
    return {} if np.array_equal(matrix, np.eye(4)) else {"applied_transform": matrix[:3].tolist()}


def _write_json(folder: Path, content: dict[str, Any]) -> None:
    write(folder, FILE_NAME, (json.dumps(content, indent=1) + "\n").encode())


def _read_back(folder: Path) -> list[tuple[str, Camera]]:
    return [(view.picture.as_posix(), view.camera) for view in open_recording(folder).views]


def _aabb_scale(cameras: Sequence[Camera], far_m: float) -> int:
    """Return the side of the box, a power of 2, that holds all cameras and what they see."""
    reach_m = max(float(np.abs(camera.position_m).max()) for camera in cameras) + far_m
    side = 2 * reach_m * NGP_SCALE
    return int(min(NGP_LARGEST, 2 ** max(0, int(np.ceil(np.log2(max(side, 1.0)))))))
