"""Small captures, as a phone would send them."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from peaking.output import encode_jpeg
from peaking.server import wire

WIDTH, HEIGHT = 60, 128
DEPTH_WIDTH, DEPTH_HEIGHT = 15, 32
SESSION_ID = "5e551011-0000-4000-8000-000000000001"


def capture_id(number: int) -> str:
    """Return the id of the so-manieth capture."""
    return f"c0ffee00-0000-4000-8000-{number:012d}"


def new_session(**changes: Any) -> dict[str, Any]:
    """Return the body that begins a session."""
    return {"protocol": wire.PROTOCOL, "name": "Kitchen", "source": "virtual"} | changes


def photo(number: int = 0) -> bytes:
    """Return a JPEG that is different for every number."""
    rgb = np.random.default_rng(number).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    return encode_jpeg(rgb, quality=60)


def depth_mm(number: int = 0) -> np.ndarray:
    """Return a wall with a box before it, and a hole."""
    depth = np.full((DEPTH_HEIGHT, DEPTH_WIDTH), 2000 + number % 1000, "<u2")
    depth[10:20, 4:10] = 1000
    depth[:2, :2] = 0
    return depth


def points_m(number: int = 0) -> np.ndarray:
    """Return 20 tracked points on the wall and 20 on the box of `depth_mm`, in the world."""
    generator = np.random.default_rng(number)
    depth_m = np.repeat([2.0 + number % 1000 / 1000, 1.0], 20)
    x_px = np.concatenate([generator.uniform(42, WIDTH, 20), generator.uniform(17, 39, 20)])
    y_px = np.concatenate([generator.uniform(0, HEIGHT, 20), generator.uniform(41, 79, 20)])
    along = np.stack([x_px - WIDTH / 2, y_px - HEIGHT / 2, np.full(40, 90.0)], axis=1) / 90.0
    return (along * depth_m[:, None] + [0.05 * number, 0, 0]).astype("<f4")


def header(number: int = 0, **changes: Any) -> dict[str, Any]:
    """Return the header of a good upload; `None` removes a field."""
    fields: dict[str, Any] = {
        "protocol": wire.PROTOCOL,
        "camera": {
            "pinhole": {
                "width_px": WIDTH,
                "height_px": HEIGHT,
                "fx_px": 90.0,
                "fy_px": 90.0,
                "cx_px": WIDTH / 2,
                "cy_px": HEIGHT / 2,
            },
            "world_from_cam": [1, 0, 0, 0.05 * number, 0, 1, 0, 0, 0, 0, 1, 0],
        },
        "time_s": 1_700_000_000.0 + number,
        "photo_bytes": len(photo(number)),
        "depth": {"width_px": DEPTH_WIDTH, "height_px": DEPTH_HEIGHT},
    }
    return {k: v for k, v in (fields | changes).items() if v is not None}


def body_of(fields: dict[str, Any], rest: bytes) -> bytes:
    """Return an upload of any header and rest."""
    text = json.dumps(fields).encode()
    return struct.pack("<I", len(text)) + text + rest


def upload(number: int = 0) -> bytes:
    """Return a good upload."""
    return body_of(header(number), photo(number) + depth_mm(number).tobytes())


def upload_without_depth(number: int = 0) -> bytes:
    """Return a good upload that brings tracked points in the place of depth."""
    fields = header(number, depth=None, points=len(points_m(number)))
    return body_of(fields, photo(number) + points_m(number).tobytes())
