"""A small trace, as /check writes one."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from capture_uploads import HEIGHT, WIDTH, photo
from peaking.server.wire import TRACE_VERSION

IDENTITY = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
PROJECTION = [2.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, -1, 0, 0, -0.2, 0]
DEPTH_MM = np.arange(700, 700 + 16 * 9, dtype="<u2").reshape(9, 16)


def frame(number: int, **changes: Any) -> dict[str, Any]:
    """Return a frame with picture and depth."""
    return {
        "time_ms": 33.3 * number,
        "began_ms": 33.3 * number + 1,
        "took_ms": 2.5,
        "world_from_view": [*IDENTITY[:12], 0.1 * number, 0, 0, 1],
        "projection": PROJECTION,
        "camera_px": [2 * WIDTH, 2 * HEIGHT],
        "picture": {"width_px": WIDTH, "height_px": HEIGHT},
        "depth": {
            "width_px": 16,
            "height_px": 9,
            "format": "luminance-alpha",
            "metres_per_unit": 0.001,
            "buffer_from_view": IDENTITY,
        },
        "resets": [],
    } | changes


LOST = {"world_from_view": None, "projection": None, "camera_px": None}
BARE = {"picture": None, "depth": None}


def index(**changes: Any) -> dict[str, Any]:
    """Return a trace of four frames: whole, tracking lost, without a picture, without depth."""
    frames = [frame(0), frame(1, **LOST, **BARE), frame(2, **BARE), frame(3, depth=None)]
    return {
        "version": TRACE_VERSION,
        "made_s": 1.7e9,
        "told": {"browser": "Chrome"},
        "frames": frames,
    } | changes


def write_trace(path: Path, files: dict[str, bytes | None] | None = None, **changes: Any) -> Path:
    """Write a trace; `files` puts others in the place of some, and None leaves them out."""
    whole: dict[str, bytes | None] = {
        "trace.json": json.dumps(index(**changes)).encode(),
        "pictures/000000.jpg": photo(0),
        "depth/000000.bin": DEPTH_MM.tobytes(),
        "pictures/000003.jpg": photo(3),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in (whole | (files or {})).items():
            if data is not None:
                file.writestr(name, data)
    return path
