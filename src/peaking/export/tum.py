"""TUM RGB-D: rgb/, depth/, rgb.txt, depth.txt, groundtruth.txt.

Source: vision.in.tum.de/data/datasets/rgbd-dataset/file_formats. Depth is 16 bits, 5000 to the
metre, at the size of the picture. There is no room for intrinsics: they are in a comment, and in
calibration.txt (fx fy cx cy, of OpenCV's pixels, as ETH3D writes it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt16

from peaking.export.checking import Meant, meant
from peaking.export.material import Material, depth_resized
from peaking.export.writing import Written, quaternion_wxyz, rotation_of_wxyz, words, write
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.output import encode_png

PER_METRE = 5000
FRAMES_PER_S = 30.0
"""Where the recording has no times, or none that grow."""
DIGITS = 6


def write_tum(material: Material, folder: Path) -> Written:
    """Write a sequence."""
    times_s, has_times = _times_s(material)
    notes: list[Meant] = []
    pictures, depths, poses = list[str](), list[str](), list[str]()
    masks = 0
    for place in material.places:
        frame = material.read(place)
        stamp = f"{times_s[place]:.{DIGITS}f}"
        data, ending = material.picture(place, frame)
        name = f"rgb/{stamp}.{ending}"
        write(folder, name, data)
        pictures.append(f"{stamp} {name}")
        depth = None
        if frame.depth_m is not None:
            size_px = frame.camera.pinhole.size_px
            full_m = depth_resized(frame.depth_m, *size_px)
            frame = replace(frame, depth_m=full_m)
            depth = f"depth/{stamp}.png", _depth_units(full_m)
            write(folder, depth[0], encode_png(depth[1]))
            depths.append(f"{stamp} {depth[0]}")
        w, *xyz = quaternion_wxyz(frame.camera.world_from_cam.rotation)
        poses.append(f"{stamp} {words(frame.camera.position_m)} {words([*xyz, w])}")
        masks += frame.mask is not None
        notes.append(meant(material, frame, (name, data), depth=depth, depth_unit_m=1 / PER_METRE))
    k = material.cameras[0].pinhole
    intrinsics = words([k.fx_px, k.fy_px, k.cx_px - 0.5, k.cy_px - 0.5])
    of_pixels = f"fx fy cx cy = {intrinsics} (the centre of the first pixel is 0 0)"
    for name, lines in (("rgb", pictures), ("depth", depths), ("groundtruth", poses)):
        columns = "tx ty tz qx qy qz qw" if name == "groundtruth" else "filename"
        head = [f"# {of_pixels}", f"# timestamp {columns}"]
        if lines:
            write(folder, f"{name}.txt", "\n".join([*head, *lines, ""]).encode())
    write(folder, "calibration.txt", f"{intrinsics}\n".encode())
    said = [f"TUM's files have no intrinsics: {of_pixels}, also in calibration.txt"]
    if any(camera.pinhole != k for camera in material.cameras):
        said.append("pictures have different intrinsics; these are those of the first")
    if not has_times:
        said.append(f"the recording has no times that grow: {FRAMES_PER_S:g} frames a second")
    if masks:
        said.append(f"TUM has no masks: {masks} were left out (their depth is unknown)")
    read = _read_back(folder, [camera.pinhole for camera in material.cameras])
    return Written(notes, read, tuple(said))


def _times_s(material: Material) -> tuple[Sequence[float], bool]:
    """Return times that grow by at least what is written, and whether they are recorded."""
    recorded = [material.recording.timestamps_s[index] for index in material.indices]
    known = [time_s for time_s in recorded if time_s is not None]
    if len(known) == len(recorded) and (np.diff(known) >= 2 * 10.0**-DIGITS).all():
        return known, True
    return [place / FRAMES_PER_S for place in range(len(recorded))], False


def _depth_units(depth_m: Float32[np.ndarray, "h w"]) -> UInt16[np.ndarray, "h w"]:
    """Return depth in 1/5000 m; 0, unknown, is also what 16 bits have no room for (13.1 m)."""
    units = np.rint(depth_m.astype(np.float64) * PER_METRE)
    return np.where((units > 0) & (units < 65535), units, 0).astype(np.uint16)


def _read_back(folder: Path, pinholes: Sequence[Pinhole]) -> list[tuple[str, Camera]]:
    """Read what was written; only the first frame's intrinsics are there."""
    text = (folder / "calibration.txt").read_text(encoding="utf-8")
    fx, fy, cx, cy = map(float, text.split())
    first = pinholes[0]
    kept = Pinhole(first.width_px, first.height_px, fx, fy, cx + 0.5, cy + 0.5)
    names = dict(line.split(" ", 1) for line in _lines(folder / "rgb.txt"))
    found: list[tuple[str, Camera]] = []
    for line, own in zip(_lines(folder / "groundtruth.txt"), pinholes, strict=True):
        stamp, *numbers = line.split()
        pose = np.array(numbers, float)
        rotation = rotation_of_wxyz(np.roll(pose[3:], 1))
        pinhole = own if own != first else kept
        found.append((names[stamp], Camera(pinhole, Rigid(rotation, pose[:3]))))
    return found


def _lines(path: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if not line.startswith("#")]
