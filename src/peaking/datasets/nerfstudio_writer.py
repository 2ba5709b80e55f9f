"""Writes frames as a data set in nerfstudio's format: what every other format is handed on as."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from peaking.datasets.transforms_json import FILE_NAME
from peaking.frame import Frame
from peaking.geometry import OPENCV_FROM_OPENGL
from peaking.output import complete_or_absent, depth_mm, encode_jpeg, encode_png
from peaking.pictures import jpeg


@dataclass(frozen=True)
class WrittenFrame:
    """A frame to be written.

    Attributes:
        frame: With straight picture, depth and mask.
        picture: The bytes of a JPEG or PNG of the same pixels; encoded (JPEG, 95) where None.
        source_index: Which frame of its recording it was, where it is noted.
    """

    frame: Frame
    picture: bytes | None = None
    source_index: int | None = None


def write_frames(frames: Iterable[WrittenFrame], out: Path) -> None:
    """Write a data set; frames are asked for one at a time, and have unique names.

    Depth is in millimetres; points that a frame sees are a .ply of its own, where it has no depth.

    Args:
        frames: In the order in which they are written.
        out: The folder, new or empty; it appears only when it is complete.

    Raises:
        OutputError: `out` is taken, full or not writable.
    """
    with complete_or_absent(out) as folder:
        listed = [write_frame(one, folder) for one in frames]
        # Brush knows no PINHOLE; OPENCV without coefficients is read everywhere.
        text = json.dumps({"camera_model": "OPENCV", "frames": listed}, indent=1)
        (folder / FILE_NAME).write_text(text + "\n", encoding="utf-8")


def write_frame(one: WrittenFrame, folder: Path) -> dict[str, Any]:
    """Write the files of a frame into a folder, and return its entry of transforms.json."""
    frame, k = one.frame, one.frame.camera.pinhole
    data = one.picture or encode_jpeg(frame.rgb)
    ending = "jpg" if data.startswith(jpeg.START) else "png"
    files: dict[str, tuple[str, bytes]] = {"file_path": (f"images/{frame.name}.{ending}", data)}
    if frame.depth_m is not None:
        depth = encode_png(depth_mm(frame.depth_m))
        files["depth_file_path"] = (f"depths/{frame.name}.png", depth)
    elif frame.points_m is not None and len(frame.points_m):
        files["ply_file_path"] = (f"points/{frame.name}.ply", ply_of(frame.points_m))
    if frame.mask is not None:
        mask = encode_png(frame.mask.astype(np.uint8) * np.uint8(255))
        files["mask_path"] = (f"masks/{frame.name}.png", mask)
    for name, content in files.values():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
    matrix = frame.camera.world_from_cam.matrix() @ OPENCV_FROM_OPENGL
    times = {} if frame.timestamp_s is None else {"timestamp": frame.timestamp_s}
    source = {} if one.source_index is None else {"source_index": one.source_index}
    return {
        **{key: name for key, (name, _) in files.items()},
        "w": k.width_px,
        "h": k.height_px,
        "fl_x": k.fx_px,
        "fl_y": k.fy_px,
        "cx": k.cx_px,
        "cy": k.cy_px,
        "transform_matrix": matrix.tolist(),
        **times,
        **source,
    }


def ply_of(points_m: Float64[np.ndarray, "n 3"]) -> bytes:
    """Return points as the bytes of a .ply: x, y, z in double precision."""
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points_m)}\n{axes}"
    return f"{head}end_header\n".encode() + points_m.astype("<f8").tobytes()
